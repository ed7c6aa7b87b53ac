"""Table 2 of the paper: poses that satisfy a row are singular, for the reason that it gives; others are not."""

import math

import numpy as np
import pytest
import varieties
from hypothesis import given, settings
from hypothesis import strategies as st
from line_geometry import distance, mutual_moment, transversals
from scipy.spatial.transform import Rotation
from table2 import COORDINATES, ROWS, Geometry, concurrency

from cinegen.singularities.grassmann import classify
from cinegen.singularities.pluecker import LineAtInfinity, PlueckerLine

# The paper's example (J-P. Merlet, "Symbolic computation for the determination of the minimal direct kinematics
# polynomial and the singular configurations of parallel manipulators"): its geometry, identified from Table 1. With it
# all printed poses give the same six leg lengths, to the printed digits.
PAPER = Geometry(
    np.array([[-9.7, 9.1, 0], [9.7, 9.1, 0], [12.76, 3.9, 0], [3.0, -13.0, 0], [-3.0, -13.0, 0], [-12.76, 3.9, 0]]),
    np.array([[0, 7.3, 0], [4.822, -5.480722, 0], [-4.822, -5.480722, 0]]),
)
seeds = st.integers(0, 2**32 - 1)
PLANE, DEGENERATE, FIRST, SECOND, FICHTER, CUBIC, SPECIAL, HUNT, CROSSED = ROWS


def _any_tssm(rng):
    """One without symmetry, with legs in order round the base."""
    around = np.arange(6) * np.pi / 3 + rng.uniform(-0.35, 0.35, 6)
    base = rng.uniform(8.0, 14.0, 6) * np.array([np.cos(around), np.sin(around)])
    around = np.arange(3) * 2 * np.pi / 3 + rng.uniform(-0.5, 0.5, 3) + 0.5
    platform = rng.uniform(4.0, 8.0, 3) * np.array([np.cos(around), np.sin(around)])
    return Geometry(np.column_stack([*base, np.zeros(6)]), np.column_stack([*platform, np.zeros(3)]))


def _any_pose(rng):
    place = rng.uniform([-6, -6, 8], [6, 6, 25])
    return np.array([*place, rng.uniform(-3, 3), rng.choice([-1, 1]) * rng.uniform(0.2, 1.3), rng.uniform(-3, 3)])


def _robots(rng):
    return PAPER, _any_tssm(rng)


def _within_reach(row, tssm, rng):
    """A pose of a row at which the legs are not all but parallel."""
    while True:
        poses = row.complete(tssm, _any_pose(rng))
        if len(poses) and np.abs(poses[0, :3]).max() < 6.0 * tssm.length:
            return poses[0]


def _matrix(tssm, pose):
    """(6, 6) of the legs' unit vectors and moments, from the points."""
    ends = np.repeat(pose[:3] + Rotation.from_euler("ZXZ", pose[3:]).apply(tssm.platform), 2, axis=0)
    directions = ends - tssm.base
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.hstack([directions, np.cross(tssm.base, directions)])


def _lengths(tssm, position, turn):
    return np.linalg.norm(np.repeat(position + tssm.platform @ turn.T, 2, axis=0) - tssm.base, axis=1)


# --- every row --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
@pytest.mark.parametrize("seed", range(3))
def test_poses_of_a_row_are_singular_for_its_reason(row, seed):
    rng = np.random.default_rng(seed)
    for tssm in _robots(rng):
        asked = _any_pose(rng)
        poses = row.complete(tssm, asked)
        assert len(poses) >= 1  # a cubic and lines have a real solution
        for pose in poses:
            kept = [i for i, name in enumerate(COORDINATES) if name not in row.determined]
            assert pose[kept].tolist() == asked[kept].tolist()
            assert row.residual(tssm, pose) < 1e-9
            assert np.linalg.svd(_matrix(tssm, pose))[1][-1] < 1e-10
            dependence = classify(tssm.lines(pose), tssm.length)
            assert dependence.grassmann_class is row.grassmann_class
            assert [tuple(i + 1 for i in some.lines) for some in dependence.sets] == [row.legs]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_a_pose_beside_a_row_is_not_in_it(row):
    rng = np.random.default_rng(50)
    for tssm in _robots(rng):
        pose = _within_reach(row, tssm, rng)
        for name in row.determined:
            beside = pose.copy()
            beside[COORDINATES.index(name)] += 1e-3 * (tssm.length if name in COORDINATES[:3] else 1.0)
            if name != "phi" or row is not FICHTER:
                assert row.residual(tssm, beside) > 1e-8
            dependence = classify(tssm.lines(beside), tssm.length)
            reason = row.grassmann_class, tuple(i - 1 for i in row.legs)
            assert dependence is None or (dependence.grassmann_class, dependence.lines) != reason


