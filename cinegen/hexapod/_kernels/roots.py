"""All solutions of the three distances of a platform triangle, complex ones too, from its eigenvalues.

The unknowns are w = exp(i p) for the angles p12, p34, p56; a real angle has |w| = 1. For each eigenvalue exp(i p34) the
other two angles follow from a quadratic each; Newton's method on all three distances starts from the pairs that nearly
satisfy the third. Only then it is decided which solutions are real, by distances: near a singularity a pair of real
roots and a pair of complex ones differ by less than rounding.
"""

from __future__ import annotations

import cmath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cinegen.jit.compiled import Array, Table, compiled, entry
from cinegen.jit.vectors import copy

Complex = NDArray[np.complex128]

KNOWN, INFINITE, LOST, OUTCOME, COUNTS_WIDTH = range(5)
"""Counts: distinct finite solutions; eigenvalues that lead to infinity, or nowhere; and an outcome."""

SOLVED, CURVE, DIVERGED = range(3)
"""Outcomes. CURVE: the determinant vanishes identically. DIVERGED: the eigenvalues did not converge."""

_NEW, _AGAIN, _AT_INFINITY, _NOWHERE = range(4)
"""Where an eigenvalue leads. AGAIN: to a solution known from another eigenvalue, which is a multiple root."""

_REGULAR, _ALONE, _MOVED = range(3)
"""Results of `_move_to_neighbour`."""

_FAR = 1e6  # |w| or 1 / |w| of a solution at infinity
_LEAVING = 30.0  # ... if Newton's method finds nothing there: infinity is a multiple root
SAME = 3e-7  # relative difference of solutions that rounding can't distinguish: the square root of a residual
_NEAR = 0.1  # largest relative distance of an eigenvalue from the solution it leads to
_NEARER = 1e-3  # ... where another solution fits it better
_LOOSE = 1e-3  # residual of the third distance before Newton's method, relative to its terms
_NEARLY_REAL = 1e-3  # | |w| - 1 | of what may be real; of a simple root nothing but rounding is left
_HOLDS = 1e-12  # relative residual of a distance with the imaginary parts left out
ON_CIRCLE = 1e-14  # | |w| - 1 | of a solution that was found to be real
_MAX_STEPS = 40  # of Newton's method: a root of high multiplicity is found slowly
_LONGEST = 0.5  # rad, of one step
_STILL = 1e-9  # rad: after such a step the next would be shorter than rounding
_EXACT = 1e-15  # relative residual below which no step is taken
_SOLVED = 1e-12  # relative residual of an equation that holds
_SINGULAR = 1e-3  # volume of the Jacobian's rows, as unit vectors, below which a solution may be one of several
_STEEP = 1e-2  # of the sum of its terms: a shorter row is not normalised


@entry
def find_roots(
    equations: Array, directions: Complex, extents: Array, planar: bool, roots: Complex, times: Table, counts: Table,
    choice: Complex, work: Complex,
) -> None:  # fmt: skip
    """Find the distinct finite solutions for many sets of leg lengths.

    Args:
        equations: (m, 3, 3, 3) of the distances, in 1, cosine and sine of their two angles.
        directions: (m, 8) or (m, 16) exp(i p34), see `eigen_directions`.
        extents: (m, 3) radii of the circles, as parts of the longest leg: solutions whose points coincide are one.
        planar: whether base points are in one plane. Then a solution and its mirror image (1 / w) count as one.
        roots: (m, 17, 3) w of the solutions are written; those of real ones are on the unit circle.
        times: (m, 17) how many eigenvalues lead to each.
        counts: (m, COUNTS_WIDTH) are increased, of those sets whose outcome is SOLVED.
        choice: (5, 3) scratch.
        work: (6, 3) scratch.
    """
    for m in range(len(equations)):
        if counts[m, OUTCOME] != SOLVED:
            continue
        for w in directions[m]:
            n = counts[m, KNOWN]
            led = _follow(equations[m], extents[m], w, planar, n, roots[m], times[m], choice, work)
            counts[m, KNOWN] += led == _NEW
            counts[m, INFINITE] += led == _AT_INFINITY
            counts[m, LOST] += led == _NOWHERE


@compiled
def is_real(root: Any) -> bool:
    """Return whether a root (3,) was found to be real."""
    off = 0.0
    for k in range(3):
        off = max(off, abs(abs(root[k]) - 1.0))
    return off < ON_CIRCLE


