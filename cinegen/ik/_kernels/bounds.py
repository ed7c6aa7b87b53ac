"""The nearest point of a polyhedron, by the dual active set method.

D. Goldfarb and A. Idnani, "A numerically stable dual method for solving strictly convex quadratic programs",
Mathematical Programming 27, 1983, with the identity metric: start at the wanted point, and add the most violated bound
until none is violated; bounds with vanishing multipliers are removed.
"""

from __future__ import annotations

import math

from cinegen.ik._kernels.memory import SolverMemory
from cinegen.jit.compiled import Array, compiled

TOUCH = 1e-12  # a step that ends this little beyond a bound ends on it
_DEPENDENT = 1e-10  # smallest remainder of a normal, as a fraction, that is independent of the active ones


@compiled
def keeps_bounds(memory: SolverMemory, step: Array, low: Array, high: Array) -> bool:
    """Return whether a step (n,) keeps all bounds (n + barriers,), those of barriers last."""
    keeps = True
    for j in range(memory.n):
        keeps = keeps and low[j] - TOUCH <= step[j] <= high[j] + TOUCH
    for b in range(memory.barriers):
        s = 0.0
        for j in range(memory.n):
            s += memory.barrier_rows[b, j] * step[j]
        keeps = keeps and low[memory.n + b] - TOUCH <= s <= high[memory.n + b] + TOUCH
    return keeps


@compiled
def reduce_barriers(memory: SolverMemory, k: int) -> None:
    """Write the rows of the barriers into `normals` (n + barriers, k), below the n rows of the joints."""
    g = memory.normals
    for b in range(memory.barriers):
        for i in range(k):
            s = 0.0
            for c in range(memory.n):
                s += memory.barrier_rows[b, c] * g[c, i]
            g[memory.n + b, i] = s


@compiled
def nearest(memory: SolverMemory, low: Array, high: Array, held: Array, k: int) -> bool:
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
    x, g, count = memory.wanted_point, memory.normals, memory.n + memory.barriers
    normals, basis, triangle = memory.active_normals[0], memory.active_normals[1], memory.active_normals[2]
    wanted, along, across, dual = memory.active[0], memory.active[1], memory.active[2], memory.active[3]
    multiplier, owner = memory.active[4], memory.active[5]
    for i in range(k):
        wanted[i] = x[i]
    for j in range(count):
        held[j] = 0.0
    active = 0
    for _ in range(20 * count + 20):
        worst, which, side = TOUCH, -1, 0.0
        for j in range(count):
            if held[j] != 0.0:
                continue
            s = 0.0
            for i in range(k):
                s += g[j, i] * x[i]
            if s - high[j] > worst:
                worst, which, side = s - high[j], j, 1.0
            elif low[j] - s > worst:
                worst, which, side = low[j] - s, j, -1.0
        if which < 0:
            _again(memory, low, high, held, active, k)
            for a in range(active):
                if multiplier[a] <= 0.0:
                    held[int(owner[a])] = 0.0
            return True
        new = 0.0  # its multiplier
        is_active = False
        for _ in range(k + 2):
            # components of the new normal along the active ones and orthogonal to them
            length = 0.0
            for i in range(k):
                across[i] = -side * g[which, i]
                length += across[i] * across[i]
            for a in range(active):
                along[a] = 0.0
            for _ in range(2):  # twice is enough
                for a in range(active):
                    dot = 0.0
                    for i in range(k):
                        dot += basis[a, i] * across[i]
                    along[a] += dot
                    for i in range(k):
                        across[i] -= dot * basis[a, i]
            left = 0.0
            for i in range(k):
                left += across[i] * across[i]
            for a in range(active - 1, -1, -1):  # the dual direction: triangle^T dual = along
                s = along[a]
                for c in range(a + 1, active):
                    s -= triangle[c, a] * dual[c]
                dual[a] = s / triangle[a, a]
            furthest, drop = math.inf, -1
            for a in range(active):
                if dual[a] > 1e-14 and multiplier[a] < furthest * dual[a]:
                    furthest, drop = multiplier[a] / dual[a], a
            whole = worst / left if left > _DEPENDENT * _DEPENDENT * length else math.inf
            if whole == math.inf and drop < 0:
                return False
            t = min(furthest, whole)
            for a in range(active):
                multiplier[a] -= t * dual[a]
            new += t
            if whole < math.inf:
                for i in range(k):
                    x[i] += t * across[i]
                worst -= t * left
            if whole <= furthest:
                size = math.sqrt(left)
                for i in range(k):
                    normals[active, i] = -side * g[which, i]
                    basis[active, i] = across[i] / size
                for a in range(active):
                    triangle[active, a] = along[a]
                triangle[active, active] = size
                multiplier[active] = new
                owner[active] = which
                held[which] = side
                active += 1
                is_active = True
                break
            held[int(owner[drop])] = 0.0
            active -= 1
            for a in range(drop, active):
                owner[a], multiplier[a] = owner[a + 1], multiplier[a + 1]
                for i in range(k):
                    normals[a, i] = normals[a + 1, i]
            _span(memory, drop, active, k)
        if not is_active:
            return False
    return False


@compiled
def _span(memory: SolverMemory, first: int, count: int, k: int) -> None:
    """Compute the basis again, from normal `first` on, by Gram-Schmidt, twice."""
    normals, basis, triangle = memory.active_normals[0], memory.active_normals[1], memory.active_normals[2]
    for a in range(first, count):
        for i in range(k):
            basis[a, i] = normals[a, i]
        for c in range(a):
            triangle[a, c] = 0.0
        for _ in range(2):
            for c in range(a):
                dot = 0.0
                for i in range(k):
                    dot += basis[c, i] * basis[a, i]
                triangle[a, c] += dot
                for i in range(k):
                    basis[a, i] -= dot * basis[c, i]
        size = 0.0
        for i in range(k):
            size += basis[a, i] * basis[a, i]
        size = math.sqrt(size)
        triangle[a, a] = size
        for i in range(k):
            basis[a, i] /= size


@compiled
def _again(memory: SolverMemory, low: Array, high: Array, held: Array, active: int, k: int) -> None:
    """Compute the same point again from the active bounds, exact up to rounding."""
    x, g, basis, triangle = memory.wanted_point, memory.normals, memory.active_normals[1], memory.active_normals[2]
    wanted, weights, owner = memory.active[0], memory.active[1], memory.active[5]
    if active == 0:
        return
    for i in range(k):
        x[i] = wanted[i]
    for a in range(active):
        j = int(owner[a])
        s = 0.0
        for i in range(k):
            s += g[j, i] * wanted[i]
        left = held[j] * (s - high[j] if held[j] > 0.0 else s - low[j])  # along the normal, inwards
        for c in range(a):
            left -= triangle[a, c] * weights[c]
        weights[a] = left / triangle[a, a]
    for a in range(active):
        for i in range(k):
            x[i] += weights[a] * basis[a, i]
