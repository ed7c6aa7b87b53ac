"""Memories of the kernels of inverse dynamics."""

from __future__ import annotations

from typing import Any

import numpy as np

from cinegen.dynamics import plain
from cinegen.dynamics._kernels.memory import DynamicsMemory
from cinegen.dynamics.loads import LoadedTree
from cinegen.jit.foreign import frame_of
from cinegen.loops.setup import set_up


def memory_of(tree: LoadedTree) -> DynamicsMemory:
    """Return the kernel's memory."""
    mechanism = tree.mechanism
    fixed = plain.columns_of(mechanism).start
    memory = set_up(DynamicsMemory(count=1), mechanism.structure.system, mechanism.cluster_ranks, fixed)
    columns = plain.actuated_columns(mechanism)
    memory.resize(actuated=len(columns), mobility=memory.n - memory.rank)
    memory.actuated_dof[:], memory.step[:] = np.array(columns, dtype=int) - fixed, tree.step[columns]
    load(memory, tree)
    return memory


def load(memory: DynamicsMemory, tree: LoadedTree) -> None:
    """Write the bodies, gravity and wrenches of a tree into a kernel's memory."""
    model = tree.model
    memory.resize(loads=len(tree.loads))
    for j in range(1, model.njoints):
        body: Any = model.inertias[j]
        memory.mass[j], memory.centre[j], memory.inertia[j] = body.mass, body.lever, body.inertia
    memory.gravity[:] = tree.gravity
    moving = plain.columns_of(tree.mechanism)
    memory.armature[:], memory.damping[:] = model.armature[moving], model.damping[moving]
    memory.friction[:] = model.upperDryFrictionLimit[moving]
    for i, (payload, joint, placement) in enumerate(tree.loads):
        memory.load_joint[i], memory.load_offset[i] = joint, frame_of(placement)
        memory.load_turns[i], memory.load[i] = payload.axes == "node", payload.wrench
