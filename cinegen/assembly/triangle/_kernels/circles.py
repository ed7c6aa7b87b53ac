"""Equations 1-9 and 19-22: the circles of the platform points, and the distances between them.

Two legs of known lengths that meet in one platform point leave it a circle about the line through their base points.
With B_i = O_i + r_i (cos p_i e_i + sin p_i f_i), and D = O_i - O_j, the distance m between two of them asks that

    |D|^2 + r_i^2 + r_j^2 - m^2
        + 2 r_i (D.e_i cos p_i + D.f_i sin p_i) - 2 r_j (D.e_j cos p_j + D.f_j sin p_j)
        - 2 r_i r_j (e_i.e_j cos p_i cos p_j + e_i.f_j cos p_i sin p_j
                     + f_i.e_j sin p_i cos p_j + f_i.f_j sin p_i sin p_j)

vanishes. With the base in one plane all f are its normal: what holds D.f or e.f is zero, and equations 20-22 are left,
with K11, K21, K22, K32, K33 the factors of sin sin, cos cos, cos p_i, cos p_j and 1.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, Table, compiled, entry

# a row of the geometry for each pair of legs: the first base point, axis, e, f (3 each), distance of the base points
POINT, AXIS, DIRECTION, ACROSS, APART, GEOMETRY_WIDTH = 0, 3, 6, 9, 12, 13
# a row of the circles: centre, e, f (3 each), radius, whose it is
CENTRE, E, F, RADIUS, PAIR, CIRCLES_WIDTH = 0, 3, 6, 9, 10, 11
# factors of one distance equation: of 1, cos and sin of the first angle, of the second, of their products
ONE, C1, S1, C2, S2, CC, CS, SC, SS, EQUATION_WIDTH = range(10)

_MEETS = 1e-14  # a squared radius above minus this part of the squared length is one that rounding made negative
_LEAST = 1e-15  # ... and is made so large at least, which lengthens legs that lie in a line by less than rounding


@entry
def find_circles(geometry: Array, pairs: Table, lengths: Array, circles: Array) -> bool:
    """The circles (3, CIRCLES_WIDTH) for lengths (6,), legs in `pairs` (6,), two by two; False where two can't meet."""
    meet = True
    for k in range(3):
        first, second, apart = lengths[pairs[2 * k]], lengths[pairs[2 * k + 1]], geometry[k, APART]
        along = 0.5 * (apart + (first - second) * (first + second) / apart)  # equations 1 and 4
        square = (first - along) * (first + along)
        longest = max(first, second)
        if square < -_MEETS * longest * longest:
            meet = False
        for i in range(3):
            circles[k, CENTRE + i] = geometry[k, POINT + i] + along * geometry[k, AXIS + i]
            circles[k, E + i], circles[k, F + i] = geometry[k, DIRECTION + i], geometry[k, ACROSS + i]
        circles[k, RADIUS], circles[k, PAIR] = math.sqrt(max(square, _LEAST * longest * longest)), k
    return meet


@compiled
def sort_circles(circles: Array) -> None:
    """The largest first.

    Equations 20-26 hold whichever point is called 12, 34 or 56, but what rounding leaves of the eigenvalues does not:
    where a small circle is eliminated in favour of a large one, whose angle then hardly varies, all digits may go.
    """
    for i in range(1, 3):
        for j in range(i, 0, -1):
            if circles[j, RADIUS] > circles[j - 1, RADIUS]:
                for a in range(CIRCLES_WIDTH):
                    circles[j, a], circles[j - 1, a] = circles[j - 1, a], circles[j, a]


@entry
def write_equations(circles: Array, sides: Array, equations: Array) -> None:
    """Factors (3, EQUATION_WIDTH) of the distances 12-34, 12-56 and 34-56 (K, L, M), the largest of each made 1.

    sides: (3,) the distances in the platform of pairs 0 and 1, 0 and 2, 1 and 2.
    """
    for k in range(3):
        i, j = (0, 1) if k == 0 else ((0, 2) if k == 1 else (1, 2))
        q, ri, rj = equations[k], circles[i, RADIUS], circles[j, RADIUS]
        side = sides[int(circles[i, PAIR] + circles[j, PAIR]) - 1]
        q[ONE] = ri * ri + rj * rj - side * side
        for a in range(1, EQUATION_WIDTH):
            q[a] = 0.0
        for a in range(3):
            d = circles[i, CENTRE + a] - circles[j, CENTRE + a]
            ei, fi, ej, fj = circles[i, E + a], circles[i, F + a], circles[j, E + a], circles[j, F + a]
            q[ONE] += d * d
            q[C1] += 2.0 * ri * d * ei
            q[S1] += 2.0 * ri * d * fi
            q[C2] -= 2.0 * rj * d * ej
            q[S2] -= 2.0 * rj * d * fj
            q[CC] -= 2.0 * ri * rj * ei * ej
            q[CS] -= 2.0 * ri * rj * ei * fj
            q[SC] -= 2.0 * ri * rj * fi * ej
            q[SS] -= 2.0 * ri * rj * fi * fj
        largest = 0.0
        for a in range(EQUATION_WIDTH):
            largest = max(largest, abs(q[a]))
        if largest > 0.0:
            for a in range(EQUATION_WIDTH):
                q[a] /= largest
