"""Manoeuvres: against plain integration; and their checks against what is at rest, by coal in fine steps."""

import numpy as np
import pytest
from repository import load

from cinegen.collision import clearance_of, scene_of
from cinegen.model.motion_limits import motion_limits
from cinegen.planning.encounters import Encounters
from cinegen.planning.manoeuvres import Manoeuvre, ReactingJoints

DT = 1 / 240


def among(*obstacles):
    mechanism = load("planar_3r")
    document = {"safety": 0.01, "start": {}, "goal": {"point": [0.0, 0.0, 0.0]}, "obstacle": list(obstacles)}
    clearance = clearance_of(scene_of(document, mechanism=mechanism))
    joints = ReactingJoints(mechanism, clearance.links, motion_limits(mechanism).acceleration)
    joints.dt = DT
    return mechanism, clearance, joints


@pytest.mark.parametrize("seed", range(2))
def test_a_manoeuvre_is_what_its_ticks_add_up_to(seed):
    _, _, joints = among()
    rng = np.random.default_rng(seed)
    own = np.round(rng.uniform(-1.0, 1.0, 3), 2)
    one = Manoeuvre(rng.uniform(-1.0, 1.0, 3) * joints.limits, np.full(3, 48 * DT))
    whole, v, moved, speeds = one, own.copy(), np.zeros(3), []
    for _ in range(120):
        after = joints.next_velocity(v, one)
        assert (np.abs(after - v) <= joints.limits * DT * (1.0 + 1e-9)).all()
        v, one = after, one.after(DT)
        moved += v * DT
        speeds.append(np.abs(v))
    rolled = joints.roll_out(own, whole, np.array([120 * DT]))
    assert rolled.velocity[0] == pytest.approx(v, abs=1e-9)
    assert rolled.moved[0] == pytest.approx(moved, abs=2e-4)  # a phase may end within a tick
    assert (np.max(speeds, axis=0) <= joints.fastest_between(own, whole, 0.0, 120 * DT) + 1e-9).all()


@pytest.mark.parametrize("where", [0.15, 0.45, 0.75])
def test_a_thin_obstacle_anywhere_along_a_manoeuvre_is_met(where):
    """A rod of 2 mm, which few instants would miss, somewhere in the arc of the tool."""
    mechanism, _, joints = among()
    q, v = mechanism.q_home, np.zeros(3)
    turning = Manoeuvre(joints.limits * [1.0, 0.0, 0.0], np.array([0.4, 0.0, 0.0]))
    end = joints.duration(v, turning)
    moved = joints.roll_out(v, turning, np.linspace(0.0, end, 400)).moved
    path = [joints.configuration(q, one, q) for one in moved]
    at = mechanism.placement(path[int(where * 400)], "tool").translation
    rod = {"name": "rod", "kind": "disc", "radius": 1e-3, "point": [float(at[0]), float(at[1])]}
    far = {**rod, "point": [-3.0, -3.0]}
    for obstacle, is_free in ((rod, False), (far, True)):
        _, clearance, joints = among(obstacle, {"name": "ball", "kind": "disc", "radius": 0.05, "point": [9.0, 9.0]})
        encounters = Encounters(clearance, 0.01, joints)
        truth = min(clearance.least(one) for one in path)
        assert (truth > 0.01) is is_free
        assert encounters.is_clear_of_rest(q, v, turning) is is_free
