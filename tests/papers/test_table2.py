"""Table 2 of the paper: poses that satisfy a row are singular, for the reason that it gives; others are not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from table2 import COORDINATES, ROWS, Geometry, concurrency
from varieties import nearness

from cinegen.singularities.grassmann import GrassmannClass, classify

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
    ways = ends - tssm.base
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return np.hstack([ways, np.cross(tssm.base, ways)])


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
            found = classify(tssm.lines(pose), tssm.length)
            assert found.grassmann_class is row.grassmann_class
            assert [tuple(i + 1 for i in some.lines) for some in found.sets] == [row.legs]


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
            found = classify(tssm.lines(beside), tssm.length)
            assert found is None or (found.grassmann_class, found.lines) != (
                row.grassmann_class,
                tuple(i - 1 for i in row.legs),
            )


@given(seeds)
@settings(max_examples=50)
def test_poses_at_random_satisfy_no_row(seed):
    rng = np.random.default_rng(seed)
    for tssm in _robots(rng):
        pose = _any_pose(rng)
        if abs(concurrency(tssm, pose)) > 1e-5:
            assert min(row.residual(tssm, pose) for row in ROWS) > 1e-6
            assert classify(tssm.lines(pose), tssm.length) is None


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_a_row_is_asked_of_other_legs_by_renaming_them(row):
    rng = np.random.default_rng(9)
    order = [5, 4, 0, 1, 3, 2]
    renamed = PAPER.relabelled(order)
    pose = row.complete(renamed, _any_pose(rng))[0]
    found = classify(PAPER.lines(pose), PAPER.length)
    assert found.grassmann_class is row.grassmann_class
    assert found.lines == tuple(sorted(order[i - 1] for i in row.legs))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_the_platform_makes_the_gained_motion_though_the_legs_are_held(row):
    rng = np.random.default_rng(17)
    tssm = _any_tssm(rng)
    pose = row.complete(tssm, _any_pose(rng))[0]
    (screw,) = classify(tssm.lines(pose), tssm.length).uncontrolled
    w, v = screw.coordinates[:3], screw.coordinates[3:]
    turn = Rotation.from_euler("ZXZ", pose[3:]).as_matrix()
    velocity = v + np.cross(w, pose[:3])
    step = 1e-4 / max(np.linalg.norm(w), np.linalg.norm(velocity) / tssm.length)
    after, before = (
        _lengths(tssm, pose[:3] + s * velocity, Rotation.from_rotvec(s * w).as_matrix() @ turn) for s in (step, -step)
    )
    assert after == pytest.approx(before, abs=1e-7 * tssm.length)  # a motion at random changes them by 1e-4
    assert step * np.linalg.norm([*w * tssm.length, *velocity]) > 9e-5


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


def test_the_first_row_is_the_printed_one_on_the_papers_robot():
    (xa3, ya3, _), (xa4, ya4, _) = PAPER.base[2], PAPER.base[3]
    for pose in PLANE.complete(PAPER, _any_pose(np.random.default_rng(0))):
        assert np.tan(pose[3]) == pytest.approx((ya3 - ya4) / (xa3 + xa4))
        found = classify(PAPER.lines(pose), PAPER.length)
        assert found.text().startswith("legs 1, 2, 3 and 5 meet in one point")
        assert found.sets[0].points[0].xyz == pytest.approx(PAPER.corners(pose)[0])


@pytest.mark.parametrize("psi", [-1.0, 0.0, 0.5, np.pi / 2, -np.pi / 2])
def test_fichter_turns_the_papers_platform_by_a_quarter(psi):
    poses = FICHTER.complete(PAPER, np.array([1.0, 2.0, 20.0, psi, 0.7, 0.3]))
    assert sorted(np.cos(poses[:, 3] + poses[:, 5])) == pytest.approx([0.0, 0.0], abs=1e-12)
    for pose in poses:
        found = classify(PAPER.lines(pose), PAPER.length)
        assert found.grassmann_class is GrassmannClass.GENERAL_COMPLEX
        assert found.text().startswith("all six legs belong to one linear complex, of pitch ")


def test_fichters_singularity_as_printed():
    poses = [np.array([0.0, 0.0, 17.0, psi, 0.0, 0.0]) for psi in (np.pi / 2, -np.pi / 2)]
    pitches = []
    for pose in poses:
        assert FICHTER.residual(PAPER, pose) < 1e-12
        (screw,) = classify(PAPER.lines(pose), PAPER.length).uncontrolled
        assert abs(screw.pitch) > 0.1
        pitches.append(screw.pitch)
    assert pitches[0] == pytest.approx(-pitches[1])  # one pose is the other in the robot's mirror


def test_heights_are_all_those_at_which_the_determinant_changes_its_sign():
    rng = np.random.default_rng(0)
    for tssm in _robots(rng):
        asked = _any_pose(rng)
        found = np.sort(CUBIC.complete(tssm, asked)[:, 2])
        heights = np.linspace(-120.0, 120.0, 2401)
        signs = []
        for z in heights:
            asked[2] = z
            signs.append(concurrency(tssm, asked) > 0.0)
        crossed = np.flatnonzero(np.diff(signs))
        inside = found[np.abs(found) < 120.0]
        assert len(crossed) == len(inside)
        assert all(heights[i] <= z <= heights[i + 1] for i, z in zip(crossed, inside, strict=True))


def test_the_printed_side_condition_of_the_cubic_is_neither_needed_nor_enough():
    """theta = +- pi / 2 or psi = phi."""
    for pose in ([1.0, 2.0, 20.0, 0.4, np.pi / 2, 0.7], [1.0, 2.0, 20.0, 0.4, 0.3, 0.4]):
        assert nearness(PAPER.lines(pose), PAPER.length) > 1e-3
    pose = CUBIC.complete(PAPER, np.array([1.0, 2.0, 0.0, 0.4, 0.3, 0.7]))[0]
    assert nearness(PAPER.lines(pose), PAPER.length) < 1e-12


# --- coplanar legs, and errors ----------------------------------------------------------------------------------------


def test_rows_without_a_solution_have_no_poses():
    level = np.array([1.0, 2.0, 20.0, 0.3, 0.0, 0.2])  # a platform parallel to the base holds no point of it
    assert SECOND.complete(PAPER, level).shape == (0, 6)