@compiled
def _follow(
    equations: Array, extents: Array, w: Any, mirrored: bool, n: int, roots: Any, times: Table, choice: Any, work: Any
) -> int:  # fmt: skip
    """Write the solution with exp(i p34) = w, roughly, to roots[n] if it is new; return where w leads."""
    if not _remoteness(w) < _FAR:
        return _AT_INFINITY
    again, root = -1, roots[n]
    times[n] = 1
    count = _write_choices(equations, w, choice)
    for i in range(2 * count):
        if i < count:
            copy(choice[i], root, 3)
        else:  # nothing is new: what was found is a multiple root, or has another one next to it
            known = int(choice[i - count, 0].real)
            if known < 0:
                continue
            copy(roots[known], root, 3)
            neighbour = _move_to_neighbour(equations, root, work)
            if neighbour != _REGULAR and again < 0:
                again = known
            if neighbour != _MOVED:
                continue
        solved = _newton(equations, root, work)
        far = max(_remoteness(root[0]), _remoteness(root[1]), _remoteness(root[2]))
        if i == 0 and (not far < _FAR or (far > _LEAVING and not solved)):
            return _AT_INFINITY
        if i < count:
            choice[i, 0] = -1.0
        if not solved or not far < _FAR or not _size(root[1] - w) <= (_NEAR if i % count == 0 else _NEARER) * _size(w):
            continue
        known = _find(roots, n, extents, mirrored, False)
        if known < 0:
            if not _make_real(equations, root, choice[4], work):
                return _NEW
            known = _find(roots, n, extents, mirrored, True)
            if known < 0:
                return _NEW
            times[known] += 1
            return _AGAIN
        if i < count:
            choice[i, 0] = float(known)
    if again < 0:
        return _NOWHERE if _remoteness(w) < _LEAVING else _AT_INFINITY
    times[again] += 1
    return _AGAIN


@compiled
def _remoteness(w: Any) -> float:
    """Return the larger of |w| and 1 / |w|: 1 for a real angle, infinite at infinity; NaN where w is NaN."""
    far = float(abs(w))
    return max(far, 1.0 / far) if far == far else far


@compiled
def _find(roots: Any, n: int, extents: Array, mirrored: bool, real: bool) -> int:
    """Return which of the first n roots coincides with root n, or is its mirror image; -1 if none does.

    Of real ones platform points are compared, which may coincide though angles don't, on a small circle.
    """
    for i in range(n):
        if real and not is_real(roots[i]):
            continue
        same, image = True, mirrored
        for k in range(3):
            weight = extents[k] if real else 1.0
            same = same and weight * _size(roots[i, k] - roots[n, k]) <= SAME * _size(roots[n, k])
            image = image and weight * _size(roots[i, k] * roots[n, k] - 1.0) <= SAME
        if same or image:
            return i
    return -1


@compiled
def _make_real(equations: Array, root: Any, real: Any, work: Any) -> bool:
    """Move a root (3,) onto the unit circle if the distances hold there too."""
    for k in range(3):
        real[k] = root[k] / abs(root[k])
        if not _size(real[k] - root[k]) <= _NEARLY_REAL:
            return False
    if not _evaluate(equations, real, work) <= _HOLDS:
        return False
    copy(real, root, 3)
    return True


@compiled
def _write_choices(equations: Array, w: Any, choice: Any) -> int:
    """Write the p12 and p56 that go with p34, of two values each those that nearly satisfy the third distance, the best
    first. Return how many there are."""
    K, L, M = equations[0], equations[1], equations[2]
    c, s = _cosine_sine(w)
    x0, x1 = _angles(_form(K, c, s))
    z0, z1 = _angles(_form(M.T, c, s))
    count = 0
    for i in range(4):
        x, z = (x0 if i % 2 == 0 else x1), (z0 if i < 2 else z1)
        c, s = _cosine_sine(x)
        d, t = _cosine_sine(z)
        residual, _, terms = _distance(L, c, s, d, t)
        off = _size(residual) / terms
        if not off < 1e300:
            off = 1e300
        if not (off <= _LOOSE or (count == 0 and i == 3)):
            continue
        at = count
        while at > 0 and choice[at - 1, 2].real > off:  # the third number holds the residual for now
            copy(choice[at - 1], choice[at], 3)
            at -= 1
        choice[at, 0], choice[at, 1], choice[at, 2] = x, z, off
        count += 1
    for i in range(count):
        choice[i, 1], choice[i, 2] = w, choice[i, 1]
    return count


