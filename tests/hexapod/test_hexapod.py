"""Assembly modes of a Gough platform: legs are as long as asked, all modes are there, and the account is true."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from cinegen.hexapod import Hexapod, HexapodError
from cinegen.hexapod.legs import leg_lengths, refine
from cinegen.hexapod.paths import PathEnd

# P. Dietmaier, "The Stewart-Gough platform of general geometry can have 40 real postures", in: Advances in Robot
# Kinematics: Analysis and Control, 1998
DIETMAIER_BASE = [
    [0, 0, 0], [1.107915, 0, 0], [0.549094, 0.756063, 0],
    [0.735077, -0.223935, 0.525991], [0.514188, -0.526063, -0.368418], [0.590473, 0.094733, -0.205018],
]  # fmt: skip
DIETMAIER_PLATFORM = [
    [0, 0, 0], [0.542805, 0, 0], [0.956919, -0.528915, 0],
    [0.665885, -0.353482, 1.402538], [0.478359, 1.158742, 0.107672], [-0.137087, -0.235121, 0.353913],
]  # fmt: skip
DIETMAIER_LENGTHS = [1, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071]


def rotation(q):
    """Of a quaternion of any norm, its scalar first."""
    return Rotation.from_quat(q, scalar_first=True).as_matrix()


def pose(rng, far=2.0):
    placement = np.eye(4)
    placement[:3, :3], placement[:3, 3] = rotation(rng.normal(size=4)), far * rng.normal(size=3)
    return placement


def reach(base, platform, placement):
    """The six lengths, leg after leg."""
    ends = np.asarray(platform) @ placement[:3, :3].T + placement[:3, 3]
    return np.linalg.norm(ends - base, axis=1)


def circle(degrees, radius):
    angles = np.radians(degrees)
    return radius * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])


def points(rng, kind):
    base, platform = rng.normal(size=(2, 6, 3))
    if "B" in kind:
        base[:, 2] = 0.0
    if "P" in kind:
        platform[:, 2] = 0.0
    if "6-3" in kind:
        platform = platform[[0, 0, 1, 1, 2, 2]]
    return base, platform


def assert_modes(base, platform, lengths, modes):
    """They reach, are rigid and apart."""
    for placement in modes.placements:
        np.testing.assert_allclose(reach(base, platform, placement), lengths, rtol=0, atol=1e-12 * np.max(lengths))
        np.testing.assert_allclose(placement[:3, :3] @ placement[:3, :3].T, np.eye(3), atol=1e-13)
        assert np.linalg.det(placement[:3, :3]) > 0
        np.testing.assert_array_equal(placement[3], [0, 0, 0, 1])
    for i, placement in enumerate(modes.placements):
        for other in modes.placements[:i]:
            assert np.abs(placement - other).max() > 1e-7 * np.max(lengths)


def assert_among(placement, modes, within=1e-8):
    assert np.abs(modes.placements - placement).max(axis=(1, 2)).min() < within


@settings(max_examples=36)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["", "B", "P", "BP", "6-3", "6-3 B"]))
def test_a_general_platform_has_40_modes_and_a_triangle_16_an_even_number_of_them_real(seed, kind):
    rng = np.random.default_rng(seed)
    base, platform = points(rng, kind)
    placement = pose(rng)
    hexapod = Hexapod(base, platform)
    lengths = reach(base, platform, placement)
    modes = hexapod.modes(lengths)
    assert hexapod.degree == (16 if "6-3" in kind else 40)
    assert modes.complete
    assert modes.proved  # as many as the theorem allows
    assert repr(modes).endswith("proved to be all>")
    assert modes.counts.real + modes.counts.complex == hexapod.degree
    assert (modes.counts.infinite, modes.counts.multiple, modes.counts.lost) == (0, 0, 0)
    assert len(modes.placements) == modes.counts.real
    assert modes.counts.real % 2 == 0
    assert (modes.coincident == 1).all()
    assert_modes(base, platform, lengths, modes)
    assert_among(placement, modes)
    assert f"{hexapod.degree} of {hexapod.degree} distinct regular solutions" in modes.method


def test_dietmaiers_platform_has_40_real_modes():
    modes = Hexapod(DIETMAIER_BASE, DIETMAIER_PLATFORM).modes(DIETMAIER_LENGTHS)
    assert modes.complete
    assert (modes.counts.real, len(modes.placements)) == (40, 40)
    assert_modes(DIETMAIER_BASE, DIETMAIER_PLATFORM, DIETMAIER_LENGTHS, modes)


@pytest.mark.parametrize(("base", "platform", "degree"), [
    # legs that meet in pairs at both ends: an octahedron
    (circle([0, 120, 120, 240, 240, 0], 2.0), circle([60, 60, 180, 180, 300, 300], 1.0), 16),
    # semi-regular hexagons, each with three axes of symmetry
    (circle([-10, 10, 110, 130, 230, 250], 2.0), circle([-50, 50, 70, 170, 190, 290], 1.0), 28),
    # any hexagons on circles
    (circle([-10, 15, 110, 140, 230, 260], 2.0), circle([-50, 40, 70, 170, 195, 290], 1.0), 36),
])  # fmt: skip
def test_special_geometry_has_fewer_modes(base, platform, degree):
    rng = np.random.default_rng(1)
    hexapod = Hexapod(base, platform)
    assert hexapod.degree == degree
    home = np.eye(4)
    home[2, 3] = 2.0
    symmetric = reach(base, platform, home)
    for lengths in (symmetric, symmetric + 0.1 * rng.normal(size=6)):
        modes = hexapod.modes(lengths)
        assert modes.complete
        assert modes.proved == (degree == 16)  # of the others a random start has as many, no theorem
        assert repr(modes).endswith("proved to be all>" if degree == 16 else "all with probability one>")
        assert modes.counts.total == hexapod.bound == (16 if degree == 16 else 40)
        assert modes.counts.infinite >= hexapod.bound - degree
        assert_modes(base, platform, lengths, modes)
    assert_among(home, hexapod.modes(symmetric))


@settings(max_examples=3)
@given(st.integers(0, 2**32 - 1))
def test_modes_go_with_frames_and_units(seed):
    rng = np.random.default_rng(seed)
    base, platform = points(rng, "")
    lengths = reach(base, platform, pose(rng))
    modes = Hexapod(base, platform).modes(lengths)
    unit, first, second = np.exp(6.0 * rng.normal()), pose(rng, 100.0), pose(rng, 100.0)
    moved = Hexapod(
        unit * (base @ first[:3, :3].T + first[:3, 3]), unit * (platform @ second[:3, :3].T + second[:3, 3])
    ).modes(unit * lengths)
    assert moved.complete
    assert len(moved.placements) == len(modes.placements)
    back = moved.placements.copy()
    back[:, :3, 3] /= unit
    back = np.linalg.inv(first) @ back @ second
    for placement in back:
        assert_among(placement, modes, 1e-6)


# --- where modes meet -----------------------------------------------------------------------------------------------


def rates(base, platform, placement):
    """(6, 6) lengths by small motions of the platform, by central differences."""
    step, columns = 1e-6, []
    for axis in range(6):
        ends = []
        for sign in (-1.0, 1.0):
            move = np.eye(4)
            if axis < 3:
                move[axis, 3] = sign * step
            else:
                move[:3, :3] = rotation(np.concatenate([[1.0], sign * 0.5 * step * np.eye(3)[axis - 3]]))
            ends.append(reach(base, platform, placement @ move))
        columns.append((ends[1] - ends[0]) / (2.0 * step))
    return np.array(columns).T


@pytest.fixture(scope="module")
def fold():
    """A hexapod, a singular pose, and the lengths' direction that leaves what it can reach."""
    rng = np.random.default_rng(3)
    base, platform = points(rng, "")
    ends = [pose(rng, 1.0), pose(rng, 1.0)]
    quaternions = rng.normal(size=(2, 4))

    def between(x):
        placement = np.eye(4)
        placement[:3, :3] = rotation((1.0 - x) * quaternions[0] + x * quaternions[1])
        placement[:3, 3] = (1.0 - x) * ends[0][:3, 3] + x * ends[1][:3, 3]
        return placement

    def sign(x):
        return np.sign(np.linalg.det(rates(base, platform, between(x))))

    grid = np.linspace(0.0, 1.0, 50)
    signs = [sign(x) for x in grid]
    k = next(k for k in range(49) if signs[k] != signs[k + 1])
    low, high = grid[k], grid[k + 1]
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if sign(middle) == signs[k] else (low, middle)
    placement = between(low)
    return base, platform, placement, np.linalg.svd(rates(base, platform, placement))[0][:, -1]


