"""The vortex method exactly as published: its weight, and its plans."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from literal_vortices import plan_literally, scissors
from vortex_field import facing

from cinegen.collision import load_scene, scene_of

X, Y, Z = np.eye(3)
angles = st.floats(-math.pi, math.pi)


def direction(angle):
    return np.array([math.cos(angle), math.sin(angle), 0.0])


def point(obstacles, radius=0.0):
    """A mobile robot."""
    document = {"name": "point", "mobile": {"radius": radius}, "safety": 0.02, "influence": 0.6}
    document |= {"start": {"point": [0.0, 0.0]}, "goal": {"point": [4.0, 0.0]}, "obstacle": obstacles}
    return scene_of(document)


@given(angles, angles, st.sampled_from([-1.0, 1.0]), st.floats(0.01, 100.0))
def test_in_the_plane_both_weights_are_one(n, alpha, sense, size):
    """With the attraction put at an angle alpha from the vortex toward the obstacle, by hand: cos v - sin n."""
    normal_ = direction(n)
    vortex = sense * np.cross(Z, normal_)
    attraction = size * (math.cos(alpha) * vortex - math.sin(alpha) * normal_)
    weight = max(0.0, math.sin(alpha))
    assert facing(attraction, normal_) == pytest.approx(weight, abs=1e-12)
    assume(abs(math.sin(alpha)) > 1e-9)
    assert scissors(attraction, 3.0 * vortex, normal_) == pytest.approx(weight, abs=1e-12)


# --- plans -------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("unhurried")
@pytest.mark.parametrize("name", ["rod", "discs"])
def test_nothing_comes_nearer_than_the_safety_distance(root, name):
    scene = load_scene(root / "robots" / "scenes" / f"{name}.toml")
    found = plan_literally(scene)
    assert len(found.path) > 10
    assert found.clearance >= scene.safety
