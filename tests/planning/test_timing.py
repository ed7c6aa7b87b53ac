"""Time-optimal motions along paths: no finite difference of their samples exceeds a limit, and they are fast."""

import math
from functools import partial
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from clearings import measured
from repository import load
from scipy.interpolate import CubicHermiteSpline

from cinegen.collision import clearance_of, load_scene, scene_of
from cinegen.collision.mesh_check import MeshCheck
from cinegen.dynamics import Payload
from cinegen.ik import Solver
from cinegen.mission import MissionRecorder, Recording, RobotSample, resampled
from cinegen.planning import plan
from cinegen.planning.attempt import PlanStatus
from cinegen.planning.planner import Plan
from cinegen.planning.timed_path import timed_path
from cinegen.planning.timing import averaged, grid_of, time_law
from cinegen.planning.torque_limits import TorqueLimits


def dense(curve, law, count=20001):
    """Velocities and accelerations of a motion by finite differences, at rest before and after."""
    times = np.linspace(0.0, law.seconds, count)
    q = curve(law.at(times)[0])
    q = np.vstack([q[:1], q, q[-1:]])
    return np.diff(q, axis=0) / times[1], np.diff(q, n=2, axis=0) / times[1] ** 2


@pytest.mark.parametrize("seed", range(3))
def test_nowhere_on_a_random_curve_is_a_limit_exceeded_and_nearly_always_one_is_reached(seed):
    rng = np.random.default_rng(seed)
    count, width = int(rng.integers(2, 12)), int(rng.integers(1, 7))
    points, slopes = rng.normal(size=(2, count, width))
    s = np.cumsum(rng.uniform(0.5, 2.0, count))
    velocity, acceleration = rng.uniform(0.5, 3.0, width), rng.uniform(2.0, 20.0, width)
    curve = CubicHermiteSpline(s, points, slopes)
    law = time_law(curve, velocity, acceleration, grid_of(s, 20))
    v, a = dense(curve, law)
    v, a = np.abs(v) / velocity, np.abs(a) / acceleration
    assert v.max() <= 1.0 + 1e-6
    assert a.max() <= 1.0 + 1e-6
    assert np.mean(np.maximum(v[1:], a).max(axis=1) > 0.8) > 0.8


@pytest.mark.parametrize("distance", [0.05, 0.4, 3.0])
def test_a_straight_line_takes_as_long_as_ramps_of_constant_acceleration_do(distance):
    velocity, acceleration = 1.5, 6.0
    curve = CubicHermiteSpline([0.0, 1.0], [[0.0], [distance]], [[distance], [distance]])
    law = time_law(curve, np.array([velocity]), np.array([acceleration]))
    full = distance >= velocity**2 / acceleration
    exact = distance / velocity + velocity / acceleration if full else 2.0 * math.sqrt(distance / acceleration)
    assert exact - 1e-9 <= law.seconds <= 1.03 * exact


def test_averages_keep_velocities_and_accelerations_and_limit_the_jerk():
    t = np.linspace(0.0, 1.0, 201)[:, None]
    q = np.where(t < 0.5, 2.0 * t * t, 1.0 - 2.0 * (1.0 - t) ** 2)
    for count in (2, 7, 40):
        smooth = averaged(q, count)
        assert len(smooth) == len(q) + count - 1
        assert smooth[[0, -1]] == pytest.approx(q[[0, -1]], abs=1e-12)
        still = np.vstack([*[smooth[:1]] * 3, smooth, *[smooth[-1:]] * 3])
        assert np.abs(np.diff(still, axis=0)).max() * 200 <= 2.0
        assert np.abs(np.diff(still, n=2, axis=0)).max() * 200**2 <= 4.0 * (1 + 1e-9)
        assert np.abs(np.diff(still, n=3, axis=0)).max() * 200**3 <= 2.0 * 4.0 / (count / 200) * (1 + 1e-9)


