"""Motions between configurations of a closed mechanism, judged by the closed form of a planar 3-RPR: the determinant of
its legs' lines changes its sign where a motion passes a singularity of type 2, and only there."""

import itertools

import numpy as np
import pytest
from cusp_platform import configuration, determinant, scene

from cinegen.collision import clearance_of
from cinegen.planning.clear_motion import clear_motion

FURTHEST = 0.15  # rad and characteristic lengths: between two configurations of a motion


@pytest.fixture(scope="module")
def clearance(root):
    return clearance_of(scene(root))


def test_a_motion_ends_where_it_should_and_keeps_the_sign_of_the_determinant(clearance):
    """Also between two assembly modes: a motion never jumps from one to the other."""
    mechanism, rng = clearance.mechanism, np.random.default_rng(0)
    kept = 0
    for _ in range(400):
        pose = rng.uniform([-0.2, -0.2, -np.pi], [0.2, 0.2, np.pi])
        other = pose + rng.normal(size=3) * [0.03, 0.03, 0.4]
        begin = configuration(mechanism, pose)
        end = configuration(mechanism, other, near=begin)
        motion = clear_motion(clearance, begin, end, 0.0)
        if motion is None:
            continue
        kept += 1
        assert np.array_equal(motion[0], begin)
        assert np.array_equal(motion[-1], end)
        signs = {np.sign(determinant(mechanism, q)) for q in motion}
        assert len(signs) == 1
        assert max(mechanism.distance(a, b) for a, b in itertools.pairwise(motion)) < FURTHEST
    assert kept > 100
