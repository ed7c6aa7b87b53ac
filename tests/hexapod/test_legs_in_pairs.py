"""Platforms whose six legs meet in pairs in three points of the platform ("6-3"), as Merlet's TSSM: all their modes."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from test_hexapod import assert_modes, pose, reach

from cinegen.hexapod import Hexapod

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


@given(seeds)
def test_every_mode_is_a_placement_with_these_lengths_and_the_pose_that_they_come_from_is_one(rng):
    height = rng.choice([0.0, 0.5])
    base, corners = rng.normal(size=(6, 3)) * [1.0, 1.0, height], rng.normal(size=(3, 3))
    platform, start = corners[rng.permutation(PAIRS)], pose(rng, rng.choice([0.1, 1.0, 5.0]))
    lengths = np.array(reach(base, platform, start))
    modes = Hexapod(base, platform).modes(lengths)
    assert modes.complete, modes.method
    assert (modes.counts.total, modes.counts.lost) == (16, 0)
    near = np.abs(modes.placements - start).max(axis=(1, 2)).argmin()
    assert np.abs(modes.placements[near] - start).max() <= (1e-5 if modes.coincident[near] == 1 else 1e-3)
    assert_modes(base, platform, lengths, modes)


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


@pytest.mark.parametrize("seed", [*range(20), *WHERE_A_CIRCLE_IS_SMALL, *WHERE_NEWTON_IS_SLOW])
def test_no_flat_pose_is_missed(seed):
    modes, far = flat_pose(np.random.default_rng(seed))
    assert far.min(initial=np.inf) <= 1e-4
    assert modes.counts.total == 16
    assert modes.counts.real >= len(modes.placements)  # where rounding decides no mode is listed twice
    if modes.complete:  # some can't be followed to where so many meet
        assert modes.coincident[far.argmin()] > 1
        assert 2 <= modes.counts.multiple <= modes.counts.real
        assert modes.counts.real >= 8


@given(seeds)
def test_two_legs_in_a_line_hold_the_platform_still(rng):
    height, placement = rng.choice([0.0, 0.5]), pose(rng, 1.0)
    base, platform = rng.normal(size=(6, 3)) * [1, 1, height], rng.normal(size=(3, 3))
    point = placement[:3, :3] @ platform[0] + placement[:3, 3]
    if height == 0.0:
        placement[2, 3] -= point[2]
        point[2] = 0.0
    base[1] = base[0] + rng.choice([-0.7, 0.3, 1.5]) * (point - base[0])
    tssm = Hexapod(base, platform[PAIRS])
    modes = tssm.modes(reach(tssm.base, tssm.platform, placement))
    near = np.abs(modes.placements - placement).max(axis=(1, 2))
    assert near.min() <= 1e-5
    if modes.complete:
        assert modes.coincident[near.argmin()] > 1
        assert 2 <= modes.counts.multiple <= modes.counts.real


# --- curves ---------------------------------------------------------------------------------------------------------


def on_line(rng, base, legs):
    """A point of the line through the base points of two legs."""
    return base[legs[0]] + rng.uniform(-1.0, 1.0) * (base[legs[1]] - base[legs[0]])


def about(line, points, angle):
    """Points turned about the line through two points."""
    axis = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    return (points - line[0]) @ pin.exp3(angle * axis).T + line[0]


def two_points_on_the_third_axis(rng, base, heads):
    """The platform turns about the line through base points 5 and 6, on which two of its points are."""
    heads[0], heads[1] = on_line(rng, base, (4, 5)), on_line(rng, base, (4, 5))
    return about(base[4:], heads, 0.3)


def one_point_on_both_axes(rng, base, heads):
    """Point 1 stays where the lines of the other two pairs meet; each of the other points goes round one of these."""
    base[4] += on_line(rng, base, (0, 1)) - on_line(rng, base, (4, 5))
    rows = np.column_stack([base[1] - base[0], base[4] - base[5]])
    heads[1] = base[0] + np.linalg.lstsq(rows, base[4] - base[0], rcond=None)[0][0] * (base[1] - base[0])
    away, moved = 1e-3, heads.copy()
    moved[0] = about(base[:2], heads[:1], away)[0]
    side = np.linalg.norm(heads[0] - heads[2])
    for _ in range(60):  # Newton's method, for the angle of the third point
        gaps = [np.linalg.norm(moved[0] - about(base[4:], heads[2:], away + h)[0]) - side for h in (0.0, 1e-7)]
        away -= gaps[0] * 1e-7 / (gaps[1] - gaps[0])
    moved[2] = about(base[4:], heads[2:], away)[0]
    return moved


@pytest.mark.parametrize("height", [0.0, 0.5])
@pytest.mark.parametrize("where", [two_points_on_the_third_axis, one_point_on_both_axes])
@pytest.mark.parametrize("seed", range(2))
def test_a_curve_is_not_excluded(seed, where, height):
    """In a plane all its paths end in two points of it, whichever way they take."""
    rng = np.random.default_rng(seed)
    base, heads = rng.uniform(-1.0, 1.0, (6, 3)) * [1.0, 1.0, height], rng.uniform(-1.0, 1.0, (3, 3))
    if where is one_point_on_both_axes:
        base[[0, 1, 4, 5], 2] = 0.0  # so that their lines meet
    moved = where(rng, base, heads)
    for i, k in ((0, 1), (0, 2), (1, 2)):  # a placement of the same platform
        assert np.linalg.norm(moved[i] - moved[k]) == pytest.approx(np.linalg.norm(heads[i] - heads[k]))
    lengths = np.linalg.norm(heads[PAIRS] - base, axis=1)
    np.testing.assert_allclose(np.linalg.norm(moved[PAIRS] - base, axis=1), lengths, atol=1e-9)
    assert np.abs(moved - heads).max() > 1e-5
    modes = Hexapod(base, heads[PAIRS]).modes(lengths)
    assert not modes.complete
    assert modes.counts.lost or "a curve" in modes.method
