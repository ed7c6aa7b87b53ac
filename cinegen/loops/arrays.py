"""The memory that kernels work on, set up for a mechanism's loops."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cinegen.joints import scalar_joints, supporting_columns
from cinegen.loops._kernels import loops as kinds
from cinegen.loops._kernels import memory as m
from cinegen.loops._kernels.memory import Memory
from cinegen.loops.closed_loops import ClosedLoops
from raff2urdf.document import LoopKind

Array = NDArray[np.float64]

_KINDS = {
    LoopKind.RIGID: kinds.RIGID,
    LoopKind.PRISMATIC: kinds.PRISMATIC,
    LoopKind.REVOLUTE: kinds.REVOLUTE,
    LoopKind.BALL: kinds.BALL,
}


def memory_of(system: ClosedLoops, rank: int, layout: tuple[str, ...] = m.LAYOUT) -> Memory:
    """For a mechanism's loops, and Pinocchio's data in `system`.

    Args:
        system: the loops.
        rank: of their Jacobian, generic.
        layout: of the table: more than loops need, if others fill it.
    """
    model, data, rows = system.model, system.data, system.rows
    nv = model.nv
    memory = Memory(layout, nq=model.nq, nv=nv, n=nv, loops=len(system.loops), rows=rows, rank=rank)
    for name in ("q", "trial", "before"):
        memory.put(name, np.zeros(model.nq))
    for name in ("delta", "step", "held", "way"):
        memory.put(name, np.zeros(nv))
    memory.put("bends", np.zeros((3, nv)))
    memory.put("f", np.zeros((max(rows, nv), nv)))
    memory.put("h", np.zeros((nv, nv)))
    for name in ("order", "left", "tau"):
        memory.put(name, np.zeros(max(rows, nv)))
    for name in ("jc", "jc_before"):
        memory.put(name, np.zeros((rows, nv)))
    memory.put("c", np.zeros(rows))
    for name in ("loop_u", "sides"):
        memory.put(name, np.zeros((rows, rows)))
    memory.put("loop_b", np.zeros((rows, nv)))
    memory.put("loop_square", np.zeros(rows))
    memory.put("w", np.zeros((16, 3)))
    memory.put("scale", system.scale)
    memory.put("settings", np.zeros(m.SETTINGS_WIDTH))[m.LENGTH] = system.length
    at_q, at_v = scalar_joints(model)
    at = memory.put("at", np.full(nv, -1.0))
    at[at_v] = at_q
    _put_loops(memory, system)
    if nv:
        memory.point("columns", m.address(data.J))
    memory.point("placements", m.placements_address(data))
    return memory


def put_motors(memory: Memory, columns: Sequence[int], places: Sequence[int]) -> Array:
    """Names the joints that are led, by where they stand in v and in q; returns their `goal`, to be filled in."""
    memory.table[m.MOTORS] = len(columns)
    memory.put("motor_columns", np.array(columns, dtype=float))
    memory.put("motor_places", np.array(places, dtype=float))
    memory.put("way_before", np.zeros(len(columns)))
    memory.arrays["held"][[column - int(memory.table[m.OFFSET]) for column in columns]] = 1.0
    return memory.put("goal", np.zeros(len(columns)))


def _put_loops(memory: Memory, system: ClosedLoops) -> None:
    model, loops = system.model, system.loops
    table = np.zeros((max(len(loops), 1), m.LOOP_WIDTH))
    signs = np.zeros((max(len(loops), 1), model.nv))
    row = 0
    for i, (loop, (first, at_first, second, at_second)) in enumerate(zip(loops, system.anchors, strict=True)):
        table[i, : m.FIRST_LOCAL] = (_KINDS[loop.kind], first, second, row, loop.rows)
        table[i, m.FIRST_LOCAL : m.FIRST_LOCAL + 12] = m.columns_of(at_first)
        table[i, m.SECOND_LOCAL : m.SECOND_LOCAL + 12] = m.columns_of(at_second)
        signs[i] = supporting_columns(model, second) - supporting_columns(model, first)
        row += loop.rows
    memory.put("loop_table", table)
    memory.put("signs", signs)