@compiled
def _angles(form: Any) -> tuple[Any, Any]:
    """Return both exp(i p) with g + b cos p + a sin p = 0, for a form (g, b, a)."""
    g, b, a = form
    high, low = 0.5 * (b - 1j * a), 0.5 * (b + 1j * a)  # high w + g + low / w
    root = cmath.sqrt(g * g - 4.0 * high * low)
    if (root * g.conjugate()).real < 0.0:
        root = -root
    q = -0.5 * (g + root)
    first = q / high if high != 0.0 else complex(1e300)
    second = low / q if q != 0.0 and low != 0.0 else complex(1e-300)
    return first, second


# --- Newton's method on the three distances ---------------------------------------------------------------------------


@compiled
def _newton(equations: Array, w: Any, work: Any) -> bool:
    """Improve w (3,); return whether the distances hold there.

    work: (6, 3) complex scratch: residuals, sums of terms, step, Jacobian.
    """
    last, worst = 1.0, 1.0
    for steps in range(_MAX_STEPS + 1):
        worst = _evaluate(equations, w, work)
        if worst <= _EXACT or last <= _STILL or steps == _MAX_STEPS or not _solve(work):
            break
        last = 0.0
        for k in range(3):
            last = max(last, _size(work[2, k]))
        if not last < 1e300:
            return False
        part = 1.0 if last <= _LONGEST else _LONGEST / last
        for k in range(3):
            w[k] *= _rotation(part * work[2, k])
    return bool(worst <= _SOLVED)


@compiled
def _form(q: Array, c: Any, s: Any) -> tuple[Any, Any, Any]:
    """Return the coefficients of 1, cosine and sine of a distance's first angle, for cosine and sine of its second."""
    return q[0, 0] + q[0, 1] * c + q[0, 2] * s, q[1, 0] + q[1, 1] * c + q[1, 2] * s, q[2, 0] + q[2, 1] * c + q[2, 2] * s


@compiled
def _distance(q: Array, c: Any, s: Any, d: Any, t: Any) -> tuple[Any, Any, Any]:
    """Return the residual of a distance at cosine c and sine s of its first angle, d and t of its second; its
    derivative by the first angle; and the sum of its terms' sizes."""
    constant, by_c, by_s = _form(q, d, t)
    large, far = _size(c) + _size(s), _size(d) + _size(t)
    terms = abs(q[0, 0]) + max(abs(q[1, 0]), abs(q[2, 0])) * large + max(abs(q[0, 1]), abs(q[0, 2])) * far
    terms += max(abs(q[1, 1]), abs(q[1, 2]), abs(q[2, 1]), abs(q[2, 2])) * large * far
    return constant + by_c * c + by_s * s, by_s * c - by_c * s, terms


@compiled
def _evaluate(equations: Array, w: Any, work: Any) -> float:
    """Write the residuals of K, L, M and their derivatives by the three angles; return the worst relative residual."""
    worst = 0.0
    for k in range(3):
        i, j = (0, 1) if k == 0 else ((0, 2) if k == 1 else (1, 2))
        c, s = _cosine_sine(w[i])
        d, t = _cosine_sine(w[j])
        residual, derivative, terms = _distance(equations[k], c, s, d, t)
        _, by_d, by_t = _form(equations[k].T, c, s)
        work[0, k], work[1, k] = residual, terms
        work[3 + k, 2 - k] = 0.0
        work[3 + k, i], work[3 + k, j] = derivative, by_t * d - by_d * t
        relative = _size(residual) / terms
        if not relative <= worst:  # NaN counts too
            worst = relative
    return worst


@compiled
def _rotation(p: Any) -> Any:
    """Return (1 + i p / 2) / (1 - i p / 2): nearly exp(i p), and of size 1 for a real p."""
    x, y = 0.5 * p.real, 0.5 * p.imag
    below = (1.0 + y) * (1.0 + y) + x * x
    return complex((1.0 - y) * (1.0 + y) - x * x, 2.0 * x) / below


@compiled
def _cosine_sine(w: Any) -> tuple[Any, Any]:
    """Return cos p and sin p, with w = exp(i p)."""
    x, y = w.real, w.imag
    over = 1.0 / (x * x + y * y)
    u, v = x * over, y * over  # 1 / w = u - i v
    return complex(0.5 * (x + u), 0.5 * (y - v)), complex(0.5 * (y + v), 0.5 * (u - x))


