"""`cinegen.ik.resolve`, compiled: the step that does most for the pulls, loops closed and bounds kept."""

from __future__ import annotations

import math

from cinegen.ik._kernels.bounds import TOUCH, nearest
from cinegen.ik.thresholds import RESTING
from cinegen.jit.compiled import Array, compiled
from cinegen.jit.null_space import factor, free_motions
from cinegen.jit.svd import decompose

_LOST = 1e-12  # a singular value below this part of the largest says nothing of its direction


@compiled
def damping(square: float, error: float, near: float) -> float:
    """What is added to a squared singular value, as `cinegen.ik.damping.damping`."""
    ratio = square / (near * near)
    return (1.0 - ratio) * (1.0 - ratio) * (0.25 * near * near + error) if ratio < 1.0 else 0.0


@compiled
def pull_along(
    jp: Array,
    p: int,
    motions: Array,
    k: int,
    n: int,
    looped: bool,
    warm: bool,
    a: Array,
    u: Array,
    b: Array,
    square: Array,
) -> int:
    """Singular values of the pulls' rows jp (p, n) on the free motions (k, n): their squares, largest first.

    Where there are no more rows than motions, rows are made orthogonal: b_i = s_i w_i, u_i. Else columns are: b_i =
    s_i u_i, and u holds the w_i.

    Returns:
        sweeps that were needed.
    """
    if p <= k:
        for i in range(p):
            for j in range(k):
                if looped:
                    s = 0.0
                    for c in range(n):
                        s += jp[i, c] * motions[j, c]
                    a[i, j] = s
                else:
                    a[i, j] = jp[i, j]
        return decompose(a, p, k, u, b, square, warm)
    for j in range(k):
        for i in range(p):
            s = 0.0
            if looped:
                for c in range(n):
                    s += jp[i, c] * motions[j, c]
            else:
                s = jp[i, j]
            a[j, i] = s
    return decompose(a, k, p, u, b, square, warm)


@compiled
def far_from_singular(
    jp: Array,
    p: int,
    motions: Array,
    k: int,
    n: int,
    looped: bool,
    e: Array,
    a: Array,
    triangle: Array,
    y: Array,
    near: float,
) -> bool:
    """The same y as `unbounded` where no singular value is below `near`, at a third of the cost; else False.

    Rows of A are made orthonormal, A = T Q with T triangular (Gram and Schmidt); the smallest singular value is at
    least 1 / |T^-1|, in Frobenius's norm.

    Args:
        a: (p, k) becomes Q.
        triangle: (2, p, p) becomes T and its inverse.
        y: (k,) result.
    """
    for i in range(p):
        for j in range(k):
            if looped:
                s = 0.0
                for c in range(n):
                    s += jp[i, c] * motions[j, c]
                a[i, j] = s
            else:
                a[i, j] = jp[i, j]
    inverse = 0.0
    for i in range(p):
        # the row's part along the rows before, and that row of the inverse
        for c in range(i):
            dot = 0.0
            for j in range(k):
                dot += a[c, j] * a[i, j]
            triangle[0, i, c] = dot
            for j in range(k):
                a[i, j] -= dot * a[c, j]
        s = 0.0
        for j in range(k):
            s += a[i, j] * a[i, j]
        if not s > near * near:
            return False
        s = 1.0 / math.sqrt(s)
        for j in range(k):
            a[i, j] *= s
        triangle[1, i, i] = s
        inverse += s * s
        for c in range(i):
            dot = 0.0
            for j in range(c, i):
                dot += triangle[0, i, j] * triangle[1, j, c]
            dot *= -s
            triangle[1, i, c] = dot
            inverse += dot * dot
    if inverse * near * near > 1.0:
        return False
    for j in range(k):
        y[j] = 0.0
    for i in range(p):
        weight = 0.0
        for c in range(i + 1):
            weight += triangle[1, i, c] * e[c]
        for j in range(k):
            y[j] += weight * a[i, j]
    return True


@compiled
def unbounded(
    e: Array, p: int, k: int, pull_rank: int, u: Array, b: Array, square: Array, y: Array, near: float
) -> None:
    """What the free motions should do, bounds apart: y (k,), the least of |A y - e|^2 + damping."""
    error = 0.0
    for i in range(p):
        error += e[i] * e[i]
    error = math.sqrt(error)
    rows = p <= k
    count = p if rows else k
    for j in range(k):
        y[j] = 0.0
    for i in range(count):
        asked = 0.0
        for j in range(p):
            asked += (u[i, j] if rows else b[i, j]) * e[j]
        h = square[i] + damping(square[i], error, near) if i < pull_rank else RESTING
        weight = asked / h  # of s_i w_i where rows, of w_i else
        for j in range(k):
            y[j] += weight * (b[i, j] if rows else u[i, j])


