"""The solver of a robot in the page: cinegen's own kernels in JavaScript, for any tasks."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from cinegen.codegen import kernels
from cinegen.codegen.javascript import translated_functions
from cinegen.codegen.language import Language
from cinegen.codegen.program import STATUSES, Program
from cinegen.codegen.robot import set_up_robot
from cinegen.codegen.text import header
from cinegen.codegen.translation import translated
from cinegen.ik.task import FrameTask
from cinegen.joints import supporting_columns
from cinegen.loops.arrays import set_up_screws
from cinegen.model import Mechanism
from cinegen.page import solver_kernels
from cinegen.page.solver_kernels import PageMemory
from cinegen.singularities.ball_joints import balls

MOST_TASKS = 16
"""Tasks of one robot of a page."""

_ENTRIES = (
    kernels.place, kernels.close, kernels.set_q, kernels.forward, solver_kernels.take_tasks, solver_kernels.step,
    solver_kernels.find_sigma,
)  # fmt: skip
_ARRAYS = (
    "q", "trial", "locked", "goal", "node_frame", "task_node", "task_offset", "task_target", "task_dof", "task_weight",
    "record_errors", "record_stopped",
)  # fmt: skip
_NUMBERS = ("tasks", "gain", "damping_threshold", "closure", "sigma_tasks", "sigma_passive")
_FREE = ("task_rank", "tasks", "gain", "damping_threshold", "joint", "translation", "rotation", "weight")


def solver_modules(robots: Mapping[str, Mechanism], rate: float) -> dict[str, str]:
    """Return modules of JavaScript, one for each robot, whose default export makes its kernels for
    `static/session/solver.js`.

    Args:
        robots: mechanisms by name.
        rate: ticks per second.

    Raises:
        CinegenError: a robot has joints that the kernels don't know.
    """
    return {name: _module(mechanism, 1.0 / rate) for name, mechanism in robots.items()}


def _module(mechanism: Mechanism, dt: float) -> str:
    node = next((node for node in mechanism.nodes if node != mechanism.nodes[0]), mechanism.end)
    tasks = [FrameTask(node, pin.SE3.Identity(), frame=mechanism.frame_id(node)) for _ in range(MOST_TASKS)]
    memory = _memory(mechanism, tasks, dt)
    translation = translated(Language.JAVASCRIPT, memory, _ENTRIES, _ARRAYS, _FREE)
    program = Program(mechanism, memory, translation, "robot", "", (), (), dt)
    velocities = [int(i) for i in memory.q_index]
    names = {
        "q": program.numbers_of_q(), "actuated": mechanism.actuated, "nodes": mechanism.nodes, "statuses": STATUSES,
        "velocities": [-1] * memory.fixed + velocities,
    }  # fmt: skip
    views = []
    for name in (*_ARRAYS, *_NUMBERS):
        place = translation.heap.place(memory, name)
        views.append(f"    {name}: {place.table}.subarray({place.begin}, {place.begin + int(np.prod(place.shape))}),")
    lines = [
        *header(program, "Kinematics"),
        "export default function create() {",
        *translated_functions(program),
        "  D.set(HOME_D);",
        "  I.set(HOME_I);",
        "  return {",
        f"    names: {json.dumps(names)},",
        *views,
        *(f"    {kernel.__name__}: {translation.name_of(kernel)}," for kernel in _ENTRIES),
        "  };",
        "}",
    ]
    return "\n".join(lines) + "\n"


def _memory(mechanism: Mechanism, tasks: Sequence[FrameTask], dt: float) -> PageMemory:
    """Return the memory of a mechanism at home. A floating base stays where it is."""
    memory, model = PageMemory(), mechanism.model
    set_up_robot(memory, mechanism, tasks, dt)
    samples, fixed = mechanism.samples, memory.fixed
    memory.resize(capacity=MOST_TASKS, samples=len(samples))
    memory.sample[:] = samples
    three = balls(mechanism)
    memory.resize(balls=len(three))
    memory.ball_dof[:] = np.reshape([mechanism.v_index(name) - fixed for names in three for name in names], (-1, 3))
    inner = {model.getJointId(name) for names in three for name in names[:2]}
    for i in range(memory.nodes):
        memory.node_is_inner[i] = int(memory.node_joint[i]) in inner
    for joint in range(model.njoints):
        memory.joint_moved_by[joint] = supporting_columns(model, joint)[fixed:]
    rank = mechanism.passive_rank
    if rank > 0:
        set_up_screws(memory, mechanism.screws, len(mechanism.couplings))
        columns = mechanism.passive_screws - fixed
        sides = len(columns), memory.screw_rows
        memory.resize(passive=len(columns), passive_lesser=min(sides), passive_larger=max(sides))
        memory.passive_column[:] = columns
        memory.passive_rank = min(rank + mechanism.screws.cut, *sides)
    return memory
