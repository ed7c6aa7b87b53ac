"""`AvoidingSolver` among obstacles that move: accelerations by finite differences, distances by coal."""

from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
import pytest
from repository import load

from cinegen.collision import clearance_of, scene_of
from cinegen.ik import Status
from cinegen.model.motion_limits import motion_limits
from cinegen.planning import AvoidingSolver

DT, ACCELERATION, SPEED, SAFETY = 1 / 240, 10.0, 1.0, 0.01


def among_a_ball(name, acceleration=ACCELERATION):
    """A solver, its clearance, and a ball of 5 cm far away."""
    mechanism = load(name)
    ball = {"name": "ball", "kind": "sphere", "radius": 0.05, "point": [9.0, 9.0, 0.0]}
    document = {"safety": SAFETY, "start": {}, "goal": {"point": [0.0, 0.0, 0.0]}, "obstacle": [ball]}
    clearance = clearance_of(scene_of(document, mechanism=mechanism))
    return AvoidingSolver(clearance, DT, SAFETY, acceleration=acceleration), clearance


def run(solver, clearance, begin, velocity, ticks, aim=None):
    """Move the ball at a constant velocity. Return configurations, distances by coal, statuses and threats."""
    q, least, statuses, threats = [solver.q], [], [], []
    for tick in range(ticks):
        solver.move(0, pin.SE3(np.eye(3), begin + np.asarray(velocity) * (tick * solver.dt)))
        if aim is not None:
            aim(tick)
        step = solver.step()
        assert step.exceptions == ()
        q.append(step.q)
        least.append(distance(clearance, step.q, begin + np.asarray(velocity) * (tick * solver.dt)))
        statuses.append(step.status)
        threats.append(solver.threat)
    return np.array(q), np.array(least), statuses, threats


def distance(clearance, q, ball):
    """The least distance of all moving links from the ball, by coal."""
    mechanism = clearance.mechanism
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    there, found = coal.Transform3s(np.eye(3), np.asarray(ball)), []
    for body in (one for one in clearance.links if one.joint):
        pose = data.oMi[body.joint] * body.placement
        here = coal.Transform3s(pose.rotation, pose.translation)
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        found.append(coal.distance(body.shape, here, coal.Sphere(0.05), there, request, result))
    return min(found)


def accelerations(mechanism, q, dt=DT):
    """The largest one of an actuated joint by finite differences, from rest."""
    v = np.array([pin.difference(mechanism.model, a, b) for a, b in pairwise(q)]) / dt
    changes = np.diff(np.vstack([np.zeros_like(v[:1]), v]), axis=0) / dt
    return float(np.abs(changes[:, [mechanism.v_index(joint) for joint in mechanism.actuated]]).max())


@pytest.mark.parametrize(("name", "node"), [("arm7", "tool"), ("delta4", "platform")])
def test_accelerations_are_obeyed_whatever_happens(name, node):
    """A target that jumps, and a ball that comes at 1 m/s."""
    solver, clearance = among_a_ball(name)
    rng, mechanism = np.random.default_rng(2), solver.mechanism
    task = solver.add_task(node, rotation=0, axes="world")
    home = task.target.translation.copy()
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)

    def aim(tick):
        if tick % 60 == 0:
            task.target = pin.SE3(task.target.rotation, home + rng.uniform(-0.3, 0.3, 3))

    q, _, _, _ = run(solver, clearance, home - 0.9 * direction, SPEED * direction, 360, aim)
    assert accelerations(mechanism, q) <= ACCELERATION * (1.0 + 1e-6)


def test_a_ball_that_comes_is_evaded():
    """From the side to the tool of an arm at 1 m/s: half of the safety distance is kept at least."""
    solver, clearance = among_a_ball("arm7")
    home = solver.mechanism.placement(solver.q, "tool").translation
    solver.add_task("tool", rotation=0)
    side = np.array([0.0, 1.0, 0.0])
    q, least, statuses, _ = run(solver, clearance, home - 0.8 * side, SPEED * side, 192)
    assert least.min() >= 0.5 * SAFETY
    assert not {Status.UNAVOIDABLE, Status.IN_COLLISION} & set(statuses)
    assert min(distance(clearance, q[0], home + s * side) for s in np.linspace(-0.1, 0.1, 21)) < 0.0  # at rest


