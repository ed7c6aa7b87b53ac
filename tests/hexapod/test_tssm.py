"""`TSSM`: its modes, what is said of them, and what is refused."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cinegen.errors import CinegenError
from cinegen.hexapod import TSSM, HexapodError
from cinegen.hexapod.tssm_geometry import PlatformCircles

# J-P. Merlet, "Symbolic computation for the determination of the minimal direct kinematics polynomial and the singular
# configurations of parallel manipulators", table 1: x0, y0, z0, psi, theta, phi of 8 of 16 modes. The geometry is not
# printed: it was identified from that table. With it, all eight poses give the same six leg lengths to 1e-4, the
# printed digits (psi of row 1 is printed 178.79; 178.78996 fits). R = Rz(psi) Rx(theta) Rz(phi), degrees.
BASE = [[-9.7, 9.1, 0], [9.7, 9.1, 0], [12.76, 3.9, 0], [3.0, -13.0, 0], [-3.0, -13.0, 0], [-12.76, 3.9, 0]]
PLATFORM = [[0, 7.3, 0], [4.822, -5.480722, 0], [-4.822, -5.480722, 0]]
NOMINAL = [0.0, 0.0, 20.0, -10.0, -5.0, 10.0]
TABLE_1 = [
    [0.1099, -6.8071, 15.1572, 178.79, 104.2473, -179.39757], [0.0, 0.0, 20.0, 170.000, 4.9999, -170.0],
    [2.8029, -4.6660, 12.7407, 55.3895, 89.1782, 136.1996], [1.3617, 4.9038, 17.3824, -106.3317, 149.9318, 58.9676],
    [0.1606, 5.3765, 17.1868, -170.3808, 164.0139, 7.9545], [-0.3525, -3.8663, 11.9183, -12.5596, 45.1107, -168.3013],
    [-1.4134, 4.8262, 17.4299, 102.6405, 147.3844, -61.9768], [-2.3355, -4.4679, 12.5479, -50.8490, 79.0396, -137.3533],
]  # fmt: skip

seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def euler(x, y, z, *angles):
    (a, d), (b, e), (c, f) = ((np.cos(t), np.sin(t)) for t in np.radians(angles))
    placement = np.eye(4)
    about_z, about_x = np.array([[a, -d, 0], [d, a, 0], [0, 0, 1]]), np.array([[1, 0, 0], [0, b, -e], [0, e, b]])
    placement[:3, :3] = about_z @ about_x @ np.array([[c, -f, 0], [f, c, 0], [0, 0, 1]])
    placement[:3, 3] = x, y, z
    return placement


def mirrored(placement, platform):
    """The pose whose platform points are mirror images; a triangle has one."""
    flip = np.diag([1.0, 1.0, -1.0])
    vt = np.linalg.svd(platform - platform.mean(axis=0))[2]
    across = np.eye(3) - 2.0 * np.outer(vt[2], vt[2])  # in the platform: points go to themselves, about their middle
    there = np.eye(4)
    there[:3, :3] = flip @ placement[:3, :3] @ across
    middle = platform.mean(axis=0)
    there[:3, 3] = flip @ (placement[:3, :3] @ middle + placement[:3, 3]) - there[:3, :3] @ middle
    return there


def pose(rng, far=1.0):
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    placement = np.eye(4)
    placement[:3, :3], placement[:3, 3] = q * np.linalg.det(q), far * rng.normal(size=3)
    return placement


def some(rng, height=None):
    height = rng.choice([0.0, 0.5]) if height is None else height
    base = rng.normal(size=(6, 3)) * [1.0, 1.0, height]
    return TSSM(base, rng.normal(size=(3, 3)), rng.permutation([0, 0, 1, 1, 2, 2]))


def lengths_at(tssm, placement):
    """Written out again."""
    return [
        np.linalg.norm(placement[:3, :3] @ tssm.platform[point] + placement[:3, 3] - tssm.base[leg])
        for leg, point in enumerate(tssm.legs)
    ]


# --- which modes ----------------------------------------------------------------------------------------------------


def test_table_1_and_its_mirror_images_are_all_modes():
    tssm = TSSM(BASE, PLATFORM)
    modes = tssm.modes(lengths_at(tssm, euler(*NOMINAL)))
    printed = [euler(*row) for row in TABLE_1]
    expected = np.array(printed + [mirrored(placement, tssm.platform) for placement in printed])
    assert len(modes.placements) == modes.counts.real == 16
    assert modes.complete
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
    tssm, start = some(rng), pose(rng, rng.choice([0.1, 1.0, 5.0]))
    lengths = np.array(lengths_at(tssm, start))
    modes = tssm.modes(lengths)
    assert modes.complete, modes.method
    assert (modes.counts.total, modes.counts.lost) == (16, 0)
    near = np.abs(modes.placements - start).max(axis=(1, 2)).argmin()
    assert np.abs(modes.placements[near] - start).max() <= (1e-5 if modes.coincident[near] == 1 else 1e-3)
    for placement in modes.placements:
        rotation = placement[:3, :3]
        assert np.abs(rotation.T @ rotation - np.eye(3)).max() <= 1e-13
        assert np.linalg.det(rotation) > 0.0
        assert placement[3].tolist() == [0.0, 0.0, 0.0, 1.0]
        assert np.abs(lengths_at(tssm, placement) - lengths).max() <= 1e-12 * lengths.max()


@given(seeds)
def test_modes_do_not_depend_on_frames_units_or_the_order_of_legs(rng):
    tssm, there, own, unit = some(rng), pose(rng), pose(rng), 10.0 ** rng.uniform(-3, 3)
    lengths = np.array(lengths_at(tssm, pose(rng)))
    modes = tssm.modes(lengths)
    order = rng.permutation(6)
    base = unit * (tssm.base @ there[:3, :3].T + there[:3, 3])[order]
    platform = unit * (tssm.platform @ own[:3, :3].T + own[:3, 3])
    other = TSSM(base, platform, tssm.legs[order]).modes(unit * lengths[order])
    assert (other.complete, other.counts.real) == (modes.complete, modes.counts.real)
    scaled = other.placements.copy()
    scaled[:, :3, 3] /= unit
    back = np.linalg.inv(there) @ scaled @ own
    assert len(back) == len(modes.placements)
    for placement, together in zip(modes.placements, modes.coincident, strict=True):
        assert np.abs(back - placement).max(axis=(1, 2)).min() <= (1e-6 if together == 1 else 1e-3)


# --- multiple ones --------------------------------------------------------------------------------------------------


def flat_pose(rng):
    """The modes at a pose in the base's plane, and how far each is from that pose."""
    tssm = TSSM(rng.normal(size=(6, 3)) * [1, 1, 0], rng.normal(size=(3, 3)) * [1, 1, 0])
    placement = euler(*rng.normal(size=2), 0.0, rng.uniform(0.0, 360.0), 0.0, 0.0)
    modes = tssm.modes(lengths_at(tssm, placement))
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
    height, placement = rng.choice([0.0, 0.5]), pose(rng)
    base, platform = rng.normal(size=(6, 3)) * [1, 1, height], rng.normal(size=(3, 3))
    point = placement[:3, :3] @ platform[0] + placement[:3, 3]
    if height == 0.0:
        placement[2, 3] -= point[2]
        point[2] = 0.0
    base[1] = base[0] + rng.choice([-0.7, 0.3, 1.5]) * (point - base[0])
    tssm = TSSM(base, platform)
    modes = tssm.modes(lengths_at(tssm, placement))
    near = np.abs(modes.placements - placement).max(axis=(1, 2))
    assert near.min() <= 1e-5
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
def test_a_curve_on_which_an_angle_stays_is_not_excluded(seed, where, height):
    """The determinant need not vanish for it: the other angles vary, the eliminated one does not."""
    rng = np.random.default_rng(seed)
    base, heads = rng.uniform(-1.0, 1.0, (6, 3)) * [1.0, 1.0, height], rng.uniform(-1.0, 1.0, (3, 3))
    if where is one_point_on_both_axes:
        base[[0, 1, 4, 5], 2] = 0.0  # so that their lines meet
    moved = where(rng, base, heads)
    legs = [0, 0, 1, 1, 2, 2]
    for one, two in ((0, 1), (0, 2), (1, 2)):  # a placement of the same platform
        assert np.linalg.norm(moved[one] - moved[two]) == pytest.approx(np.linalg.norm(heads[one] - heads[two]))
    lengths = np.linalg.norm(heads[legs] - base, axis=1)
    np.testing.assert_allclose(np.linalg.norm(moved[legs] - base, axis=1), lengths, atol=1e-9)
    assert np.abs(moved - heads).max() > 1e-5
    modes = TSSM(base, heads, legs).modes(lengths)
    assert not modes.complete
    assert "a curve" in modes.method


