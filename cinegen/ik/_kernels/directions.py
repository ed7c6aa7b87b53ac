"""In which directions the pulls can be followed, and how well: singular values of their rows on the free motions."""

from __future__ import annotations

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.resolve import pull_along, scaled_axes
from cinegen.jit.compiled import Table, compiled, matrix, vector
from cinegen.jit.svd import straighten


@compiled
def promise(t: Table) -> None:
    """What the part of the step that is tried should win, to first order."""
    n, p = t[m.N], t[m.P]
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    jp, e, taken = matrix(t[m.JP], p, n), vector(t[m.E], p), vector(t[m.TAKEN], n)
    gained = 0.0
    for i in range(p):
        s = 0.0
        for c in range(n):
            s += jp[i, c] * taken[c]
        gained += e[i] * s
    settings[m.GAINED] = gained / settings[m.GAIN]


@compiled
def singular_values(t: Table) -> None:
    """Of the pulls on the free motions."""
    n, p, k = t[m.N], t[m.P], t[m.K]
    lesser, larger = min(p, k), max(p, k)
    u, b = matrix(t[m.U], lesser, lesser), matrix(t[m.B], lesser, larger)
    warm = t[m.WARM] != 0
    if warm and t[m.TICKS] % 32 == 0:
        straighten(u, lesser)
    motions, a = matrix(t[m.MOTIONS], k, n), matrix(t[m.A], lesser, larger)
    square = vector(t[m.SQUARE], lesser)
    t[m.SWEEPS] = pull_along(matrix(t[m.JP], p, n), p, motions, k, n, t[m.RANK] > 0, warm, a, u, b, square)
    t[m.WARM] = 1


@compiled
def all_axes(t: Table, pull_rank: int) -> int:
    """All free motions by how much the pulls ask for them, in `axes` and `size`; the first that none asks for."""
    p, k = t[m.P], t[m.K]
    if t[m.QUICK] != 0:
        singular_values(t)
        t[m.QUICK] = 0
    lesser, larger = min(p, k), max(p, k)
    return scaled_axes(
        vector(t[m.E], p),
        p,
        k,
        pull_rank,
        matrix(t[m.U], lesser, lesser),
        matrix(t[m.B], lesser, larger),
        vector(t[m.SQUARE], lesser),
        matrix(t[m.AXES], k, k),
        vector(t[m.SIZE], k),
        matrix(t[m.WORK], k, k),  # the factors of the loops are needed later
        vector(t[m.SCRATCH], k),
        vector(t[m.SCRATCH] + 8 * k, k),
        vector(t[m.SCRATCH] + 16 * k, k),
        matrix(t[m.WORK] + 8 * k * k, k, k),
        vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.NEAR],
    )