def test_two_modes_that_meet_are_one_and_said_to_coincide(fold):
    base, platform, placement, _ = fold
    lengths = reach(base, platform, placement)
    modes = Hexapod(base, platform).modes(lengths)
    assert modes.complete
    assert modes.counts.total == 40
    assert sorted(modes.coincident)[-2:] == [1, 2]
    assert modes.coincident.sum() % 2 == 0
    assert_modes(base, platform, lengths, modes)
    double = modes.placements[np.argmax(modes.coincident)]
    np.testing.assert_allclose(double, placement, atol=1e-4)


@pytest.mark.parametrize("away", [1e-3, 1e-7])
def test_beside_a_singularity_two_modes_more_on_one_side(fold, away):
    base, platform, placement, direction = fold
    hexapod = Hexapod(base, platform)
    counts = []
    for side in (-away, away):
        lengths = reach(base, platform, placement) + side * direction
        modes = hexapod.modes(lengths)
        assert modes.complete
        assert_modes(base, platform, lengths, modes)
        counts.append(len(modes.placements))
        assert modes.coincident.sum() == len(modes.placements)
        assert counts[-1] % 2 == 0
    assert abs(counts[1] - counts[0]) == 2


def test_where_legs_let_the_platform_move_this_is_a_curve():
    # parallelograms: base and platform alike, legs of one length
    rng = np.random.default_rng(5)
    base, _ = points(rng, "")
    modes = Hexapod(base, base).modes(np.full(6, 2.0))
    assert not modes.complete
    assert "a curve of configurations" in modes.method
    assert modes.counts.total == 40
    assert_modes(base, base, np.full(6, 2.0), modes)


