"""From p34, an eigenvalue, to all three angles: every solution of the three distances, complex ones too."""

from __future__ import annotations

import cmath
from typing import Any

from cinegen.assembly.triangle._kernels.circles import C1, C2, CC, CS, ONE, S1, S2, SC, SS
from cinegen.assembly.triangle._kernels.newton import MOVED, REGULAR, cosine_sine, evaluate, settle, size, twin
from cinegen.jit.compiled import Array, Table, compiled

REAL, COMPLEX, INFINITE, AGAIN, LOST = range(5)
"""What an eigenvalue leads to: AGAIN is a solution that is known from another one, a multiple root."""

_FAR = 1e6  # |w| or 1 / |w| from which on a solution is taken to be at infinity
_LEAVING = 30.0  # ... or from which on, if Newton's method finds nothing there: infinity is a multiple root
_SAME = 3e-7  # relative difference of solutions that rounding can't tell apart: the square root of a residual
_NEAR = 0.1  # relative distance of an eigenvalue from the solution it belongs to, at most
_NEARER = 1e-3  # ... from a solution that goes with it less well than another one
_LOOSE = 1e-3  # part of its terms that the third distance may be off before Newton's method
_NEARLY_REAL = 1e-3  # | |w| - 1 | of what may be real; of a simple root nothing but rounding is left
_HOLDS = 1e-12  # part of its terms that a distance may be off where the imaginary parts are left out


@compiled
def follow(equations: Array, w: Any, mirrored: bool, n: int, roots: Any, times: Table, choice: Any, work: Any) -> int:
    """Writes the solution with exp(i p34) = w to roots[n] (3,), if it is a new one; returns what it is.

    Args:
        equations: of the distances.
        w: exp(i p34), roughly.
        mirrored: whether the mirror image of a solution (1 / w) counts as the same.
        n: how many roots are known.
        roots: (., 3) complex, the known ones first; real ones are exactly on the unit circles.
        times: (.,) how many eigenvalues have led to each.
        choice: (5, 3) complex scratch.
        work: (6, 3) complex scratch.
    """
    if not _distance(w) < _FAR:
        return INFINITE
    again, root = -1, roots[n]
    times[n] = 1
    count = _choices(equations, w, choice)
    for i in range(2 * count):
        if i < count:
            for k in range(3):
                root[k] = choice[i, k]
        else:  # nothing is new: what was found is a multiple root, or has another one next to it
            known = int(choice[i - count, 0].real)
            if known < 0:
                continue
            for k in range(3):
                root[k] = roots[known, k]
            neighbour = twin(equations, root, work)
            if neighbour != REGULAR and again < 0:
                again = known
            if neighbour != MOVED:
                continue
        solved = settle(equations, root, work)
        far = max(_distance(root[0]), _distance(root[1]), _distance(root[2]))
        if i == 0 and (not far < _FAR or (far > _LEAVING and not solved)):
            return INFINITE
        if i < count:
            choice[i, 0] = -1.0
        if not solved or not far < _FAR or not size(root[1] - w) <= (_NEAR if i % count == 0 else _NEARER) * size(w):
            continue
        known = _find(roots, n, mirrored)
        if known < 0:
            return _judge(equations, roots, n, mirrored, times, choice, work)
        if i < count:
            choice[i, 0] = float(known)
    if again < 0:
        return LOST if _distance(w) < _LEAVING else INFINITE
    times[again] += 1
    return AGAIN


@compiled
def _distance(w: Any) -> float:
    """1 for a real angle, infinite at infinity, not a number where there is none."""
    far = float(abs(w))
    return max(far, 1.0 / far) if far == far else far


@compiled
def is_real(root: Any) -> bool:
    """Whether `follow` has put a root (3,) on the unit circles."""
    off = 0.0
    for k in range(3):
        off = max(off, abs(abs(root[k]) - 1.0))
    return off < 1e-14


