"""Predicted distances from obstacles that move, against coal at instants that are 1 ms apart."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from repository import load

from cinegen.collision import clearance_of, scene_of
from cinegen.model.motion_limits import motion_limits
from cinegen.planning.encounters import HORIZON, Encounters, ObstacleMotion
from cinegen.planning.manoeuvres import Manoeuvre, ReactingJoints

DT, SAFETY, STRIDE = 1e-3, 0.01, 5e-3
BOX = np.array([0.2, 0.06, 0.1])


@pytest.mark.parametrize("spin", [0.0, 3.0])
def test_no_distance_below_the_safety_distance_is_overlooked(spin):
    """A box crosses the workspace of an arm that brakes, or accelerates and brakes; where it stays far enough away, so
    does it at all instants in between, and where not, the first such instant and the least distance are found."""
    mechanism, rng = load("arm7"), np.random.default_rng(0)
    box = {"name": "box", "kind": "box", "size": BOX.tolist(), "point": [9.0, 9.0, 0.0]}
    given = {"safety": SAFETY, "start": {}, "goal": {"point": [0.0, 0.0, 0.0]}, "obstacle": [box]}
    clearance = clearance_of(scene_of(given, mechanism=mechanism))
    joints = ReactingJoints(mechanism, clearance.links, motion_limits(mechanism).acceleration)
    joints.dt = DT
    encounters, outcomes = Encounters(clearance, SAFETY, joints), []
    links = [one for one in clearance.links if one.joint]
    for number in range(12):
        q = mechanism.q_home + rng.uniform(-0.5, 0.5, 7)
        v = rng.uniform(-1.0, 1.0, 7) * (number % 2)
        manoeuvre = joints.manoeuvre(q, v, rng.uniform(-1.0, 1.0, 7), 0.2) if number % 3 else joints.braking
        pose, velocity = _course(mechanism, q, rng)
        motion = ObstacleMotion(pose, 0)
        turn = pin.exp3(np.array([0.0, 0.0, spin * DT]))
        motion.update(pin.SE3(turn @ pose.rotation, pose.translation + velocity * DT), 1, DT)
        assert encounters.follow({0: motion}, 1)
        found = encounters.meet(q, v, manoeuvre)
        dense = _distances(mechanism, links, joints, q, v, manoeuvre, lambda t, m=motion: m.pose(1, t))
        if dense[0] < 2.0 * SAFETY:
            continue
        outcomes.append(dense.min() < SAFETY)
        low = np.flatnonzero(dense < SAFETY - STRIDE)
        if len(low):
            assert found.first <= low[0] * DT + 1e-9
            assert found.place is not None
        if dense.min() >= SAFETY:
            assert found.first == np.inf
        assert found.least >= dense.min() - 1e-6 or dense.min() <= 0.0  # no instant is made up
    assert any(outcomes)
    assert not all(outcomes)


def _course(mechanism, q, rng):
    """A pose about half a metre from a point of the arm, and a velocity past it at 0.6 to 2 m/s."""
    aim = mechanism.placement(q, f"link{rng.integers(3, 7)}").translation + rng.uniform(-0.15, 0.15, 3)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    return pin.SE3(pin.exp3(rng.normal(size=3)), aim - 0.6 * direction), rng.uniform(0.6, 2.0) * direction


def _distances(mechanism, links, joints, q, v, manoeuvre: Manoeuvre, pose):
    data, shape, found = mechanism.model.createData(), coal.Box(*BOX), []
    times = np.arange(0.0, HORIZON, DT)
    for t, moved in zip(times, joints.roll_out(v, manoeuvre, times).moved, strict=True):
        pin.forwardKinematics(mechanism.model, data, q + moved)
        at = pose(float(t))
        there, least = coal.Transform3s(at.rotation, at.translation), np.inf
        for link in links:
            here = data.oMi[link.joint] * link.placement
            place, result = coal.Transform3s(here.rotation, here.translation), coal.DistanceResult()
            least = min(least, coal.distance(link.shape, place, shape, there, coal.DistanceRequest(), result))
        found.append(least)
    return np.array(found)
