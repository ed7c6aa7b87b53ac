"""What hexapods are solved by: their equations, and paths of solutions, against plain numpy and closed forms."""

import numpy as np
import pytest
from hexapod_start import find

from cinegen.hexapod.paths import PathEnd, follow_surely
from cinegen.hexapod.study import coefficients, distances, family, lengths_at, placements, residual, start_system


def random(rng, *shape):
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def product(p, q):
    """Of quaternions (4,), after Hamilton."""
    return np.concatenate([[p[0] * q[0] - p[1:] @ q[1:]], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


def left_sides(base, platform, s, x):
    """(7,) of the equations, one after the other, as they are written down."""
    c, d = x[:4], x[4:]
    values = []
    for a, b, s_i in zip(base, platform, s, strict=True):
        cb, ac = product(c, np.concatenate([[0], b])), product(np.concatenate([[0], a]), c)
        values.append(s_i * (c @ c) + d @ d + 2 * d @ (cb - ac) - 2 * ac @ cb)
    return np.array([values[0], *(np.array(values[1:]) - values[0]), c @ d])


@pytest.mark.parametrize("seed", range(2))
def test_the_equations_are_distances(seed):
    rng = np.random.default_rng(seed)
    base, platform = rng.normal(size=(2, 6, 3))
    x = rng.normal(size=8)
    x[4:] -= x[:4] * (x[:4] @ x[4:]) / (x[:4] @ x[:4])
    placement = placements(x[None])[0]
    np.testing.assert_allclose(placement[:3, :3] @ placement[:3, :3].T, np.eye(3), atol=1e-13)
    reach = np.linalg.norm(platform @ placement[:3, :3].T + placement[:3, 3] - base, axis=1)
    s = (base**2 + platform**2).sum(axis=1) - reach**2
    np.testing.assert_allclose(left_sides(base, platform, s, x), 0.0, atol=1e-11)
    np.testing.assert_allclose(lengths_at(base, platform, x), s, atol=1e-11)
    assert residual(coefficients(base, platform, s), x[None])[0] < 1e-11


def test_a_path_that_jumped_is_followed_again():
    # the first attempt is spoilt: two paths begin at one solution, as if one had jumped
    kept = start_system()
    rng = np.random.default_rng(6)
    begin, goal = (coefficients(kept.base, kept.platform, s) for s in (kept.s, kept.s + random(rng, 6)))
    spoilt = kept.x.copy()
    spoilt[1] = spoilt[0]
    ends = follow_surely(lambda _: family(begin, goal), spoilt, False)
    assert ends.count(PathEnd.FAILED) == 1
    assert ends.count(PathEnd.REGULAR) == 39


def test_the_start_system_is_solved_by_40():
    kept = start_system()
    for x in kept.x:
        assert np.abs(left_sides(*kept[:3], x)).max() < 1e-13
    apart = distances(kept.x, kept.x) + np.eye(40)
    assert apart.shape == (40, 40)
    assert apart.min() > 1e-2
    assert np.abs((kept.x[:, :4] ** 2).sum(axis=1)).min() > 1e-5


def test_the_start_system_can_be_found_again():
    again, kept = find(), start_system()
    np.testing.assert_allclose(again.s, kept.s, rtol=1e-12)
    assert distances(again.x, kept.x).min(axis=1).max() < 1e-10
    assert len(again.x) == 40