@compiled
def _find(roots: Any, n: int, mirrored: bool) -> int:
    """Which of the first n roots is the same as root n, or as its mirror image; -1 if none is."""
    for i in range(n):
        same, image = True, mirrored
        for k in range(3):
            if same and not size(roots[i, k] - roots[n, k]) <= _SAME * size(roots[n, k]):
                same = False
            if image and not size(roots[i, k] * roots[n, k] - 1.0) <= _SAME:
                image = False
        if same or image:
            return i
    return -1


@compiled
def _judge(equations: Array, roots: Any, n: int, mirrored: bool, times: Table, choice: Any, work: Any) -> int:
    """REAL, and then exactly on the unit circles, or COMPLEX; AGAIN where the real one is known already."""
    real = choice[4]
    for k in range(3):
        real[k] = roots[n, k] / abs(roots[n, k])
        if not size(real[k] - roots[n, k]) <= _NEARLY_REAL:
            return COMPLEX
    if not evaluate(equations, real, work) <= _HOLDS:
        return COMPLEX
    for k in range(3):
        roots[n, k] = real[k]
    same = _find(roots, n, mirrored)
    if same < 0:
        return REAL
    times[same] += 1
    return AGAIN


@compiled
def _choices(equations: Array, w: Any, choice: Any) -> int:
    """The p12 and p56 that go with p34, two each: those that nearly satisfy the third distance, the best first."""
    K, L, M = equations[0], equations[1], equations[2]
    c, s = cosine_sine(w)
    x0, x1 = _angles(K[ONE] + K[C2] * c + K[S2] * s, K[C1] + K[CC] * c + K[CS] * s, K[S1] + K[SC] * c + K[SS] * s)
    z0, z1 = _angles(M[ONE] + M[C1] * c + M[S1] * s, M[C2] + M[CC] * c + M[SC] * s, M[S2] + M[CS] * c + M[SS] * s)
    count = 0
    for i in range(4):
        x, z = (x0 if i % 2 == 0 else x1), (z0 if i < 2 else z1)
        off = _off(L, x, z)
        if not (off <= _LOOSE or (count == 0 and i == 3)):
            continue
        place = count
        while place > 0 and choice[place - 1, 2].real > off:  # the third number keeps how far it is off, for now
            for k in range(3):
                choice[place, k] = choice[place - 1, k]
            place -= 1
        choice[place, 0], choice[place, 1], choice[place, 2] = x, z, off
        count += 1
    for i in range(count):
        choice[i, 2] = choice[i, 1]
        choice[i, 1] = w
    return count


@compiled
def _off(q: Array, a: Any, b: Any) -> float:
    """Part of its terms by which a distance is off."""
    c, s = cosine_sine(a)
    d, t = cosine_sine(b)
    residual = q[ONE] + q[C1] * c + q[S1] * s + q[C2] * d + q[S2] * t
    residual += q[CC] * c * d + q[CS] * c * t + q[SC] * s * d + q[SS] * s * t
    large, far = size(c) + size(s), size(d) + size(t)
    terms = abs(q[ONE]) + max(abs(q[C1]), abs(q[S1])) * large + max(abs(q[C2]), abs(q[S2])) * far
    terms += max(abs(q[CC]), abs(q[CS]), abs(q[SC]), abs(q[SS])) * large * far
    off = size(residual) / terms
    return off if off < 1e300 else 1e300


@compiled
def _angles(g: Any, b: Any, a: Any) -> tuple[Any, Any]:
    """Both exp(i p) with g + b cos p + a sin p = 0."""
    high, low = 0.5 * (b - 1j * a), 0.5 * (b + 1j * a)  # high w + g + low / w
    root = cmath.sqrt(g * g - 4.0 * high * low)
    if (root * g.conjugate()).real < 0.0:
        root = -root
    q = -0.5 * (g + root)
    first = q / high if high != 0.0 else complex(1e300)
    second = low / q if q != 0.0 and low != 0.0 else complex(1e-300)
    return first, second
