"""Newton's method on the three distances, in complex angles: w = exp(i p) of each, real angles where |w| = 1."""

from __future__ import annotations

from typing import Any

from cinegen.assembly.triangle._kernels.circles import C1, C2, CC, CS, ONE, S1, S2, SC, SS
from cinegen.jit.compiled import Array, compiled

REGULAR, ALONE, MOVED = range(3)
"""What a solution is that had perhaps a twin."""

_STEPS = 40  # a root of high multiplicity is found slowly
_LONGEST = 0.5  # rad, of one step
_STILL = 1e-9  # a step after which the next would be shorter than rounding
_EXACT = 1e-15  # of the sum of the terms of an equation: no step is worth while
_SOLVED = 1e-12  # of the sum of the terms: an equation holds
_SINGULAR = 1e-3  # volume of the Jacobian's rows, as unit vectors, below which a solution may be one of several
_STEEP = 1e-2  # of the sum of its terms: a row that is shorter does not become a unit vector


@compiled
def settle(equations: Array, w: Any, work: Any) -> bool:
    """Improves w (3,) and says whether it solves the distances now.

    work: (6, 3) complex scratch: residuals, sums of terms, step, Jacobian.
    """
    last, worst = 1.0, 1.0
    for steps in range(_STEPS + 1):
        worst = evaluate(equations, w, work)
        if worst <= _EXACT or last <= _STILL or steps == _STEPS or not _solve(work):
            break
        last = 0.0
        for k in range(3):
            last = max(last, size(work[2, k]))
        if not last < 1e300:
            return False
        part = 1.0 if last <= _LONGEST else _LONGEST / last
        for k in range(3):
            w[k] *= turn(part * work[2, k])
    return bool(worst <= _SOLVED)


@compiled
def evaluate(equations: Array, w: Any, work: Any) -> float:
    """Writes the residuals of K, L, M and their derivatives by the three angles; returns the worst relative one."""
    worst = 0.0
    for k in range(3):
        i, j = (0, 1) if k == 0 else ((0, 2) if k == 1 else (1, 2))
        q = equations[k]
        c, s = cosine_sine(w[i])
        d, t = cosine_sine(w[j])
        by_c, by_s = q[C1] + q[CC] * d + q[CS] * t, q[S1] + q[SC] * d + q[SS] * t
        residual = q[ONE] + (q[C2] * d + q[S2] * t) + by_c * c + by_s * s
        work[0, k] = residual
        work[3 + k, 2 - k] = 0.0
        work[3 + k, i] = by_s * c - by_c * s
        work[3 + k, j] = (q[S2] + q[CS] * c + q[SS] * s) * d - (q[C2] + q[CC] * c + q[SC] * s) * t
        large, far = size(c) + size(s), size(d) + size(t)
        terms = abs(q[ONE]) + max(abs(q[C1]), abs(q[S1])) * large + max(abs(q[C2]), abs(q[S2])) * far
        terms += max(abs(q[CC]), abs(q[CS]), abs(q[SC]), abs(q[SS])) * large * far
        work[1, k] = terms
        relative = size(residual) / terms
        if not relative <= worst:  # no number counts too
            worst = relative
    return worst


@compiled
def turn(p: Any) -> Any:
    """(1 + i p / 2) / (1 - i p / 2): nearly exp(i p), and of size 1 for a real p."""
    x, y = 0.5 * p.real, 0.5 * p.imag
    below = (1.0 + y) * (1.0 + y) + x * x
    return complex((1.0 - y) * (1.0 + y) - x * x, 2.0 * x) / below


@compiled
def cosine_sine(w: Any) -> tuple[Any, Any]:
    """Of p, with w = exp(i p)."""
    x, y = w.real, w.imag
    over = 1.0 / (x * x + y * y)
    u, v = x * over, y * over  # 1 / w = u - i v
    return complex(0.5 * (x + u), 0.5 * (y - v)), complex(0.5 * (y + v), 0.5 * (u - x))


@compiled
def size(z: Any) -> float:
    """Between |z| and 1.42 |z|, sooner known than |z| itself."""
    return float(abs(z.real) + abs(z.imag))


@compiled
def _solve(work: Any) -> bool:
    """The step: row 2 of work = - J^-1 residuals, with J = [[a, b, 0], [c, 0, d], [0, e, f]]."""
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
def twin(equations: Array, w: Any, work: Any) -> int:
    """Moves a solution w (3,) to where its neighbour must be, near a singularity.

    Along the vector v that the Jacobian J hardly moves, and seen along its left counterpart u, the distances are
    b x + c x^2 / 2 with b = u.J v and c = u.F''(v, v): they vanish at x = -2 b / c too.

    Returns:
        MOVED; ALONE where there is no such place nearby; REGULAR where w is not near a singularity.
    """
    evaluate(equations, w, work)
    a, b, c, d, e, f = work[3, 0], work[3, 1], work[4, 0], work[4, 2], work[5, 1], work[5, 2]
    rows = max(size(a) + size(b), _STEEP * work[1, 0].real) * max(size(c) + size(d), _STEEP * work[1, 1].real)
    rows *= max(size(e) + size(f), _STEEP * work[1, 2].real)
    if not size(a * d * e + b * c * f) <= _SINGULAR * rows:
        return REGULAR
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
        return ALONE
    u0, u1, u2 = work[row, 0] / largest, work[row, 1] / largest, work[row, 2] / largest
    v0, v1, v2 = work[0, column] / largest, work[1, column] / largest, work[2, column] / largest
    slope = u0 * (a * v0 + b * v1) + u1 * (c * v0 + d * v2) + u2 * (e * v1 + f * v2)
    bend = u0 * _second(equations[0], w[0], w[1], v0, v1) + u1 * _second(equations[1], w[0], w[2], v0, v2)
    bend += u2 * _second(equations[2], w[1], w[2], v1, v2)
    if bend == 0.0:
        return ALONE
    x = -2.0 * slope / bend
    if not abs(x) * max(abs(v0), abs(v1), abs(v2)) < _LONGEST:
        return ALONE
    w[0] *= 1.0 + 1j * x * v0
    w[1] *= 1.0 + 1j * x * v1
    w[2] *= 1.0 + 1j * x * v2
    return MOVED


@compiled
def _second(q: Array, a: Any, b: Any, x: Any, y: Any) -> Any:
    """The second derivative of a distance when its two angles go by x and y."""
    c, s = cosine_sine(a)
    d, t = cosine_sine(b)
    one, other = q[C1] * c + q[S1] * s, q[C2] * d + q[S2] * t
    both = q[CC] * c * d + q[CS] * c * t + q[SC] * s * d + q[SS] * s * t
    mixed = q[CC] * s * t - q[CS] * s * d - q[SC] * c * t + q[SS] * c * d
    return -(one + both) * x * x - (other + both) * y * y + 2.0 * mixed * x * y
