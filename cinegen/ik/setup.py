"""The memory that a solver's kernels work on, set up for a mechanism."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cinegen.ik._kernels import memory as m
from cinegen.ik.thresholds import ERROR_CAP, NEAR, STEP_CAP
from cinegen.joints import translations
from cinegen.loops import arrays as loops
from cinegen.loops._kernels.memory import Memory
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.model import Mechanism

Array = NDArray[np.float64]


def memory_of(mechanism: Mechanism, system: ClosedLoops, dt: float) -> Memory:
    """All that does not depend on tasks, for Pinocchio's data in `system`."""
    model = mechanism.model
    nv = model.nv
    memory = loops.memory_of(system, mechanism.loop_rank, m.LAYOUT)
    for name in ("taken", "moved", "last", "drift", "braking", "wish", "wish_free", "secondary"):
        memory.put(name, np.zeros(nv))
    for name in ("y", "x", "size"):
        memory.put(name, np.zeros(nv))
    for name in ("motions", "axes"):
        memory.put(name, np.zeros((nv, nv)))
    make_room_for_barriers(memory, nv, 0)
    memory.put("work", np.zeros((3, nv, nv)))
    memory.put("scratch", np.zeros((6, nv)))
    memory.put("r", np.zeros((4, 3)))
    settings = np.zeros(m.SETTINGS_WIDTH)
    settings[m.LENGTH] = mechanism.length
    settings[m.DT], settings[m.GAIN], settings[m.ERROR_CAP] = dt, 1.0, ERROR_CAP
    settings[m.NEAR] = NEAR
    settings[m.BEND] = _bend(mechanism)
    settings[m.TRUST] = 1.0
    memory.put("settings", settings)
    _put_limits(memory, mechanism, dt)
    return memory


def make_room_for_barriers(memory: Memory, nv: int, count: int) -> None:
    """Room for so many rows of barriers in a tick."""
    for name in ("stopped", "floor", "ceiling"):
        memory.put(name, np.zeros(nv + count))
    memory.put("room", np.zeros((3, nv + count)))
    memory.put("g", np.zeros((nv + count, nv)))
    memory.put("barrier_rows", np.zeros((count, nv)))
    memory.put("barrier_room", np.zeros(count))


def _put_limits(memory: Memory, mechanism: Mechanism, dt: float) -> None:
    limits, nv = mechanism.limits, mechanism.model.nv
    at_q, at_v = mechanism.scalar_joints
    low, high, longest = np.full(nv, -np.inf), np.full(nv, np.inf), np.full(nv, np.inf)
    low[at_v], high[at_v] = limits.lower[at_q], limits.upper[at_q]
    longest[at_v] = np.minimum(limits.velocity[at_v] * dt / mechanism.scale[at_v], STEP_CAP)
    memory.put("low", low)
    memory.put("high", high)
    memory.put("longest", longest)
    memory.put("acceleration", np.full(nv, np.inf))


def _bend(mechanism: Mechanism) -> float:
    """A bound on the second derivative of any placement by the joints, in characteristic lengths; infinite where a
    joint may slide without end or is no number."""
    model = mechanism.model
    reach = sum(float(np.linalg.norm(placement.translation)) for placement in model.jointPlacements)
    reach += max(float(np.linalg.norm(frame.placement.translation)) for frame in model.frames)
    for joint in model.joints:
        if joint.idx_v >= 0 and not (joint.nq == 1 and joint.nv == 1):
            return np.inf
        if joint.idx_v >= 0 and translations(joint):
            low, high = mechanism.limits.lower[joint.idx_q], mechanism.limits.upper[joint.idx_q]
            reach += max(abs(low), abs(high))
    return reach / mechanism.length + 1.0
