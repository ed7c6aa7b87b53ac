"""The nearest point of a polyhedron, by the dual active set method.

D. Goldfarb and A. Idnani, "A numerically stable dual method for solving strictly convex quadratic programs",
Mathematical Programming 27, 1983, with the identity metric: start at the wanted point, and add the most violated bound
until none is violated; bounds with vanishing multipliers are removed.
"""

from __future__ import annotations

import math

from cinegen.ik._kernels.memory import BoundsMemory, StepMemory
from cinegen.jit.compiled import Array, compiled
from cinegen.jit.vectors import add_multiple, copy, inner

TOUCH = 1e-12  # a step that ends this little beyond a bound ends on it
_DEPENDENT = 1e-10  # smallest remainder of a normal, as a fraction, that is independent of the active ones


@compiled
def keeps_bounds(memory: BoundsMemory, step: Array, low: Array, high: Array) -> bool:
    """Return whether a step (n,) keeps all bounds (n + barriers,), those of barriers last."""
    keeps = True
    for j in range(memory.n):
        keeps = keeps and low[j] - TOUCH <= step[j] <= high[j] + TOUCH
    for b in range(memory.barriers):
        s = inner(memory.barrier_rows[b], step, memory.n)
        keeps = keeps and low[memory.n + b] - TOUCH <= s <= high[memory.n + b] + TOUCH
    return keeps


@compiled
def reduce_barriers(memory: BoundsMemory, k: int) -> None:
    """Write the rows of the barriers into `normals` (n + barriers, k), below the n rows of the joints."""
    g = memory.normals
    for b in range(memory.barriers):
        for i in range(k):
            s = 0.0
            for c in range(memory.n):
                s += memory.barrier_rows[b, c] * g[c, i]
            g[memory.n + b, i] = s


@compiled
def nearest(memory: BoundsMemory, low: Array, high: Array, held: Array, k: int) -> bool:
    """Move `wanted_point` (k,) to the nearest point x with low <= normals x <= high.

    Args:
        memory: `active_normals` become the normals of the active bounds, an orthonormal basis of them, and the
            triangle of their coefficients in it.
        low: (bounds,).
        high: (bounds,).
        held: (bounds,) becomes -1 or 1 where the lower or the upper bound is active, else 0.
        k: dimensions.

    Returns:
        whether it was found: bounds may contradict each other.
    """
    count, multiplier, owner = memory.n + memory.barriers, memory.active[2], memory.active[3]
    copy(memory.wanted_point, memory.active[0], k)
    held[:count] = 0.0
    active = 0
    for _ in range(20 * count + 20):
        which, side, excess = _most_violated(memory, low, high, held, k)
        if which < 0:
            _again(memory, low, high, held, active, k)
            for a in range(active):
                if multiplier[a] <= 0.0:
                    held[int(owner[a])] = 0.0
            return True
        active = _activate(memory, held, which, side, excess, active, k)
        if active < 0:
            return False
    return False


@compiled
def _most_violated(memory: BoundsMemory, low: Array, high: Array, held: Array, k: int) -> tuple[int, float, float]:
    """Return the bound that `wanted_point` violates most, -1 if it keeps all; 1 for the upper one, -1 for the lower
    one; and by how much."""
    x, g, worst, which, side = memory.wanted_point, memory.normals, TOUCH, -1, 0.0
    for j in range(memory.n + memory.barriers):
        if held[j] != 0.0:
            continue
        s = inner(g[j], x, k)
        if s - high[j] > worst:
            worst, which, side = s - high[j], j, 1.0
        elif low[j] - s > worst:
            worst, which, side = low[j] - s, j, -1.0
    return which, side, worst


