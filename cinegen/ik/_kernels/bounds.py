"""The nearest point of a polyhedron, by the dual active set method.

D. Goldfarb and A. Idnani, "A numerically stable dual method for solving strictly convex quadratic programs",
Mathematical Programming 27, 1983, for the metric 1: begin at the wanted point, and take in the bound that is violated
most until none is; a bound that no longer holds anything is let go on the way.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, compiled

TOUCH = 1e-12  # a step that ends this little beyond a bound ends on it
_DEPENDENT = 1e-10  # part of a normal that must be left for it to be independent of those that hold already


@compiled
def nearest(
    x: Array,
    g: Array,
    low: Array,
    high: Array,
    n: int,
    k: int,
    held: Array,
    normals: Array,
    basis: Array,
    triangle: Array,
    scratch: Array,
) -> bool:
    """Moves x (k,) to the nearest point with low <= g x <= high.

    Args:
        x: the wanted point; becomes the nearest.
        g: (n, k).
        low: (n,).
        high: (n,).
        n: bounds.
        k: dimensions.
        held: (n,) becomes -1 or 1 where the lower or the upper bound holds x back, else 0.
        normals: (k, k) scratch: rows are the normals of the bounds that hold.
        basis: (k, k) scratch: rows are orthonormal, and span the normals.
        triangle: (k, k) scratch: normal i is the sum over j of triangle[i, j] basis[j].
        scratch: (6, k) scratch.

    Returns:
        whether it was found: bounds may contradict each other.
    """
    wanted, along, across, dual, multiplier, owner = (
        scratch[0],
        scratch[1],
        scratch[2],
        scratch[3],
        scratch[4],
        scratch[5],
    )
    for i in range(k):
        wanted[i] = x[i]
    for j in range(n):
        held[j] = 0.0
    active = 0
    for _ in range(20 * n + 20):
        worst, which, side = TOUCH, -1, 0.0
        for j in range(n):
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
            _again(x, wanted, g, low, high, k, held, active, owner, basis, triangle, along)
            for a in range(active):
                if multiplier[a] <= 0.0:
                    held[int(owner[a])] = 0.0
            return True
        new = 0.0  # its multiplier
        settled = False
        for _ in range(k + 2):
            # the new normal: what of it lies along those that hold, and what across
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
            rest = 0.0
            for i in range(k):
                rest += across[i] * across[i]
            for a in range(active - 1, -1, -1):  # the dual direction: triangle^T dual = along
                s = along[a]
                for c in range(a + 1, active):
                    s -= triangle[c, a] * dual[c]
                dual[a] = s / triangle[a, a]
            furthest, drop = math.inf, -1
            for a in range(active):
                if dual[a] > 1e-14 and multiplier[a] < furthest * dual[a]:
                    furthest, drop = multiplier[a] / dual[a], a
            whole = worst / rest if rest > _DEPENDENT * _DEPENDENT * length else math.inf
            if whole == math.inf and drop < 0:
                return False
            t = min(furthest, whole)
            for a in range(active):
                multiplier[a] -= t * dual[a]
            new += t
            if whole < math.inf:
                for i in range(k):
                    x[i] += t * across[i]
                worst -= t * rest
            if whole <= furthest:
                size = math.sqrt(rest)
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
                settled = True
                break
            held[int(owner[drop])] = 0.0
            active -= 1
            for a in range(drop, active):
                owner[a], multiplier[a] = owner[a + 1], multiplier[a + 1]
                for i in range(k):
                    normals[a, i] = normals[a + 1, i]
            _span(normals, basis, triangle, drop, active, k)
        if not settled:
            return False
    return False


@compiled
def _span(normals: Array, basis: Array, triangle: Array, first: int, count: int, k: int) -> None:
    """The basis again, from normal `first` on: Gram and Schmidt, twice."""
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
def _again(
    x: Array,
    wanted: Array,
    g: Array,
    low: Array,
    high: Array,
    k: int,
    held: Array,
    active: int,
    owner: Array,
    basis: Array,
    triangle: Array,
    weights: Array,
) -> None:
    """The same point once more, from the bounds that hold it: to rounding."""
    if active == 0:
        return
    for i in range(k):
        x[i] = wanted[i]
    for a in range(active):
        j = int(owner[a])
        s = 0.0
        for i in range(k):
            s += g[j, i] * wanted[i]
        rest = held[j] * (s - high[j] if held[j] > 0.0 else s - low[j])  # along the normal, inwards
        for c in range(a):
            rest -= triangle[a, c] * weights[c]
        weights[a] = rest / triangle[a, a]
    for a in range(active):
        for i in range(k):
            x[i] += weights[a] * basis[a, i]