def test_curves_are_not_excluded_where_solutions_went_to_infinity():
    """A count of fewer isolated solutions than there are for general lengths leaves room for a curve."""
    base, platform = points(np.random.default_rng(7), "")
    hexapod = Hexapod(base, platform)
    paths, curve = hexapod._paths(np.full(6, 2.0))
    assert hexapod._account(np.full(6, 2.0), paths, curve).complete
    paths.end[:2] = PathEnd.INFINITE
    modes = hexapod._account(np.full(6, 2.0), paths, curve)
    assert not modes.complete
    assert "curves of configurations are not excluded" in modes.method


# --- what can't be ---------------------------------------------------------------------------------------------------


def test_impossible_lengths_have_no_mode_and_the_nearest_pose_is_said():
    rng = np.random.default_rng(6)
    base, platform = points(rng, "")
    lengths = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 40.0])
    modes = Hexapod(base, platform).modes(lengths)
    assert modes.complete
    assert modes.placements.shape == (0, 4, 4)
    assert modes.coincident.shape == (0,)
    assert modes.counts.complex == 40
    assert modes.closest is not None
    placement, misses = modes.closest.placement, modes.closest.errors
    np.testing.assert_allclose(reach(base, platform, placement) - lengths, misses, atol=1e-9)
    assert misses[5] < -1.0
    # a minimum: no motion makes the sum of squares smaller
    np.testing.assert_allclose(rates(base, platform, placement).T @ misses, 0.0, atol=1e-5)


RNG = np.random.default_rng(8)
ONE, OTHER = RNG.normal(size=(2, 6, 3))
LINE = np.outer([0, 1, 2, 4, 5, 7], [1.0, 2.0, -1.0])
HEXAGON = circle([-10, 10, 110, 130, 230, 250], 1.0)


@pytest.mark.parametrize(("base", "platform", "said"), [
    (ONE[:5], OTHER, r"the base must be \(6, 3\).*\(5, 3\)"),
    (ONE * np.nan, OTHER, "base is not finite"),
    (np.ones((6, 3)), OTHER, "all six points of the base are one"),
    (LINE, OTHER, "points of the base lie in a line"),
    (ONE[[0, 1, 2, 1, 4, 5]], OTHER[[0, 1, 2, 1, 4, 5]], "legs 2 and 4 are the same line"),
    (HEXAGON, 0.5 * HEXAGON, "a curve of configurations"),  # similar, on a conic
    (ONE[[0, 0, 0, 0, 4, 5]], OTHER, "a curve of configurations"),  # four legs in one point
])  # fmt: skip
def test_geometry_that_is_degenerate_is_named(base, platform, said):
    with pytest.raises(HexapodError, match=said):
        Hexapod(base, platform)