# --- none -----------------------------------------------------------------------------------------------------------


def test_legs_that_can_not_meet_are_named():
    tssm = TSSM(BASE, PLATFORM)
    modes = tssm.modes([1.0, 31.0, 30, 30, 30, 30])
    assert modes.complete
    assert modes.placements.shape == (0, 4, 4)
    assert modes.method == "legs 1 and 2 (1 and 31) can't meet, as their base points are 19.4 apart, 10.6 too near"
    short = tssm.modes([30, 30, 5.0, 6.0, 30, 30])
    apart = np.hypot(12.76 - 3.0, 3.9 + 13.0)
    assert short.method.endswith(f"apart, {apart - 11.0:.3g} too far")


@settings(max_examples=15)
@given(seeds)
def test_the_closest_approach_is_a_minimum(rng):
    tssm = some(rng)
    lengths = np.array(lengths_at(tssm, pose(rng))) * rng.choice([0.5, 1.0, 2.0], size=6)
    modes = tssm.modes(lengths)
    assert (modes.closest is not None) == (modes.complete and not len(modes.placements))
    if modes.closest is None:
        return
    here = modes.closest.placement
    np.testing.assert_allclose(modes.closest.errors, lengths_at(tssm, here) - lengths, atol=1e-12 * lengths.max())
    least = np.linalg.norm(modes.closest.errors)
    assert least > 1e-7 * lengths.max()
    for size in (1e-2, 1e-1, 1.0):
        for _ in range(10):
            turn = np.linalg.qr(np.eye(3) + 0.3 * size * rng.normal(size=(3, 3)))
            there = here.copy()
            there[:3, :3] = turn[0] * np.sign(np.diag(turn[1])) @ here[:3, :3]
            there[:3, 3] += size * lengths.mean() * rng.normal(size=3)
            assert np.linalg.norm(lengths_at(tssm, there) - lengths) >= least * (1.0 - 1e-4)


