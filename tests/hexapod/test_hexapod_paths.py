"""What hexapods are solved by: their equations, and paths of solutions, against plain numpy and closed forms."""

import numpy as np
import pytest

from cinegen.hexapod.paths import PathEnd, follow, follow_surely, lie_on_curve
from cinegen.hexapod.study import (
    coefficients,
    distances,
    family,
    lengths_at,
    placements,
    residual,
    squares,
    start_system,
)


def random(rng, *shape):
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def product(p, q):
    """Of quaternions (4,), after Hamilton."""
    return np.concatenate([[p[0] * q[0] - p[1:] @ q[1:]], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


def left_sides(base, platform, s, x):
    """(7,) of the equations, one after the other, as they are written down."""
    c, d = x[:4], x[4:]
    found = []
    for a, b, own in zip(base, platform, s, strict=True):
        cb, ac = product(c, np.concatenate([[0], b])), product(np.concatenate([[0], a]), c)
        found.append(own * (c @ c) + d @ d + 2 * d @ (cb - ac) - 2 * ac @ cb)
    return np.array([found[0], *(np.array(found[1:]) - found[0]), c @ d])


def hexapod(rng):
    """Complex points, s and one solution of norm 1."""
    base, platform, x = random(rng, 6, 3), random(rng, 6, 3), random(rng, 8)
    x[4:] -= x[:4] * (x[:4] @ x[4:]) / (x[:4] @ x[:4])
    x /= np.linalg.norm(x)
    return base, platform, lengths_at(base, platform, x), x


@pytest.mark.parametrize("seed", range(2))
def test_the_equations_are_distances(seed):
    rng = np.random.default_rng(seed)
    base, platform = rng.normal(size=(2, 6, 3))
    x = rng.normal(size=8)
    x[4:] -= x[:4] * (x[:4] @ x[4:]) / (x[:4] @ x[:4])
    placement = placements(x[None])[0]
    np.testing.assert_allclose(placement[:3, :3] @ placement[:3, :3].T, np.eye(3), atol=1e-13)
    reach = np.linalg.norm(platform @ placement[:3, :3].T + placement[:3, 3] - base, axis=1)
    s = squares(base, platform) - reach**2
    np.testing.assert_allclose(left_sides(base, platform, s, x), 0.0, atol=1e-11)
    np.testing.assert_allclose(lengths_at(base, platform, x), s, atol=1e-11)
    assert residual(coefficients(base, platform, s), x[None])[0] < 1e-11


def tangent(polynomial, parameter, x):
    """dx by the parameter, with x's length and phase at rest: from differences of the left sides alone."""

    def at(t, y):
        a = polynomial[0] + t * (polynomial[1] + t * polynomial[2])
        first, second = np.triu_indices(4, 1)
        c, d = y[:4], y[4:]
        products = np.concatenate([c * c, 2 * c[first] * c[second], 2 * (d[first] * c[second] - d[second] * c[first])])
        sides = a @ products
        sides[0] += d @ d
        return np.concatenate([sides, [c @ d]])

    step = 1e-6
    rows = np.array([(at(parameter, x + step * e) - at(parameter, x - step * e)) / (2 * step) for e in np.eye(8)]).T
    by_parameter = (at(parameter + step, x) - at(parameter - step, x)) / (2 * step)
    return np.linalg.solve(np.vstack([rows, x.conj()]), np.concatenate([-by_parameter, [0.0]]))


def test_a_path_is_that_of_small_steps():
    rng = np.random.default_rng(2)
    base, platform, s, x = hexapod(rng)
    ends = [(base, platform, s), (base + random(rng, 6, 3), platform + random(rng, 6, 3), s)]
    polynomial = family(
        *(coefficients(*end) for end in ends), coefficients(*(0.5 * (p + q) for p, q in zip(*ends, strict=True)))
    )
    n, y = 200, x.copy()
    for i in range(n):
        t, h = i / n, 1.0 / n
        k1 = tangent(polynomial, t, y)
        k2 = tangent(polynomial, t + h / 2, y + h / 2 * k1)
        k3 = tangent(polynomial, t + h / 2, y + h / 2 * k2)
        k4 = tangent(polynomial, t + h, y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        y /= np.linalg.norm(y)
    found = follow(polynomial, x[None], 1e-4)
    assert found.end[0] == PathEnd.REGULAR
    assert distances(found.x, y[None])[0, 0] < 1e-6
    assert residual(polynomial.sum(axis=0), found.x)[0] < 1e-13


def test_at_a_fold_two_paths_end_in_one_point():
    rng = np.random.default_rng(5)
    kept = start_system()
    base, platform = kept.base, kept.platform
    singular = singular_solution(rng, base, platform)
    here = coefficients(base, platform, kept.s)
    there = coefficients(base, platform, lengths_at(base, platform, singular))

    def way(detour):
        aside = 0.0 if detour is None else coefficients(0.0 * base, 0.0 * platform, random(detour, 6))
        return family(here, there, 0.5 * (here + there) + aside)

    found = follow(way(None), kept.x, 1e-4)
    assert (found.count(PathEnd.REGULAR), found.count(PathEnd.MULTIPLE)) == (38, 2)
    assert distances(found.x[found.end == PathEnd.MULTIPLE], singular[None]).max() < 1e-7
    assert not lie_on_curve(way, kept.x, found)


def singular_solution(rng, base, platform):
    """(8,) a pose where lengths don't determine motions: on a line of poses, a zero of the determinant (secants)."""
    c, d, e, patch = *random(rng, 3, 4), random(rng, 8)

    def pose(t):
        x = np.concatenate([c, d + t * e])
        x[4:] -= c * (c @ x[4:]) / (c @ c)
        return x

    def determinant(t):
        x = pose(t)
        s = lengths_at(base, platform, x)
        sides = [left_sides(base, platform, s, x + u) - left_sides(base, platform, s, x - u) for u in np.eye(8)]
        return np.linalg.det(np.vstack([np.array(sides).T, patch]))

    first, second = 0.0 + 0j, 0.1 + 0j
    while abs(second - first) > 1e-14 * abs(second):
        f, g = determinant(first), determinant(second)
        first, second = second, second - g * (second - first) / (g - f)
    return pose(second) / np.linalg.norm(pose(second))


def test_a_path_that_jumped_is_followed_again():
    # the first attempt is spoilt: two paths begin at one solution, as if one had jumped
    kept = start_system()
    rng = np.random.default_rng(6)
    here, there = (coefficients(kept.base, kept.platform, s) for s in (kept.s, kept.s + random(rng, 6)))
    spoilt = kept.x.copy()
    spoilt[1] = spoilt[0]
    found = follow_surely(lambda _: family(here, there), spoilt, False)
    assert found.count(PathEnd.FAILED) == 1
    assert found.count(PathEnd.REGULAR) == 39


def test_the_start_system_is_solved_by_40():
    kept = start_system()
    for x in kept.x:
        assert np.abs(left_sides(*kept[:3], x)).max() < 1e-13
    apart = distances(kept.x, kept.x) + np.eye(40)
    assert apart.shape == (40, 40)
    assert apart.min() > 1e-2
    assert np.abs((kept.x[:, :4] ** 2).sum(axis=1)).min() > 1e-5
