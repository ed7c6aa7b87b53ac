"""The memory that a solver's kernels work on, set up for a mechanism."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.model import Mechanism
from cinegen.model.mechanism import translations
from cinegen.solve.kernel import memory as m
from cinegen.solve.kernel.memory import Memory
from cinegen.solve.kernel.thresholds import ERROR_CAP, STEP_CAP
from raff2urdf.document import LoopKind

Array = NDArray[np.float64]

_KINDS = (LoopKind.RIGID, LoopKind.PRISMATIC, LoopKind.REVOLUTE, LoopKind.BALL)  # as the kernels number them


def memory_of(mechanism: Mechanism, data: pin.Data, dt: float, gain: float) -> Memory:
    """All that does not depend on pulls."""
    model, loops = mechanism.model, mechanism.loops
    nv, rank, rows = model.nv, mechanism.loop_rank, sum(loop.rows for loop in loops)
    memory = Memory(nq=model.nq, nv=nv, n=nv, loops=len(loops), rows=rows, rank=rank)
    for name in ("q", "trial", "before"):
        memory.put(name, np.zeros(model.nq))
    for name in ("delta", "step", "taken", "moved", "last", "drift", "braking", "wish", "wish_free", "secondary"):
        memory.put(name, np.zeros(nv))
    for name in ("held", "stopped", "floor", "ceiling", "y", "x", "size"):
        memory.put(name, np.zeros(nv))
    memory.put("room", np.zeros((3, nv)))
    for name in ("motions", "axes", "g"):
        memory.put(name, np.zeros((nv, nv)))
    memory.put("work", np.zeros((3, nv, nv)))
    memory.put("scratch", np.zeros((6, nv)))
    memory.put("f", np.zeros((max(rows, nv), nv)))
    memory.put("h", np.zeros((nv, nv)))
    for name in ("order", "left", "tau"):
        memory.put(name, np.zeros(max(rows, nv)))
    memory.put("jc", np.zeros((rows, nv)))
    memory.put("c", np.zeros(rows))
    memory.put("loop_u", np.zeros((rows, rows)))
    memory.put("loop_b", np.zeros((rows, nv)))
    memory.put("loop_square", np.zeros(rows))
    memory.put("w", np.zeros((16, 3)))
    memory.put("r", np.zeros((4, 3)))
    memory.put("scale", mechanism.scale)
    settings = memory.put("settings", np.zeros(m.SETTINGS_WIDTH))
    settings[m.DT], settings[m.LENGTH], settings[m.GAIN], settings[m.ERROR_CAP] = dt, mechanism.length, gain, ERROR_CAP
    settings[m.BEND] = _bend(model, mechanism.length)
    settings[m.TRUST] = 1.0
    _put_limits(memory, mechanism, dt)
    _put_loops(memory, mechanism)
    if nv:
        memory.point("columns", m.address(data.J))
    memory.point("placements", m.placements_address(data))
    return memory


def _put_limits(memory: Memory, mechanism: Mechanism, dt: float) -> None:
    model, scale = mechanism.model, mechanism.scale
    at, low, high = np.full(model.nv, -1.0), np.full(model.nv, -np.inf), np.full(model.nv, np.inf)
    longest = np.full(model.nv, np.inf)
    for joint in model.joints:
        if joint.nq == 1 and joint.nv == 1 and joint.idx_v >= 0:
            i, k = joint.idx_q, joint.idx_v
            at[k], low[k], high[k] = i, model.lowerPositionLimit[i], model.upperPositionLimit[i]
            fastest = model.upperVelocityLimit[k]
            longest[k] = min(fastest * dt / scale[k], STEP_CAP) if fastest > 0.0 else STEP_CAP
    memory.put("at", at)
    memory.put("low", low)
    memory.put("high", high)
    memory.put("longest", longest)
    memory.put("acceleration", np.full(model.nv, np.inf))


def _put_loops(memory: Memory, mechanism: Mechanism) -> None:
    model = mechanism.model
    table = np.zeros((max(len(mechanism.loops), 1), m.LOOP_WIDTH))
    signs = np.zeros((max(len(mechanism.loops), 1), model.nv))
    row = 0
    for i, loop in enumerate(mechanism.loops):
        first, second = (model.frames[mechanism.frame_id(node)] for node in (loop.first, loop.second))
        table[i, : m.FIRST_LOCAL] = (
            _KINDS.index(loop.kind),
            first.parentJoint,
            second.parentJoint,
            row,
            loop.rows,
        )
        table[i, m.FIRST_LOCAL : m.FIRST_LOCAL + 12] = m.columns_of(first.placement * loop.first_placement)
        table[i, m.SECOND_LOCAL : m.SECOND_LOCAL + 12] = m.columns_of(second.placement * loop.second_placement)
        signs[i] = moves(model, second.parentJoint) - moves(model, first.parentJoint)
        row += loop.rows
    memory.put("loop_table", table)
    memory.put("signs", signs)


def moves(model: pin.Model, joint: int) -> Array:
    """(nv,) 1 for each column that moves what a joint carries, else 0."""
    columns = np.zeros(model.nv)
    for j in model.supports[joint]:
        if j > 0:
            columns[model.joints[j].idx_v : model.joints[j].idx_v + model.joints[j].nv] = 1.0
    return columns


def curved(model: pin.Model) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Where in q and in v the joints stand whose configuration is no number; None without any."""
    found = [joint for joint in model.joints if joint.idx_v >= 0 and not (joint.nq == 1 and joint.nv == 1)]
    if not found:
        return None
    at_q = np.concatenate([np.arange(joint.idx_q, joint.idx_q + joint.nq) for joint in found])
    at_v = np.concatenate([np.arange(joint.idx_v, joint.idx_v + joint.nv) for joint in found])
    return at_q, at_v


def _bend(model: pin.Model, length: float) -> float:
    """A bound on the second derivative of any placement by the joints, in characteristic lengths; infinite where a
    joint may slide without end or is no number."""
    reach = sum(float(np.linalg.norm(placement.translation)) for placement in model.jointPlacements)
    reach += max(float(np.linalg.norm(frame.placement.translation)) for frame in model.frames)
    for joint in model.joints:
        if joint.idx_v >= 0 and not (joint.nq == 1 and joint.nv == 1):
            return np.inf
        if joint.idx_v >= 0 and translations(joint):
            low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
            reach += max(abs(low), abs(high))
    return reach / length + 1.0