# --- many, and for study --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("height", [0.0, 0.5])
def test_a_batch_says_what_modes_says(height):
    rng = np.random.default_rng(3)
    tssm = some(rng, height)
    lengths = np.array([lengths_at(tssm, pose(rng)) for _ in range(40)])
    lengths[7, 0] += 100.0
    placements, counts = tssm.batch(np.asfortranarray(lengths))
    for row, found, count in zip(lengths, placements, counts, strict=True):
        modes = tssm.modes(row)
        assert count == len(modes.placements)
        np.testing.assert_array_equal(found[:count], modes.placements)
        assert np.isnan(found[count:]).all()
    assert counts[7] == 0
    assert tssm.batch(np.empty((0, 6)))[0].shape == (0, 16, 4, 4)


@given(seeds)
def test_all_complex_solutions_solve_the_equations(rng):
    tssm = some(rng)
    counts, w = tssm.modes(lengths := lengths_at(tssm, pose(rng))).counts, tssm.complex_solutions(lengths)
    circles = PlatformCircles(*(part[0] for part in tssm.circles([lengths])[0]))
    c, s = 0.5 * (w + 1.0 / w), -0.5j * (w - 1.0 / w)
    points = circles.centre + circles.radius[:, None] * (c[..., None] * circles.e + s[..., None] * circles.f)
    assert len(points) >= (counts.real + counts.complex) / (2 if tssm.plane else 1) - 1
    for i, j in ((0, 1), (0, 2), (1, 2)):
        side = tssm.sides[circles.point[i] + circles.point[j] - 1]
        off = ((points[:, i] - points[:, j]) ** 2).sum(axis=1) - side**2
        size = (np.abs(points[:, i] - points[:, j]) ** 2).sum(axis=1) + side**2
        assert (np.abs(off) <= 1e-9 * size * (1.0 + np.abs(points).max(axis=(1, 2)))).all()