@compiled
def _size(z: Any) -> float:
    """Return a number between |z| and 1.42 |z|, faster than |z| itself."""
    return float(abs(z.real) + abs(z.imag))


@compiled
def _solve(work: Any) -> bool:
    """Write the step: row 2 of work = - J^-1 residuals, with J = [[a, b, 0], [c, 0, d], [0, e, f]]."""
    a, b, c, d, e, f = work[3, 0], work[3, 1], work[4, 0], work[4, 2], work[5, 1], work[5, 2]
    x, y, z = work[0, 0], work[0, 1], work[0, 2]
    determinant = -(a * d * e + b * c * f)
    if determinant == 0.0:
        return False
    square = determinant.real * determinant.real + determinant.imag * determinant.imag
    over = -determinant.conjugate() / square
    work[2, 0] = over * (-d * e * x - b * f * y + b * d * z)
    work[2, 1] = over * (-c * f * x + a * f * y - a * d * z)
    work[2, 2] = over * (c * e * x - a * e * y - b * c * z)
    return True


@compiled
def _move_to_neighbour(equations: Array, w: Any, work: Any) -> int:
    """Move a solution w (3,) near a singularity to where the other solution of the pair must be.

    Along the null vector v of the Jacobian J, projected on its left null vector u, the distances are b x + c x^2 / 2
    with b = u.J v and c = u.F''(v, v): they vanish at x = -2 b / c too.

    Returns:
        _MOVED; _ALONE where there is no such place nearby; _REGULAR where w is not near a singularity.
    """
    _evaluate(equations, w, work)
    a, b, c, d, e, f = work[3, 0], work[3, 1], work[4, 0], work[4, 2], work[5, 1], work[5, 2]
    rows = max(_size(a) + _size(b), _STEEP * work[1, 0].real) * max(_size(c) + _size(d), _STEEP * work[1, 1].real)
    rows *= max(_size(e) + _size(f), _STEEP * work[1, 2].real)
    if not _size(a * d * e + b * c * f) <= _SINGULAR * rows:
        return _REGULAR
    # the adjugate's rows are multiples of u, its columns of v
    work[0, 0], work[0, 1], work[0, 2] = -d * e, -b * f, b * d
    work[1, 0], work[1, 1], work[1, 2] = -c * f, a * f, -a * d
    work[2, 0], work[2, 1], work[2, 2] = c * e, -a * e, -b * c
    row, column, largest = 0, 0, 0.0
    for i in range(3):
        for j in range(3):
            if abs(work[i, j]) > largest:
                row, column, largest = i, j, abs(work[i, j])
    if largest == 0.0:
        return _ALONE
    u0, u1, u2 = work[row, 0] / largest, work[row, 1] / largest, work[row, 2] / largest
    v0, v1, v2 = work[0, column] / largest, work[1, column] / largest, work[2, column] / largest
    slope = u0 * (a * v0 + b * v1) + u1 * (c * v0 + d * v2) + u2 * (e * v1 + f * v2)
    curvature = u0 * _second(equations[0], w[0], w[1], v0, v1) + u1 * _second(equations[1], w[0], w[2], v0, v2)
    curvature += u2 * _second(equations[2], w[1], w[2], v1, v2)
    if curvature == 0.0:
        return _ALONE
    x = -2.0 * slope / curvature
    if not abs(x) * max(abs(v0), abs(v1), abs(v2)) < _LONGEST:
        return _ALONE
    w[0] *= 1.0 + 1j * x * v0
    w[1] *= 1.0 + 1j * x * v1
    w[2] *= 1.0 + 1j * x * v2
    return _MOVED


@compiled
def _second(q: Array, a: Any, b: Any, x: Any, y: Any) -> Any:
    """Return the second derivative of a distance when its two angles change at rates x and y."""
    c, s = _cosine_sine(a)
    d, t = _cosine_sine(b)
    _, by_c, by_s = _form(q, d, t)
    _, by_d, by_t = _form(q.T, c, s)
    mixed = c * (q[2, 2] * d - q[2, 1] * t) - s * (q[1, 2] * d - q[1, 1] * t)
    return -(c * by_c + s * by_s) * x * x - (d * by_d + t * by_t) * y * y + 2.0 * mixed * x * y