@pytest.mark.parametrize("name", ["arm7", "delta4"])
def test_the_status_and_the_threat_where_a_collision_is_not_avoided(name):
    """A ball at 1 m/s through a link near the base, which can't get away; it goes on through the robot."""
    solver, clearance = among_a_ball(name)
    mechanism = solver.mechanism
    node = {"arm7": "link1", "delta4": "platform"}[name]
    task = solver.add_task(mechanism.end, rotation=0)
    if name == "delta4":  # its platform gets out of the way of slower ones
        begin, velocity = mechanism.placement(solver.q, node).translation - [0.0, 0.0, 0.8], np.array([0.0, 0.0, 8.0])
    else:
        body = next(one for one in clearance.links if one.joint == 1)
        centre = _centre(mechanism, solver.q, body)
        begin, velocity = centre - np.array([0.0, 0.8, 0.0]), np.array([0.0, 1.0, 0.0])

    def aim(tick):
        if tick == 0:
            task.target = pin.SE3(task.target.rotation, task.target.translation + 0.02)

    q, least, statuses, threats = run(solver, clearance, begin, velocity, 200, aim)
    hit = int(np.argmax(least <= 0.0))
    assert least[hit] <= 0.0
    assert Status.UNAVOIDABLE in statuses[:hit]
    assert Status.IN_COLLISION in statuses[hit:]
    warned = next(threat for threat in threats if threat is not None)
    assert warned.pair[1].startswith("ball")
    assert not warned.happens
    assert accelerations(mechanism, q) <= ACCELERATION * (1.0 + 1e-6)
    assert max(map(mechanism.closure, q)) <= 1e-9


def _centre(mechanism, q, body):
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    return data.oMi[body.joint].act(np.asarray(body.centre))


def test_where_nothing_can_be_done_it_comes_to_a_full_stop_within_its_limits():
    """Dragged about under a cage, and a large ball comes at 2 m/s, straight to a link near the base."""
    cage = {"name": "cage", "kind": "cylinder", "radius": 0.5, "length": 0.05, "point": [0.0, 0.0, 1.6]}
    ball = {"name": "ball", "kind": "sphere", "radius": 0.12, "point": [9.0, 9.0, 0.0]}
    document = {"safety": SAFETY, "start": {}, "goal": {"point": [2.0, 0.0]}, "obstacle": [cage, ball]}
    clearance = clearance_of(scene_of(document, mechanism=load("delta4")))
    solver, away = AvoidingSolver(clearance, DT, SAFETY), 0.5
    mechanism = solver.mechanism
    task = solver.add_task(mechanism.end, rotation=0, axes="world")
    body = next(one for one in clearance.links if one.joint == 1)
    index, q, statuses, v = len(clearance.obstacles) - 1, [solver.q], [], []
    aim = task.target.translation + np.array([0.1, 0.1, 0.0])
    begin = None
    for tick in range(240):
        if tick == 0:
            task.target = pin.SE3(task.target.rotation, aim)
        if tick == 20:  # while it moves
            centre = _centre(mechanism, solver.q, body)
            begin = centre - np.array([0.0, away, 0.0])
        if begin is not None:
            at = begin + np.array([0.0, min(2.0 * (tick - 20) * DT, away), 0.0])
            solver.move(index, pin.SE3(np.eye(3), at))
        step = solver.step()
        assert step.exceptions == ()
        assert np.isfinite(step.q).all()
        assert mechanism.closure(step.q) <= 1e-9
        q.append(step.q)
        statuses.append(step.status)
        v.append(float(np.abs(step.v).max()))
    first = next(tick for tick, status in enumerate(statuses) if status in (Status.UNAVOIDABLE, Status.IN_COLLISION))
    assert Status.UNAVOIDABLE in statuses
    assert max(v[:first]) > 0.05  # there was something to stop
    ended = [one for one, status in zip(v, statuses, strict=True) if status is Status.IN_COLLISION]
    assert min(ended) < 1e-9
    limits = motion_limits(mechanism).acceleration[[mechanism.v_index(joint) for joint in mechanism.actuated]]
    rates = np.array([pin.difference(mechanism.model, a, b) for a, b in pairwise(q)]) / DT
    columns = [mechanism.v_index(joint) for joint in mechanism.actuated]
    changes = np.abs(np.diff(np.vstack([0.0 * rates[:1], rates]), axis=0))[:, columns] / DT
    assert (changes <= limits * (1.0 + 1e-6)).all()