@compiled
def scaled_axes(
    e: Array,
    p: int,
    k: int,
    pull_rank: int,
    u: Array,
    b: Array,
    square: Array,
    axes: Array,
    size: Array,
    f: Array,
    order: Array,
    left: Array,
    tau: Array,
    h: Array,
    near: float,
) -> int:
    """All right singular vectors w_i as rows of axes (k, k), and the root of s_i^2 + damping_i, `size` (k,).

    Returns:
        the first of them that no pull asks for.
    """
    error = 0.0
    for i in range(p):
        error += e[i] * e[i]
    error = math.sqrt(error)
    if p > k:
        for i in range(k):
            for j in range(k):
                axes[i, j] = u[i, j]
            size[i] = math.sqrt(square[i] + damping(square[i], error, near) if i < pull_rank else RESTING)
        return pull_rank
    known = 0
    for i in range(min(p, pull_rank)):
        if square[i] > _LOST * _LOST * square[0]:
            s = 1.0 / math.sqrt(square[i])
            for j in range(k):
                axes[i, j] = s * b[i, j]
                f[i, j] = axes[i, j]
            size[i] = math.sqrt(square[i] + damping(square[i], error, near))
            known += 1
    if known < k:
        factor(f, known, k, known, order, left, tau, h)
        free_motions(k, known, tau, h, axes[known:])
    for i in range(known, k):
        size[i] = math.sqrt(damping(0.0, error, near) if i < pull_rank else RESTING)
    return known


@compiled
def without_pulls(
    wish: Array, p: int, k: int, pull_rank: int, quick: bool, a: Array, u: Array, b: Array, square: Array
) -> None:
    """Takes from a wish (k,) what moves a pull: what is left are motions that no pull asks for."""
    rows = p <= k
    for i in range(min(pull_rank, p)):
        s, length = 0.0, 1.0
        if not quick and rows:
            if square[i] <= _LOST * _LOST * square[0]:
                continue
            length = square[i]
        for j in range(k):
            s += (a[i, j] if quick else b[i, j] if rows else u[i, j]) * wish[j]
        s /= length
        for j in range(k):
            wish[j] -= s * (a[i, j] if quick else b[i, j] if rows else u[i, j])


@compiled
def bounded(
    y: Array,
    motions: Array,
    looped: bool,
    axes: Array,
    size: Array,
    low: Array,
    high: Array,
    rows: Array,
    n: int,
    k: int,
    x: Array,
    g: Array,
    held: Array,
    work: Array,
    scratch: Array,
    step: Array,
) -> bool:
    """The step (n,) within its bounds that is nearest to y in the metric of `axes` and `size`.

    Args:
        low: (n + barriers,) bounds of the step, then of what barriers see of it.
        high: (n + barriers,)
        rows: (barriers, n).
        work: (3, k, k) scratch.
        scratch: (6, k) scratch.

    Returns:
        whether there is one: the bounds may contradict each other.
    """
    for i in range(k):
        s = 0.0
        for j in range(k):
            s += axes[i, j] * y[j]
        x[i] = s * size[i]
        for c in range(n):
            if looped:
                s = 0.0
                for j in range(k):
                    s += axes[i, j] * motions[j, c]
            else:
                s = axes[i, c]
            g[c, i] = s / size[i]
    seen_by_barriers(rows, g, n, k)
    count = n + rows.shape[0]
    if not nearest(x, g, low, high, count, k, held, work[0], work[1], work[2], scratch):
        return False
    for c in range(n):
        s = 0.0
        for i in range(k):
            s += g[c, i] * x[i]
        step[c] = s
    return True


@compiled
def seen_by_barriers(rows: Array, g: Array, n: int, k: int) -> None:
    """Below the n rows of g (n + barriers, k), what the joints do, goes what barriers (barriers, n) see of that."""
    for b in range(rows.shape[0]):
        for i in range(k):
            s = 0.0
            for c in range(n):
                s += rows[b, c] * g[c, i]
            g[n + b, i] = s


@compiled
def within(step: Array, low: Array, high: Array, rows: Array, n: int) -> bool:
    """Whether a step (n,) keeps all bounds (n + barriers,), those of barriers (barriers, n) last."""
    keeps = True
    for j in range(n):
        keeps = keeps and low[j] - TOUCH <= step[j] <= high[j] + TOUCH
    for b in range(rows.shape[0]):
        s = 0.0
        for j in range(n):
            s += rows[b, j] * step[j]
        keeps = keeps and low[n + b] - TOUCH <= s <= high[n + b] + TOUCH
    return keeps


@compiled
def to_joints(y: Array, motions: Array, k: int, n: int, looped: bool, step: Array) -> None:
    """The joint step (n,) that free motions y (k,) are."""
    for j in range(n):
        step[j] = 0.0 if looped else y[j]
    if looped:
        for i in range(k):
            for j in range(n):
                step[j] += y[i] * motions[i, j]