# --- hexapod special --------------------------------------------------------------------------------------------------
# Platforms on six legs of special geometry: what is called complete leaves nothing to Newton's method.


def poses(rng: Generator, count: int) -> np.ndarray:
    """(count, 4, 4) at random."""
    placements = np.tile(np.eye(4), (count, 1, 1))
    placements[:, :3, :3] = Rotation.random(count, random_state=int(rng.integers(2**31))).as_matrix()
    placements[:, :3, 3] = 1.5 * rng.normal(size=(count, 3))
    return placements


def hexagons(rng: Generator) -> np.ndarray:
    """(6, 3) of a hexagon, regular or semiregular, of a grid, in a plane, or of an octahedron."""
    angles = [np.arange(6) * np.pi / 3.0, np.repeat(np.arange(3) * 2.0 * np.pi / 3.0, 2) + np.tile([-0.3, 0.3], 3)]
    hexagons = [np.c_[np.cos(a), np.sin(a), np.zeros(6)] for a in angles]
    grid = rng.integers(-1, 2, (6, 3)).astype(float)
    flat = np.c_[rng.normal(size=(6, 2)), np.zeros(6)]
    shapes = [*hexagons, grid, flat, np.vstack([np.eye(3), -np.eye(3)]), rng.normal(size=(6, 3))]
    return shapes[rng.integers(len(shapes))]


def special_pose(rng: Generator) -> np.ndarray:
    """(4, 4): level, or rotated by a special angle about an axis, or general."""
    pose = poses(rng, 1)[0]
    if rng.random() < 0.8:
        angle = rng.choice([0.0, 0.0, 30.0, 60.0, 90.0, 180.0])
        pose[:3, :3] = Rotation.from_euler(str(rng.choice(list("xyzz"))), angle, degrees=True).as_matrix()
    if rng.random() < 0.5:
        pose[:3, 3] = [0.0, 0.0, rng.choice([0.0, 0.5, 1.0])]
    return pose


def missed(base, platform, lengths, placements, rng, starts=80) -> int:
    """How many placements Newton's method finds that are not among these."""
    refined, last = refine(base, platform, lengths, poses(rng, starts), np.zeros(starts))
    off = np.abs(leg_lengths(base, platform, refined) - lengths).max(axis=1)
    refined = refined[(off < 1e-9) & (last < 1e-6)]
    far = np.abs(refined[:, None] - placements).max(axis=(2, 3)).min(axis=1, initial=np.inf)
    return int((far > 1e-3).sum())


def six_legs(rng):
    base = hexagons(rng)
    return base, [hexagons(rng), base.copy(), 0.5 * base, base[rng.permutation(6)]][rng.integers(4)]


def pairs_of_legs(rng):
    base = hexagons(rng) if rng.random() < 0.5 else rng.integers(-2, 3, (6, 3)) * [1.0, 1.0, rng.integers(2)]
    return base, np.repeat(rng.integers(-1, 2, (3, 3)), 2, axis=0)


@pytest.mark.parametrize("kind", [six_legs, pairs_of_legs])
@pytest.mark.parametrize("seed", range(5))
def test_what_is_called_complete_has_the_pose_of_the_lengths_and_all_that_newtons_method_finds(seed, kind):
    rng = np.random.default_rng(seed)
    base, platform = kind(rng)
    try:
        hexapod = Hexapod(base, platform)
    except HexapodError:
        return
    pose = special_pose(rng)
    lengths = reach(base, platform, pose)
    is_equal = rng.random() < 0.2
    if is_equal:
        lengths = np.full(6, 1.5)
    if lengths.min() > 1e-6:
        modes = hexapod.modes(lengths)
        if modes.complete:
            assert is_equal or np.abs(modes.placements - pose).max(axis=(1, 2)).min(initial=np.inf) < 1e-3
            assert not missed(base, platform, lengths, modes.placements, rng)