@compiled
def _activate(memory: BoundsMemory, held: Array, which: int, side: float, excess: float, active: int, k: int) -> int:
    """Move `wanted_point` until a bound is no longer violated, and make it active: step 2 of the method. A step ends
    where the bound is reached, or the multiplier of an active one vanishes, which is removed then.

    Returns:
        number of active bounds; -1 if the bounds contradict each other.
    """
    normals, basis = memory.active_normals[0], memory.active_normals[1]
    dual, multiplier, owner = memory.active[1], memory.active[2], memory.active[3]
    new = 0.0  # its multiplier
    for _ in range(k + 2):
        for i in range(k):
            normals[active, i] = -side * memory.normals[which, i]
        left = _orthogonalise(memory, active, k)
        _find_dual(memory, active)
        furthest, drop = _longest_dual_step(memory, active)
        length = inner(normals[active], normals[active], k)
        whole = excess / left if left > _DEPENDENT * _DEPENDENT * length else math.inf
        if whole == math.inf and drop < 0:
            return -1
        t = min(furthest, whole)
        add_multiple(-t, dual, multiplier, active)
        new += t
        if whole < math.inf:
            add_multiple(t, basis[active], memory.wanted_point, k)
            excess -= t * left
        if whole <= furthest:
            _normalise(memory, active, left, k)
            multiplier[active], owner[active], held[which] = new, which, side
            return active + 1
        held[int(owner[drop])] = 0.0
        active -= 1
        _remove(memory, drop, active, k)
    return -1


@compiled
def _find_dual(memory: StepMemory, active: int) -> None:
    """Solve T^T r = t for the dual direction r: T is the triangle, t its new row."""
    triangle, dual = memory.active_normals[2], memory.active[1]
    for a in range(active - 1, -1, -1):
        s = triangle[active, a]
        for c in range(a + 1, active):
            s -= triangle[c, a] * dual[c]
        dual[a] = s / triangle[a, a]


@compiled
def _longest_dual_step(memory: StepMemory, active: int) -> tuple[float, int]:
    """Return the step along the dual direction at which the first multiplier vanishes, and which: infinite and -1 if
    none does."""
    dual, multiplier, furthest, drop = memory.active[1], memory.active[2], math.inf, -1
    for a in range(active):
        if dual[a] > 1e-14 and multiplier[a] < furthest * dual[a]:
            furthest, drop = multiplier[a] / dual[a], a
    return furthest, drop


@compiled
def _remove(memory: StepMemory, drop: int, active: int, k: int) -> None:
    """Remove an active bound, of which `active` are left: orthogonalise the normals behind it again."""
    normals, multiplier, owner = memory.active_normals[0], memory.active[2], memory.active[3]
    for a in range(drop, active):
        owner[a], multiplier[a] = owner[a + 1], multiplier[a + 1]
        copy(normals[a + 1], normals[a], k)
        _normalise(memory, a, _orthogonalise(memory, a, k), k)


@compiled
def _orthogonalise(memory: StepMemory, a: int, k: int) -> float:
    """Make basis vector a the part of normal a that is orthogonal to the basis before it, by Gram-Schmidt, twice.

    Its coefficients in that basis become row a of the triangle. Return the squared length of the part.
    """
    basis, triangle = memory.active_normals[1], memory.active_normals[2]
    copy(memory.active_normals[0, a], basis[a], k)
    triangle[a, :a] = 0.0
    for _ in range(2):
        for c in range(a):
            s = inner(basis[c], basis[a], k)
            triangle[a, c] += s
            add_multiple(-s, basis[c], basis[a], k)
    return float(inner(basis[a], basis[a], k))


@compiled
def _normalise(memory: StepMemory, a: int, square: float, k: int) -> None:
    """Give basis vector a, of a squared length, length 1; the length becomes the triangle's diagonal element."""
    size = math.sqrt(square)
    memory.active_normals[2, a, a] = size
    for i in range(k):
        memory.active_normals[1, a, i] /= size


@compiled
def _again(memory: BoundsMemory, low: Array, high: Array, held: Array, active: int, k: int) -> None:
    """Compute the same point again from the active bounds, exact up to rounding."""
    x, g, basis, triangle = memory.wanted_point, memory.normals, memory.active_normals[1], memory.active_normals[2]
    wanted, weights, owner = memory.active[0], memory.active[1], memory.active[3]
    if active == 0:
        return
    copy(wanted, x, k)
    for a in range(active):
        j = int(owner[a])
        s = inner(g[j], wanted, k)
        left = held[j] * (s - high[j] if held[j] > 0.0 else s - low[j]) - inner(triangle[a], weights, a)
        weights[a] = left / triangle[a, a]
    for a in range(active):
        add_multiple(weights[a], basis[a], x, k)