def law_abiding(motion, scene, acceleration=10.0, prismatic=2.5):
    """Check a timed path by finite differences, and by distances of coal itself."""
    mechanism, rate = scene.mechanism, 1.0 / motion.times[1]
    steps = np.array([pin.difference(mechanism.model, a, b) for a, b in pairwise(motion.q)])
    columns = [mechanism.v_index(joint) for joint in mechanism.actuated]
    v, steps = mechanism.model.upperVelocityLimit[columns], steps[:, columns]
    slides = np.array([mechanism.is_prismatic(joint) for joint in mechanism.actuated])
    v = np.where(np.isfinite(v), v, np.where(slides, 0.25, 1.0))
    assert (np.abs(steps) * rate <= v * (1.0 + 1e-6)).all()
    changes = np.diff(np.pad(steps, ((1, 1), (0, 0))), axis=0) * rate**2
    assert (np.abs(changes) <= np.where(slides, prismatic, acceleration) * (1.0 + 1e-6)).all()
    assert max(map(mechanism.closure, motion.q)) <= 1e-9
    return np.abs(changes).max() / acceleration


def test_a_plan_of_the_paper(root):
    scene = load_scene(root / "robots/scenes/rod.toml")
    planned = plan(scene)
    motion = timed_path(planned)
    assert not motion.follows
    assert law_abiding(motion, scene) > 0.9  # it is fast, too
    assert motion.q[[0, -1]] == pytest.approx(planned.path[[0, -1]], abs=1e-9)
    assert min(measured(planned._clearance, q).min() for q in motion.q) >= scene.safety - 3e-6
    slower = timed_path(planned, acceleration=2.0, jerk=40.0)
    law_abiding(slower, scene, 2.0)
    jerks = np.diff(np.vstack([*[slower.q[:1]] * 3, slower.q, *[slower.q[-1:]] * 3]), n=3, axis=0) * 100.0**3
    assert np.abs(jerks).max() <= 40.0 * (1.0 + 1e-6)


def test_a_path_of_a_closed_robot():
    mechanism = load("delta4")
    scene = scene_of({"start": {}, "goal": {"point": [0.0, 0.0, 0.0]}}, mechanism=mechanism)
    moved = mechanism.configuration({joint: mechanism.q_home[mechanism.q_index(joint)] + 0.3 for joint in ("joint1",)})
    path = np.array([mechanism.q_home, mechanism.close(moved, locked=mechanism.actuated), mechanism.q_home])
    planned = Plan(scene, PlanStatus.REACHED, path, (), "", clearance_of(scene), MeshCheck(scene))
    law_abiding(timed_path(planned), scene)


def test_rounding_of_a_recorded_motion_changes_nothing(robot, tmp_path):
    """Joints that loops move alike have equal bounds, and the tangent at rest is 0 up to rounding."""
    delta = robot("delta4")
    solver, rng = Solver(delta, 0.01), np.random.default_rng(0)
    task = solver.add_task("platform", rotation=0)
    start, q = task.target.translation[0], []
    for tick in range(101):
        task.target.translation[0] = start + 0.2 * (1.0 - np.cos(np.pi * tick / 100))
        q.append(solver.step().q)
    limits = partial(TorqueLimits, payloads=[Payload("platform", 10.0)], efforts=3000.0)
    seconds = []
    for k in range(4):
        with MissionRecorder(tmp_path / f"{k}.jsonl", {"delta4": delta}) as recorder:
            for tick, at in enumerate(q):
                noisy = at + 1e-15 * rng.normal(size=len(at))
                recorder.write(0.01 * tick, {"delta4": RobotSample(noisy, "FOLLOWING")})
        recording = Recording.load(tmp_path / f"{k}.jsonl")
        motions = (resampled(recording, speed=np.inf, acceleration=30.0, torques=torques) for torques in (None, limits))
        seconds.append([motion.seconds for motion in motions])
    np.testing.assert_allclose(seconds, [seconds[0]] * 4, atol=1e-9)
