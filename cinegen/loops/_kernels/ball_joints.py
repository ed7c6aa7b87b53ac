"""Three revolute joints that model a ball joint counted as one; plain form: `cinegen.singularities.ball_joints`."""

from __future__ import annotations

from cinegen.jit.compiled import Array, compiled
from cinegen.jit.se3 import cross, dot
from cinegen.loops._kernels.memory import LoopMemory

_GIMBAL = 1e-4  # below this volume, the axes of a ball joint are in a plane


@compiled
def count_balls(memory: LoopMemory, rows: Array) -> bool:
    """Replace the columns of three revolute joints that model a ball joint, in the loops' matrices and in further rows
    (., n), by those of rotations about the world's axes.

    The axes u, v, w (3,) pass through one point, so that the columns are linear in them: [c1 c2 c3] = C (u v w). The
    new columns are C = [c1 c2 c3] (u v w)^-1, with the rows v x w, w x u and u x v of the inverse, divided by the
    volume u . (v x w). Columns stay what they are, and False is returned, if the axes of a ball joint are in a plane.
    """
    is_regular, inverse = True, memory.vectors
    for b in range(memory.balls):
        first, second, third = memory.ball_dof[b, 0], memory.ball_dof[b, 1], memory.ball_dof[b, 2]
        u, v, w = memory.screws[first, 3:], memory.screws[second, 3:], memory.screws[third, 3:]
        cross(v, w, inverse[0])
        cross(w, u, inverse[1])
        cross(u, v, inverse[2])
        volume = dot(u, inverse[0])
        if abs(volume) < _GIMBAL:
            is_regular = False
            continue
        _turn_columns(memory.jacobian, first, second, third, inverse, volume)
        _turn_columns(memory.screw_matrix, first, second, third, inverse, volume)
        _turn_columns(rows, first, second, third, inverse, volume)
        rates = memory.cut_rates
        for i in range(memory.cut):
            c0, c1, c2 = rates[first, i] / volume, rates[second, i] / volume, rates[third, i] / volume
            rates[first, i] = c0 * inverse[0, 0] + c1 * inverse[1, 0] + c2 * inverse[2, 0]
            rates[second, i] = c0 * inverse[0, 1] + c1 * inverse[1, 1] + c2 * inverse[2, 1]
            rates[third, i] = c0 * inverse[0, 2] + c1 * inverse[1, 2] + c2 * inverse[2, 2]
    return is_regular


@compiled
def _turn_columns(a: Array, first: int, second: int, third: int, inverse: Array, volume: float) -> None:
    """Replace three columns of a by their products with `inverse` / `volume`."""
    for i in range(a.shape[0]):
        c0, c1, c2 = a[i, first] / volume, a[i, second] / volume, a[i, third] / volume
        a[i, first] = c0 * inverse[0, 0] + c1 * inverse[1, 0] + c2 * inverse[2, 0]
        a[i, second] = c0 * inverse[0, 1] + c1 * inverse[1, 1] + c2 * inverse[2, 1]
        a[i, third] = c0 * inverse[0, 2] + c1 * inverse[1, 2] + c2 * inverse[2, 2]
