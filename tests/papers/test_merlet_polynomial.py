"""Merlet's polynomial against the modes; the RSSR spin surface (section 2.2) has order 16 and circularity 8."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from merlet_polynomial import SpinSurface, Triangle, polynomial

from cinegen.hexapod import Hexapod
from cinegen.hexapod.legs import leg_lengths

PLACES = 40  # on a circle of complex numbers, more than the polynomial has coefficients
ROUNDING = 1e-11

seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def drawn(rng):
    base, platform = rng.normal(size=(6, 3)) * [1.0, 1.0, 0.0], rng.normal(size=(3, 3))
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    placement = np.eye(4)
    placement[:3, :3], placement[:3, 3] = q * np.linalg.det(q), rng.normal(size=3)
    lengths = leg_lengths(base, np.repeat(platform, 2, axis=0), placement)
    return base, platform, lengths, Triangle(base, platform, lengths)


def modes(base, platform, lengths):
    """(n, 3, 3) platform points."""
    placements = Hexapod(base, np.repeat(platform, 2, axis=0)).modes(lengths).placements
    return platform @ placements[:, :3, :3].swapaxes(1, 2) + placements[:, None, :3, 3]


def along(surface, start, way):
    """(PLACES,) coefficients of the polynomial that the surface is on a line; complex places hold them well."""
    turn = np.exp(2j * np.pi * np.arange(PLACES) / PLACES)
    return np.fft.fft(surface.value(start + turn[:, None] * way)) / PLACES


@given(seeds)
def test_it_vanishes_at_the_modes_whatever_the_legs_that_are_off(rng):
    *robot, triangle = drawn(rng)
    surface = SpinSurface(triangle)
    for point in modes(*robot)[:, 2]:
        around = np.abs(surface.value(point + 0.3 * rng.normal(size=(50, 3)))).max()
        assert abs(surface.value(point)) <= 1e-9 * around


@given(seeds)
def test_its_order_is_16_and_its_highest_terms_are_those_of_equation_18(rng):
    """(X^2 + Y^2 + Z^2)^8, with a factor that vanishes where the axes of both circles are parallel."""
    surface = SpinSurface(drawn(rng)[-1])
    k = surface._k
    factor = -((k[2, 2] ** 2 - k[1, 1] ** 2) ** 2)  # K11, K21
    for _ in range(3):
        way = rng.normal(size=3)
        way *= 5.0 / np.linalg.norm(way)
        coefficients = along(surface, rng.normal(size=3), surface.unit * way)
        expected = factor * (way @ way) ** 8
        assert np.abs(coefficients[17:]).max() <= ROUNDING * np.abs(coefficients).max()
        assert abs(coefficients[16] - expected) <= 1e-9 * abs(expected) + ROUNDING * np.abs(coefficients).max()


@given(seeds)
def test_its_circularity_is_8(rng):
    surface = SpinSurface(drawn(rng)[-1])
    for _ in range(3):
        q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        sizes = np.abs(along(surface, rng.normal(size=3), 3.0 * surface.unit * (q[0] + 1j * q[1])))
        assert sizes[9:].max() <= ROUNDING * sizes.max()
        assert sizes[8] > 1e3 * sizes[9:].max()


@settings(max_examples=50)
@given(seeds)
def test_the_polynomial_vanishes_at_every_mode_and_at_no_other_place(rng):
    *robot, triangle = drawn(rng)
    poly = polynomial(triangle)
    assert len(poly.coef) == 17
    assert not poly.coef[1::2].any()
    away = (modes(*robot)[:, 1] - triangle.centre[1]) / triangle.radius[1]  # of the platform point on circle 34
    cosine, sine = away @ triangle.e[1], away[:, 2]
    x = sine / (1.0 + cosine)
    assert len(x) > 0
    assert (np.abs(poly(x)) <= 1e-10 * (1.0 + x * x) ** 8).all()
    roots = poly.roots()
    real = roots[np.abs(roots.imag) <= 1e-9 * (1.0 + np.abs(roots))].real
    near = np.abs(real[:, None] - x).min(axis=1) / (1.0 + np.abs(real))
    assert np.median(near) <= 1e-4  # its coefficients do not hold them better
