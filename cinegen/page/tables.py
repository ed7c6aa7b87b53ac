"""The tables of one robot for the kernels of the page's solver, as `static/session/memory.js` takes them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.codegen.program import names_of_q
from cinegen.codegen.robot import set_up_robot
from cinegen.ik.task import FrameTask
from cinegen.jit.memory import Memory, memory_at
from cinegen.joints import supporting_columns
from cinegen.loops.setup import set_up_screws
from cinegen.model import Mechanism
from cinegen.page.kernels_module import FOLDED, MOST_TASKS, used_fields
from cinegen.page.solver_kernels import PageMemory
from cinegen.singularities.ball_joints import balls


def robot_tables(mechanism: Mechanism, rate: float) -> dict[str, Any]:
    """Return the tables of a mechanism at home.

    Args:
        mechanism: any whose joints the kernels move.
        rate: ticks per second.

    Returns:
        `names` of what the numbers are, and the values of memories' fields by name, `robot`, and `clusters`: only those
        that are not 0 or the default. Numbers that JSON has no form of are texts, such as "Infinity".

    Raises:
        CinegenError: a joint is of a kind that the kernels don't know.
    """
    memory, base = _memory(mechanism, rate), 6 * mechanism.floating
    names = {
        "q": names_of_q(mechanism), "actuated": mechanism.actuated, "nodes": mechanism.nodes,
        "velocities": [*range(base), *memory.q_index[base:].tolist()], "floating": mechanism.floating,
    }  # fmt: skip
    clusters = [_values(memory_at(int(handle))) for handle in memory.cluster_handles]
    return {"names": names, "robot": _values(memory) | {"tasks": 0}, "clusters": clusters}


def _values(memory: Memory) -> dict[str, Any]:
    """Return the fields of a memory that kernels use and that are not as they are without this."""
    values, kind = dict[str, Any](), type(memory)
    for name, value in FOLDED[kind].items():
        assert getattr(memory, name) == value, name
    for name, field in used_fields()[kind].items():
        value = getattr(memory, name)
        if field.shape is not None:
            numbers = np.asarray(value).ravel().tolist()
            if any(numbers):
                values[name] = [_number(number) for number in numbers]
        elif value != field.default and not (math.isnan(value) and math.isnan(field.default)):
            values[name] = _number(value)
    return values


def _number(value: float) -> float | str:
    """Return a number as JavaScript reads it from JSON."""
    if math.isfinite(value):
        return int(value) if value == int(value) and math.copysign(1.0, value) > 0 else value
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def _memory(mechanism: Mechanism, rate: float) -> PageMemory:
    memory, model = PageMemory(), mechanism.model
    frame = mechanism.frame_id(mechanism.end)
    tasks = [FrameTask(mechanism.end, pin.SE3.Identity(), frame=frame) for _ in range(MOST_TASKS)]
    set_up_robot(memory, mechanism, tasks, 1.0 / rate)
    samples = mechanism.structure.samples
    memory.resize(capacity=MOST_TASKS, samples=len(samples))
    memory.sample[:] = samples
    three = balls(mechanism)
    memory.resize(balls=len(three))
    memory.ball_dof[:] = np.reshape([mechanism.v_index(name) for names in three for name in names], (-1, 3))
    inner = {model.getJointId(name) for names in three for name in names[:2]}
    for i in range(memory.nodes):
        memory.node_is_inner[i] = int(memory.node_joint[i]) in inner
    for joint in range(model.njoints):
        memory.joint_moved_by[joint] = supporting_columns(model, joint)
    rank = mechanism.structure.passive_rank
    if rank > 0:
        set_up_screws(memory, mechanism.structure.screws)
        columns = mechanism.structure.screws.passive
        sides = len(columns), memory.screw_rows
        memory.resize(passive=len(columns), passive_lesser=min(sides), passive_larger=max(sides))
        memory.passive_column[:] = columns
        memory.passive_rank = min(rank + mechanism.structure.screws.cut, *sides)
    return memory
