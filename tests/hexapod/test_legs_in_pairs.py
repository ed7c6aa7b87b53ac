"""Platforms whose six legs meet in pairs in three points of the platform ("6-3"), as Merlet's TSSM: all their modes."""

import numpy as np
import pinocchio as pin
import pytest
from hexapod_start import find
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from test_hexapod import reach

from cinegen.hexapod import Hexapod
from cinegen.hexapod.paths import PathEnd, follow_surely
from cinegen.hexapod.study import coefficients, distances, family, lengths_at, placements, residual, start_system

# J-P. Merlet, "Symbolic computation for the determination of the minimal direct kinematics polynomial and the singular
# configurations of parallel manipulators", table 1: x0, y0, z0, psi, theta, phi of 8 of 16 modes. The geometry is not
# printed: it was identified from that table. With it, all eight poses give the same six leg lengths to 1e-4, the
# printed digits (psi of row 1 is printed 178.79; 178.78996 fits). R = Rz(psi) Rx(theta) Rz(phi), degrees.
BASE = [[-9.7, 9.1, 0], [9.7, 9.1, 0], [12.76, 3.9, 0], [3.0, -13.0, 0], [-3.0, -13.0, 0], [-12.76, 3.9, 0]]
CORNERS = np.array([[0, 7.3, 0], [4.822, -5.480722, 0], [-4.822, -5.480722, 0]])
PAIRS = [0, 0, 1, 1, 2, 2]
NOMINAL = [0.0, 0.0, 20.0, -10.0, -5.0, 10.0]
TABLE_1 = [
    [0.1099, -6.8071, 15.1572, 178.79, 104.2473, -179.39757], [0.0, 0.0, 20.0, 170.000, 4.9999, -170.0],
    [2.8029, -4.6660, 12.7407, 55.3895, 89.1782, 136.1996], [1.3617, 4.9038, 17.3824, -106.3317, 149.9318, 58.9676],
    [0.1606, 5.3765, 17.1868, -170.3808, 164.0139, 7.9545], [-0.3525, -3.8663, 11.9183, -12.5596, 45.1107, -168.3013],
    [-1.4134, 4.8262, 17.4299, 102.6405, 147.3844, -61.9768], [-2.3355, -4.4679, 12.5479, -50.8490, 79.0396, -137.3533],
]  # fmt: skip

seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def euler(x, y, z, *angles):
    rotation = Rotation.from_euler("ZXZ", angles, degrees=True).as_matrix()
    return pin.SE3(rotation, np.array([x, y, z], dtype=float)).homogeneous


def mirrored(placement, platform):
    """The pose whose platform points are mirror images; a triangle has one."""
    flip = np.diag([1.0, 1.0, -1.0])
    vt = np.linalg.svd(platform - platform.mean(axis=0))[2]
    across = np.eye(3) - 2.0 * np.outer(vt[2], vt[2])  # in the platform: points go to themselves, about their middle
    image = np.eye(4)
    image[:3, :3] = flip @ placement[:3, :3] @ across
    middle = platform.mean(axis=0)
    image[:3, 3] = flip @ (placement[:3, :3] @ middle + placement[:3, 3]) - image[:3, :3] @ middle
    return image


# --- which modes ----------------------------------------------------------------------------------------------------


def test_table_1_and_its_mirror_images_are_all_modes():
    tssm = Hexapod(BASE, CORNERS[PAIRS])
    modes = tssm.modes(reach(tssm.base, tssm.platform, euler(*NOMINAL)))
    printed = [euler(*row) for row in TABLE_1]
    expected = np.array(printed + [mirrored(placement, CORNERS) for placement in printed])
    assert len(modes.placements) == modes.counts.real == 16
    assert modes.proved  # as many as the theorem allows
    left = list(range(16))
    for placement in expected:
        near = [i for i in left if np.abs(modes.placements[i, :3, 3] - placement[:3, 3]).max() <= 1e-4]
        turn = [np.trace(modes.placements[i, :3, :3].T @ placement[:3, :3]) for i in near]
        apart = np.degrees(2.0 * np.arcsin(np.sqrt(np.clip(3.0 - np.array(turn), 0.0, None)) / 2.0))
        assert apart.min() <= 3e-4
        left.remove(near[int(apart.argmin())])
    assert not left


# --- multiple ones --------------------------------------------------------------------------------------------------


def flat_pose(rng):
    """The modes at a pose in the base's plane, and how far each is from that pose."""
    tssm = Hexapod(rng.normal(size=(6, 3)) * [1, 1, 0], (rng.normal(size=(3, 3)) * [1, 1, 0])[PAIRS])
    placement = euler(*rng.normal(size=2), 0.0, rng.uniform(0.0, 360.0), 0.0, 0.0)
    modes = tssm.modes(reach(tssm.base, tssm.platform, placement))
    return modes, np.abs(modes.placements - placement).max(axis=(1, 2), initial=0.0)


WHERE_A_CIRCLE_IS_SMALL = (1803, 2268, 2852, 5547, 7082, 7092, 9412, 9475, 10950, 11972, 13179, 17339, 19276, 23726)
"""Seeds of flat poses at which rounding of the lengths makes the roots of a small circle complex."""

WHERE_NEWTON_IS_SLOW = (1841, 2834, 2989, 3551, 5367, 6379, 13196)


@pytest.mark.parametrize("seed", [*range(5), *WHERE_A_CIRCLE_IS_SMALL, *WHERE_NEWTON_IS_SLOW])
def test_no_flat_pose_is_missed(seed):
    modes, far = flat_pose(np.random.default_rng(seed))
    assert far.min(initial=np.inf) <= 1e-4
    assert modes.counts.total == 16
    assert modes.counts.real >= len(modes.placements)  # where rounding decides no mode is listed twice
    if modes.complete:  # some can't be followed to where so many meet
        assert modes.coincident[far.argmin()] > 1
        assert 2 <= modes.counts.multiple <= modes.counts.real
        assert modes.counts.real >= 8


# --- curves ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("height", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(2))
def test_a_curve_is_not_excluded(seed, height):
    """The platform turns about the line through base points 5 and 6, on which two of its points are. In a plane all
    paths of this curve end in two points of it, whichever way they take."""
    rng = np.random.default_rng(seed)
    base, heads = rng.uniform(-1.0, 1.0, (6, 3)) * [1.0, 1.0, height], rng.uniform(-1.0, 1.0, (3, 3))
    heads[:2] = base[4] + rng.uniform(-1.0, 1.0, (2, 1)) * (base[5] - base[4])
    modes = Hexapod(base, heads[PAIRS]).modes(np.linalg.norm(heads[PAIRS] - base, axis=1))
    assert not modes.complete
    assert modes.counts.lost or "a curve" in modes.method


# --- equations and paths ----------------------------------------------------------------------------------------------
# What hexapods are solved by: their equations, and paths of solutions, against plain numpy and closed forms.


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
