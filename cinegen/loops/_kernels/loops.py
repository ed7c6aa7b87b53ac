"""Rows of a loop, from the placements and Jacobian columns that Pinocchio has computed.

A Jacobian column is the joint's motion in the world: velocity of the point at the world's origin, then angular
velocity.
"""

from __future__ import annotations

from cinegen.jit import rotation
from cinegen.jit.compiled import Array, compiled
from cinegen.jit.placement import compose

RIGID, PRISMATIC, REVOLUTE, BALL = range(4)


@compiled
def loop_equations(
    kind: int,
    first: Array,
    first_local: Array,
    second: Array,
    second_local: Array,
    length: float,
    columns: Array,
    sign: Array,
    scale: Array,
    n: int,
    wanted: bool,
    c: Array,
    rows: Array,
    w: Array,
) -> None:
    """Residual of a loop and its exact derivative, closed or open, as `raff2urdf.residual.loop_residual`; without unit.

    Args:
        kind: RIGID, PRISMATIC, REVOLUTE or BALL.
        first: (12,) placement of the joint that carries the first end.
        first_local: (12,) the first end on it.
        second: (12,) and
        second_local: (12,) likewise.
        length: characteristic length, m.
        columns: (n, 6) Jacobian columns.
        sign: (n,) 1 for a joint that moves the second end, -1 for the first, 0 for both or none.
        scale: (n,) what one step without unit is, m or rad.
        n: columns.
        wanted: whether the derivative is.
        c: becomes the residual.
        rows: (., n) becomes the derivative.
        w: (16, 3) scratch.
    """
    r1, r2, r, by, turn = w[0:3], w[3:6], w[6:9], w[9:12], w[12]
    p1, p2 = w[13], w[14]
    compose(first, first_local, r1, p1)
    compose(second, second_local, r2, p2)
    rotation.transposed_times(r1, r2, r)
    x, y, z = p2[0] - p1[0], p2[1] - p1[1], p2[2] - p1[2]
    linear = 2 if kind == PRISMATIC else 3
    for i in range(linear):
        c[i] = (r1[0, i] * x + r1[1, i] * y + r1[2, i] * z) / length
    angular = 0
    if kind == REVOLUTE:
        angular = 2
        rotation.swing(r[0, 2], r[1, 2], r[2, 2], turn, by)
    elif kind != BALL:
        angular = 3
        rotation.log(r, turn)
        rotation.log_derivative(turn, by)
    for i in range(angular):
        c[linear + i] = turn[i]
    if not wanted:
        return
    rotation.times_transposed(by, r1, r, angular)
    for k in range(n):
        if sign[k] == 0.0:
            for i in range(linear + angular):
                rows[i, k] = 0.0
            continue
        s = sign[k] * scale[k]
        a, b, d = columns[k, 3], columns[k, 4], columns[k, 5]
        vx = columns[k, 0] + b * p2[2] - d * p2[1]  # at the second end's origin
        vy = columns[k, 1] + d * p2[0] - a * p2[2]
        vz = columns[k, 2] + a * p2[1] - b * p2[0]
        for i in range(linear):
            rows[i, k] = s / length * (r1[0, i] * vx + r1[1, i] * vy + r1[2, i] * vz)
        for i in range(angular):
            rows[linear + i, k] = s * (r[i, 0] * a + r[i, 1] * b + r[i, 2] * d)
