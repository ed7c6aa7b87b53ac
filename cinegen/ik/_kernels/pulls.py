"""Rows of pulls, from placements and Jacobian columns that Pinocchio computed (see `cinegen.loops._kernels.loops`)."""

from __future__ import annotations

from cinegen.jit import rotation
from cinegen.jit.compiled import Array, compiled

FURTHEST = 1e100  # m: a target beyond is aimed at from here all the same, and no square overflows


@compiled
def pull_error(
    r: Array, p: Array, target: Array, axes: Array, translation: int, angular: int, length: float, e: Array, w: Array
) -> None:
    """What a pull has left to do, without unit, as `Pull.errors`.

    Args:
        r: (3, 3) and
        p: (3,) where the node is.
        target: (12,) where it should be.
        axes: (3, 3) in the world: whose axes the pull holds.
        translation: how many translations it holds, 0 to 3.
        angular: how many rotations.
        length: characteristic length, m.
        e: becomes the error, translations first.
        w: (16, 3) scratch; rows 6 to 9 become the node's axes seen from the target's, rows 12 and on are used.
    """
    x = min(max(target[9], -FURTHEST), FURTHEST) - p[0]
    y = min(max(target[10], -FURTHEST), FURTHEST) - p[1]
    z = min(max(target[11], -FURTHEST), FURTHEST) - p[2]
    for i in range(translation):
        e[i] = (axes[0, i] * x + axes[1, i] * y + axes[2, i] * z) / length
    if angular == 0:
        return
    turned, held, seen = w[0:3], w[3:6], w[6:9]
    # what would have the axes' directions if the node were at its target: r target^T axes
    for i in range(3):
        for j in range(3):
            held[i, j] = target[3 * i] * axes[0, j] + target[3 * i + 1] * axes[1, j] + target[3 * i + 2] * axes[2, j]
    rotation.times(r, held, turned)
    rotation.transposed_times(axes, turned, seen)
    if angular == 2:
        rotation.swing(seen[0, 2], seen[1, 2], seen[2, 2], w[12], w[9:12])
        e[translation], e[translation + 1] = -w[12, 0], -w[12, 1]
        return
    for i in range(3):  # transposed
        for j in range(3):
            held[i, j] = seen[j, i]
    rotation.log(held, w[12])
    for i in range(angular):
        e[translation + i] = w[12, 3 - angular + i]


@compiled
def pull_rows(
    p: Array,
    axes: Array,
    translation: int,
    angular: int,
    length: float,
    weight: float,
    columns: Array,
    moves: Array,
    scale: Array,
    n: int,
    rows: Array,
    w: Array,
) -> None:
    """How the joints take a pull's error away, as `Pull.equations`; right after `pull_error`, with its scratch.

    Args:
        p: (3,) where the node is.
        axes: (3, 3).
        translation: how many translations the pull holds.
        angular: how many rotations.
        length: characteristic length, m.
        weight: of all rows.
        columns: (n, 6) Jacobian columns.
        moves: (n,) 1 for a joint that moves the node, else 0.
        scale: (n,) what one step without unit is, m or rad.
        n: columns.
        rows: (., n) become the rows.
        w: (16, 3) the scratch of `pull_error`.
    """
    turned, seen, by, turn, g = w[0:3], w[6:9], w[9:12], w[12], w[3:6]
    if angular == 3:  # the derivative of log times log itself is log: the node's own angular velocity will do
        for i in range(3):
            for j in range(3):
                g[i, j] = turned[j, i]
    elif angular == 2:
        rotation.times(by, seen, g)
        for i in range(2):
            for j in range(3):
                w[13, j] = g[i, 0] * turned[j, 0] + g[i, 1] * turned[j, 1] + g[i, 2] * turned[j, 2]
            for j in range(3):
                g[i, j] = w[13, j]
    elif angular == 1:
        rotation.log_derivative(turn, by)
        for j in range(3):
            g[0, j] = by[2, 0] * turned[j, 0] + by[2, 1] * turned[j, 1] + by[2, 2] * turned[j, 2]
    for k in range(n):
        if moves[k] == 0.0:
            for i in range(translation + angular):
                rows[i, k] = 0.0
            continue
        s = weight * scale[k]
        a, b, d = columns[k, 3], columns[k, 4], columns[k, 5]
        if translation > 0:
            vx = columns[k, 0] + b * p[2] - d * p[1]
            vy = columns[k, 1] + d * p[0] - a * p[2]
            vz = columns[k, 2] + a * p[1] - b * p[0]
            for i in range(translation):
                rows[i, k] = s / length * (axes[0, i] * vx + axes[1, i] * vy + axes[2, i] * vz)
        for i in range(angular):
            rows[translation + i, k] = s * (g[i, 0] * a + g[i, 1] * b + g[i, 2] * d)