def test_eigenvalues_of_one_set_that_do_not_converge_leave_other_sets_alone(monkeypatch):
    rng = np.random.default_rng(6)
    tssm = some(rng, 0.5)
    lengths = np.array(lengths_at(tssm, pose(rng))) * [[1.0], [1.01], [1.02]]
    whole, numbers = tssm.batch(lengths)
    eigvals, seen = np.linalg.eigvals, []

    def record(matrices):
        seen.append(matrices)
        return eigvals(matrices)

    def diverge(matrices):
        if len(matrices) > 1 or np.allclose(matrices, seen[0]):
            raise np.linalg.LinAlgError("Eigenvalues did not converge")
        return eigvals(matrices)

    monkeypatch.setattr(np.linalg, "eigvals", record)
    tssm.modes(lengths[1])
    monkeypatch.setattr(np.linalg, "eigvals", diverge)
    found, rest = tssm.batch(lengths)
    np.testing.assert_array_equal(rest, [numbers[0], -1, numbers[2]])
    np.testing.assert_array_equal(found[[0, 2]], whole[[0, 2]])
    assert np.isnan(found[1]).all()
    alone = tssm.modes(lengths[1])
    assert not alone.complete
    assert alone.method == "the eigenvalues did not converge"
    assert alone.counts.lost == alone.counts.total == 16


# --- what is refused ------------------------------------------------------------------------------------------------

GOOD = np.array(BASE, dtype=float), np.array(PLATFORM, dtype=float)


def changed(points, row, value):
    points = points.copy()
    points[row] = value
    return points


@pytest.mark.parametrize(("base", "platform", "legs", "words"), [
    (GOOD[0][:5], GOOD[1], None, r"the base must be \(6, 3\)"),
    (changed(GOOD[0], 2, np.nan), GOOD[1], None, "a point of the base is not finite"),
    (GOOD[0], changed(GOOD[1], 2, GOOD[1][0]), None, "platform points 0 and 2 are the same"),
    (GOOD[0], [[0, 0, 0], [1, 1, 1], [3, 3, 3]], None, "the platform points lie in a line"),
    (changed(GOOD[0], 1, GOOD[0][0]), GOOD[1], None, "legs 1 and 2, both to platform point 0, begin at the same"),
    (np.outer(range(6), [1, 2, 3]), GOOD[1], None, "the base points lie in a line"),
    (*GOOD, [0, 0, 0, 1, 1, 2], "0, 1 and 2 twice each"),
    (*GOOD, [0, 1, 2], "the platform point of each of six"),
])  # fmt: skip
def test_degenerate_geometry_is_named(base, platform, legs, words):
    with pytest.raises(HexapodError, match=words) as error:
        TSSM(base, platform) if legs is None else TSSM(base, platform, legs)
    assert isinstance(error.value, CinegenError)


@pytest.mark.parametrize(("lengths", "words"), [
    ([1, 2, 3], r"lengths must be \(6,\), one for each leg, not \(3,\)"),
    ([1, 2, 3, 4, 5, 0], "the length of leg 6 is 0; it must be positive"),
    ([1, 2, np.inf, 4, 5, 6], "the length of leg 3 is inf"),
])  # fmt: skip
def test_lengths_that_are_none_are_refused(lengths, words):
    tssm = TSSM(*GOOD)
    with pytest.raises(HexapodError, match=words):
        tssm.modes(lengths)
    with pytest.raises(HexapodError):
        tssm.batch([lengths])
    with pytest.raises(HexapodError):
        tssm.circles([lengths])