# --- all singularities ------------------------------------------------------------------------------------------------


@given(seeds)
@settings(max_examples=50)
def test_concurrent_planes_are_the_determinant(seed):
    """F is minus the determinant of the unit Pluecker vectors times all leg lengths."""
    rng = np.random.default_rng(seed)
    tssm, pose = _any_tssm(rng), _any_pose(rng)
    corners = tssm.corners(pose)
    normals = np.cross(tssm.base[::2] - corners, tssm.base[1::2] - corners)
    sides = np.roll(corners, -1, axis=0) - corners
    size = np.linalg.norm(normals, axis=1).prod() * np.linalg.norm(sides, axis=1).prod()
    turn = Rotation.from_euler("ZXZ", pose[3:]).as_matrix()
    determinant = np.linalg.det(_matrix(tssm, pose)) * _lengths(tssm, pose[:3], turn).prod()
    assert -concurrency(tssm, pose) == pytest.approx(determinant / size, abs=1e-12)


# --- what the rows say of themselves ----------------------------------------------------------------------------------


def test_heights_are_all_those_at_which_the_determinant_changes_its_sign():
    rng = np.random.default_rng(0)
    for tssm in _robots(rng):
        asked = _any_pose(rng)
        roots = np.sort(CUBIC.complete(tssm, asked)[:, 2])
        heights = np.linspace(-120.0, 120.0, 2401)
        signs = []
        for z in heights:
            asked[2] = z
            signs.append(concurrency(tssm, asked) > 0.0)
        crossed = np.flatnonzero(np.diff(signs))
        inside = roots[np.abs(roots) < 120.0]
        assert len(crossed) == len(inside)
        assert all(heights[i] <= z <= heights[i + 1] for i, z in zip(crossed, inside, strict=True))


# --- coplanar legs, and errors ----------------------------------------------------------------------------------------


def test_rows_without_a_solution_have_no_poses():
    level = np.array([1.0, 2.0, 20.0, 0.3, 0.0, 0.2])  # a platform parallel to the base holds no point of it
    assert SECOND.complete(PAPER, level).shape == (0, 6)


# --- line geometry ----------------------------------------------------------------------------------------------------
# Elementary geometry of lines against points and planes, computed without moments.


def _random(rng):
    return PlueckerLine.through(*rng.normal(size=(2, 3)))


def _closest(p, d, q, e):
    """The points of two lines that are nearest to each other, by least squares over both parameters."""
    s, t = np.linalg.lstsq(np.column_stack([d, -e]), q - p, rcond=None)[0]
    return p + s * d, q + t * e


def _apart(a, b):
    p, q = _closest(a.point, a.direction, b.point, b.direction)
    return np.linalg.norm(p - q)


# --- two lines --------------------------------------------------------------------------------------------------------


@given(seeds)
def test_the_mutual_moment_is_distance_times_sine(seed):
    rng = np.random.default_rng(seed)
    a, b = _random(rng), _random(rng)
    sine = math.sin(math.acos(min(1.0, abs(a.direction @ b.direction))))
    assert abs(mutual_moment(a, b)) == pytest.approx(_apart(a, b) * sine, abs=1e-7)
    assert mutual_moment(a, b) == pytest.approx(mutual_moment(b, a))
    assert distance(a, b) == pytest.approx(_apart(a, b), abs=1e-9)


# --- several lines ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("maker", "count"), [
    (varieties.hyperbolic, 2),
    (varieties.hyperbolic_one_far, 2),
    (varieties.parabolic, 1),
    (varieties.parabolic_far, 1),
    (varieties.elliptic, 0),
])  # fmt: skip
def test_four_lines_of_a_congruence_are_met_by_its_directors(maker, count, seed):
    variety = varieties.placed(maker, np.random.default_rng(seed), others=0)
    across = transversals(variety.lines[:4], variety.length)
    assert not across.infinitely_many
    assert len(across.lines) == count
    for line in across.lines:
        if isinstance(line, LineAtInfinity):
            assert abs(line.normal @ variety.turn @ variety.built.normals[0]) == pytest.approx(1.0)
        else:
            slack = (1e-8 if count == 2 else 1e-6) * variety.length  # a double root is half as accurate
            assert min(_apart(line, variety.line(ends)) for ends in variety.built.directors) < slack
            assert all(_apart(line, other) < slack for other in variety.lines[:4])
