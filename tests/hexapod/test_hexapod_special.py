"""Platforms on six legs of special geometry: what is called complete leaves nothing to Newton's method."""

import numpy as np
import pytest
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from cinegen.hexapod import TSSM, Hexapod, HexapodError
from cinegen.hexapod.legs import leg_lengths, refine

STARTS = 80


def poses(rng: Generator, count: int) -> np.ndarray:
    """(count, 4, 4) at random."""
    found = np.tile(np.eye(4), (count, 1, 1))
    found[:, :3, :3] = Rotation.random(count, random_state=int(rng.integers(2**31))).as_matrix()
    found[:, :3, 3] = 1.5 * rng.normal(size=(count, 3))
    return found


def points(rng: Generator) -> np.ndarray:
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


def missed(base, platform, lengths, placements, rng) -> int:
    """How many placements Newton's method finds that are not among these."""
    found, last = refine(base, platform, lengths, poses(rng, STARTS), np.zeros(STARTS))
    off = np.abs(leg_lengths(base, platform, found) - lengths).max(axis=1)
    found = found[(off < 1e-9) & (last < 1e-6)]
    far = np.abs(found[:, None] - placements).max(axis=(2, 3)).min(axis=1, initial=np.inf)
    return int((far > 1e-3).sum())


@pytest.mark.parametrize("seed", range(6))
def test_six_legs(seed):
    rng = np.random.default_rng(seed)
    base = points(rng)
    platform = [points(rng), base.copy(), 0.5 * base, base[rng.permutation(6)]][rng.integers(4)]
    try:
        hexapod = Hexapod(base, platform)
    except HexapodError:
        return
    lengths = leg_lengths(base, platform, special_pose(rng)[None])[0]
    lengths = np.full(6, 1.5) if rng.random() < 0.3 else lengths
    if lengths.min() > 1e-6:
        modes = hexapod.modes(lengths)
        assert not (modes.complete and missed(base, platform, lengths, modes.placements, rng))


@pytest.mark.parametrize("seed", range(12))
def test_pairs_of_legs(seed):
    rng = np.random.default_rng(seed)
    base = points(rng) if rng.random() < 0.5 else rng.integers(-2, 3, (6, 3)) * [1.0, 1.0, rng.integers(2)]
    try:
        tssm = TSSM(base, rng.integers(-1, 2, (3, 3)).astype(float))
    except HexapodError:
        return
    pose = special_pose(rng)
    lengths = tssm.lengths(pose)
    if lengths.min() > 1e-6:
        modes = tssm.modes(lengths)
        if modes.complete:
            assert np.abs(modes.placements - pose).max(axis=(1, 2)).min(initial=np.inf) < 1e-3
            assert not missed(tssm.base, tssm.platform[tssm.legs], lengths, modes.placements, rng)
