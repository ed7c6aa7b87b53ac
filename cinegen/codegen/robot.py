"""The memory from which a mechanism's code is generated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cinegen.codegen.inverse_kernels import InverseMemory
from cinegen.codegen.kernels import RobotMemory
from cinegen.errors import CinegenError
from cinegen.ik.equations import task_rank
from cinegen.ik.joint_settings import JointSettings
from cinegen.ik.setup import set_up_solver, set_up_solver_tasks
from cinegen.ik.task import FrameTask
from cinegen.jit.foreign import frame_of
from cinegen.loops.setup import actuate, other_joints
from cinegen.model import Mechanism
from cinegen.model.forward import set_up_path
from raff2urdf.errors import counted

MOST_TASKS = 6


def robot_memory(mechanism: Mechanism, tasks: Sequence[FrameTask], dt: float) -> InverseMemory:
    """Return the memory of a mechanism at home with its tasks.

    Args:
        mechanism: any whose joints the kernels move.
        tasks: each follows a pose.
        dt: period of a tick, s.

    Raises:
        CinegenError: a joint is of a kind that the kernels don't know, or there are too many tasks.
    """
    if len(tasks) > MOST_TASKS:
        raise CinegenError(f"{counted(len(tasks), 'task')}: code can be generated for {MOST_TASKS} at most")
    memory = InverseMemory()
    set_up_robot(memory, mechanism, tasks, dt)
    memory.resize(signatures=2 ** len(tasks))
    for bits in range(1, memory.signatures):
        some = [task for i, task in enumerate(tasks) if bits >> i & 1]
        memory.ranks[bits] = task_rank(mechanism, mechanism.structure.system, some)
    return memory


def set_up_robot(memory: RobotMemory, mechanism: Mechanism, tasks: Sequence[FrameTask], dt: float) -> None:
    """Fill a memory with a mechanism at home, its tasks and nodes.

    Raises:
        CinegenError: a joint is of a kind that the kernels don't know.
    """
    model = mechanism.model
    memory.dt = dt
    if others := other_joints(model):
        named = ", ".join(f"{name} ({kind})" for name, kind in others.items())
        raise CinegenError(f"{mechanism.name} has joints that no code is generated for: {named}")
    set_up_solver(memory, mechanism)
    JointSettings(mechanism).write(memory)
    set_up_solver_tasks(memory, mechanism, tasks)
    for task in tasks:
        task.read_target()
    actuate(memory, [mechanism.v_index(name) for name in mechanism.actuated])
    memory.locked[:] = 0.0
    set_up_path(memory)
    memory.resize(nodes=len(mechanism.nodes))
    for i, node in enumerate(mechanism.nodes):
        frame = model.frames[mechanism.frame_id(node)]
        memory.node_joint[i], memory.node_offset[i] = frame.parentJoint, frame_of(frame.placement)
    memory.q[:] = memory.record_q[:] = mechanism.q_home
    memory.goal[:] = np.array([mechanism.q_home[mechanism.q_index(name)] for name in mechanism.actuated])
