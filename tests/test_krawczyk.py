"""Krawczyk's test on equations of one and two unknowns, judged by mpmath at 50 digits."""

import mpmath
import numpy as np
import pytest
from flint import arb
from hypothesis import given
from hypothesis import strategies as st

from cinegen.krawczyk import Values, certify


def polynomial(*coefficients):
    """The equation c0 + c1 x + ... = 0, with coefficients that are doubles or texts."""
    exact = [arb(c) for c in coefficients]

    def evaluate(box, _):
        (x,) = box
        value, slope = arb(0), arb(0)
        for c in reversed(exact):
            value, slope = value * x + c, slope * x + value
        return Values([value], [[slope]], [])

    return evaluate


def certified(equations, *point, rank=None):
    result = certify(equations, np.array(point), np.ones(len(point)), len(point) if rank is None else rank)
    return None if result is None else result[0]


@pytest.mark.parametrize("imaginary", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_conjugate_pair_is_never_certified_real(imaginary):
    """x^2 + e^2: the smaller the imaginary part, the smaller the residual in the reals: down to 1e-24."""
    equation = polynomial(arb(imaginary) ** 2, 0.0, 1.0)
    for point in (0.0, imaginary, 0.1 * imaginary, -imaginary, 1e-10, 1e-8):
        assert certified(equation, point) is None


def test_a_point_that_is_no_solution_is_not_certified():
    assert certified(polynomial(-2.0, 0.0, 1.0), 2.0**0.5 + 1e-3) is None
    assert certified(polynomial(-2.0, 0.0, 1.0), np.nan) is None
    assert certified(polynomial(-2.0, 0.0, 1.0), np.inf) is None


@given(st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=6), st.floats(-12.0, -1.0))
def test_what_is_certified_is_a_root_and_the_only_one_in_its_box(roots, exponent):
    """Roots of random polynomials, the last two of them 10**exponent apart."""
    roots[-1] = roots[-2] + 10.0**exponent
    with mpmath.workdps(50):
        exact = [mpmath.mpf(root) for root in roots]
        coefficients = [mpmath.mpf(1)]
        for root in exact:
            coefficients = [
                a - root * b
                for a, b in zip([mpmath.mpf(0), *coefficients], [*coefficients, mpmath.mpf(0)], strict=True)
            ]
        evaluate = polynomial(*(arb(mpmath.nstr(c, 50)) for c in coefficients))
        for root in roots:
            certificate = certified(evaluate, root)
            if certificate is not None:
                near = [other for other in exact if abs(other - mpmath.mpf(root)) <= certificate.radius]
                assert len(near) == 1
                assert abs(near[0] - mpmath.mpf(root)) <= certificate.error + mpmath.mpf(10) ** -35


def circles(box, _):
    """x^2 + y^2 = 1, x = y, and their difference: three equations, of which two are independent."""
    x, y = box
    rows = [x * x + y * y - 1, x - y, x * x + y * y - 1 - (x - y)]
    return Values(rows, [[2 * x, 2 * y], [arb(1), arb(-1)], [2 * x - 1, 2 * y + 1]], [x])


def test_equations_that_depend_on_the_others_are_bounded():
    half = 0.5**0.5
    certificate = certified(circles, half, half)
    assert (certificate.equations, certificate.others) == (2, 1)
    assert 0.0 < certificate.gap < 1e-15


def test_numbers_that_must_be_positive_are():
    assert certified(circles, -(0.5**0.5), -(0.5**0.5)) is None


def test_equations_that_contradict_each_other_are_not_certified():
    def contradiction(box, derive):
        values = circles(box, derive)
        return values._replace(residual=[*values.residual[:2], values.residual[2] + 1e-6])

    assert certified(contradiction, 0.5**0.5, 0.5**0.5) is None


def test_unknowns_without_effect_stay_where_they_are():
    def evaluate(box, _):
        x, _ = box
        return Values([x * x - 2], [[2 * x, arb(0)]], [])

    assert certified(evaluate, 2.0**0.5, 0.3, rank=1).equations == 1
    assert certified(evaluate, 2.0**0.5, 0.3, rank=2) is None


def test_a_rank_that_is_too_low_certifies_nothing():
    """Else one of two unknowns would be kept, and a point of a curve be certified as a solution."""
    assert certified(circles, 0.5**0.5, 0.5**0.5, rank=1) is None
