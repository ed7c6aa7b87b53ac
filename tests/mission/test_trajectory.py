"""Recorded motion sampled anew: on the recorded way, on its branch, no faster than any joint may be; and its check."""

import math
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from five_bar import two_bar_angles
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import record, swung
from scipy.interpolate import CubicSpline
from small_robots import FLOATING, four_bar

import cinegen
from cinegen.mission import FindingKind, MissionError, MissionRecorder, Recording, RobotSample, check, resampled
from cinegen.mission.recording import between
from cinegen.mission.trajectory import Trajectory, curve_through
from cinegen.model import ForwardKinematics
from cinegen.model.motion_limits import DEFAULT_ACCELERATION, motion_limits
from cinegen.singularities.crossing import Rows, crossings, of_end, of_passive_joints

ROBOTS = ["planar_3r", "rx90", "four_bar", "five_bar", "delta4", "gough", "hybrid", "sr400"]
seeds = st.integers(0, 2**32 - 1)


def _steps(trajectory: Trajectory):
    """Of each step, the part of each joint's velocity limit that it takes."""
    limits = trajectory.mechanism.model.upperVelocityLimit
    return np.abs(np.diff(trajectory.q, axis=0)) * trajectory.rate / limits


def _accelerations(trajectory: Trajectory):
    """Second finite differences of the actuated joints, at rest before and after, relative to the default."""
    mechanism, (angular, linear) = trajectory.mechanism, DEFAULT_ACCELERATION
    q = trajectory.positions(mechanism.actuated)
    acceleration = np.diff(np.vstack([q[:1], q, q[-1:]]), n=2, axis=0) * trajectory.rate**2
    return np.abs(acceleration) / [linear if mechanism.is_prismatic(joint) else angular for joint in mechanism.actuated]


def _kinds(findings):
    return {finding.kind for finding in findings}


# --- curves ----------------------------------------------------------------------------------------------------------


@given(seeds, st.integers(2, 12), st.integers(1, 3))
def test_a_curve_passes_its_points_overshoots_nowhere_and_rests_at_its_ends(seed, count, width):
    rng = np.random.default_rng(seed)
    s = np.cumsum(rng.uniform(0.3, 2.0, count))
    points = np.round(rng.normal(size=(count, width)), 1)  # some are equal
    curve = curve_through(s, points)
    assert curve(s) == pytest.approx(points, abs=1e-12)
    dense = np.linspace(s[0], s[-1], 4001)
    values, slopes = curve(dense), curve(dense, 1)
    i = np.clip(np.searchsorted(s, dense, side="right") - 1, 0, count - 2)
    assert (values >= np.minimum(points[i], points[i + 1]) - 1e-12).all()
    assert (values <= np.maximum(points[i], points[i + 1]) + 1e-12).all()
    assert slopes[[0, -1]] == pytest.approx(0.0, abs=1e-9)


# --- laws ------------------------------------------------------------------------------------------------------------


@settings(max_examples=16)
@given(st.sampled_from(ROBOTS), seeds, st.sampled_from([10.0, 125.0, 133.7]), st.sampled_from([0.3, 1.0, 40.0]))
def test_it_obeys_all_limits_and_stays_closed(robot, tmp_path_factory, name, seed, rate, speed):
    mechanism = robot(name)
    times, q = swung(mechanism, 0.6, rate=50.0, seed=seed)
    recording = record(tmp_path_factory.mktemp("mission") / "run.jsonl", mechanism, times, q)
    motion = resampled(recording, rate=rate, speed=speed)
    assert (_steps(motion) <= 1.0 + 1e-6).all()
    assert (_accelerations(motion) <= 1.0 + 1e-6).all()
    assert max(map(mechanism.closure, motion.q)) <= 1e-10
    motors = [mechanism.v_index(joint) for joint in mechanism.actuated]
    limits = mechanism.model.upperVelocityLimit
    assert (np.abs(motion.v[:, motors]) <= limits[motors] * (1 + 1e-9)).all()
    assert motion.times == pytest.approx(np.arange(len(motion.q)) / rate)
    assert motion.seconds == pytest.approx(motion.passes[-1, 0], abs=1.0 / rate)
    assert motion.seconds >= motion.passes[-1, 0] - 1e-9
    assert (motion.v[[0, -1]] == 0.0).all()
    assert (motion.q[0] == q[0]).all()
    assert motion.q[-1] == pytest.approx(q[-1], abs=1e-12)
    # it passes all recorded positions in their order, at the times that it says
    assert (motion.passes[:, 1] == recording.times).all()
    assert (np.diff(motion.passes[:, 0]) >= np.diff(times) / speed - 1e-9).all()
    near = np.minimum(np.round(motion.passes[:, 0] * rate).astype(int), len(motion.q) - 1)
    assert (np.abs(motion.q[near] - q)[:, motors] <= limits[motors] / rate).all()
    findings = check(motion)
    assert not findings.serious, [str(finding) for finding in findings]
    assert findings.closure <= 1e-10


def test_it_is_near_what_was_recorded(robot, tmp_path):
    mechanism = robot("delta4")
    times, q = swung(mechanism, 2.0, rate=50.0)
    recording = record(tmp_path / "run.jsonl", mechanism, times, q)
    motion = resampled(recording, rate=400.0, acceleration=200.0)
    seconds = np.diff(motion.passes[:, 0])
    assert (seconds >= np.diff(times) - 1e-9).all()
    assert seconds[20:-20] == pytest.approx(np.diff(times)[20:-20], rel=1e-3)  # as recorded, but for start and end
    exact = CubicSpline(motion.times, motion.q)(motion.passes[:, 0])
    assert exact == pytest.approx(q, abs=2e-5)
    assert motion.v[1:-1] == pytest.approx((motion.q[2:] - motion.q[:-2]) * 200.0, abs=1e-9)


# --- limits ----------------------------------------------------------------------------------------------------------


def test_joints_without_motors_obey_their_limits_too(tmp_path):
    slow = cinegen.load(four_bar(words=("velocity 720 actuated 1", "", "velocity 20")))
    forward, begin = ForwardKinematics(slow), slow.q_home[0]
    times = np.arange(101) / 100
    q = [forward.move({"joint1": begin + 2.0 * math.pi * time}) for time in times]
    motion = resampled(record(tmp_path / "run.jsonl", slow, times, q), rate=20.0)
    taken = _steps(motion)[:, slow.v_index("joint3")]
    assert taken.max() <= 1.0 + 1e-6
    assert taken.max() > 0.95
    assert motion.seconds < 2.0 * 2.0 * np.abs(np.diff([row[2] for row in q])).sum() / math.radians(20.0)
    assert not check(motion).serious
    assert np.median(taken) > 0.5  # it is slow only where it must be


# --- what can't be sampled -------------------------------------------------------------------------------------------


def test_what_can_not_be_sampled(robot, tmp_path):
    arm = robot("planar_3r")
    empty = record(tmp_path / "empty.jsonl", arm, [], [])
    with pytest.raises(MissionError, match="nothing was recorded"):
        resampled(empty)
    single = record(tmp_path / "one.jsonl", arm, [0.0], np.zeros((1, 3)))
    for options in ({"rate": 0.0}, {"rate": math.nan}, {"rate": 1e9}, {"speed": -1.0}, {"speed": 1e300}):
        with pytest.raises(MissionError, match="must be from "):
            resampled(single, **options)
    with MissionRecorder(tmp_path / "two.jsonl", {"left": arm, "right": arm}) as recorder:
        recorder.write(0.0, {"left": RobotSample(np.zeros(3), "IDLE"), "right": RobotSample(np.ones(3), "IDLE")})
    assert resampled(Recording.load(tmp_path / "two.jsonl"), "right").q.tolist() == [[1.0] * 3]
    far = record(tmp_path / "far.jsonl", arm, [0.0, 1e5], np.zeros((2, 3)))
    with pytest.raises(MissionError, match="are too many"):
        resampled(far)


def test_a_base_that_moves(raff, tmp_path):
    rover = raff(f"robot rover {{ link 1 {{ type 2 pred 0 }} {FLOATING[0]} }} {FLOATING[1]}")
    assert rover.floating
    moved = rover.q_home.copy()
    moved[:7] = 1.0, 0.0, 0.0, 0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)
    recording = record(tmp_path / "run.jsonl", rover, [0.0, 1.0], [rover.q_home, moved])
    half = recording.at(0.5)["robot"]
    assert half[6] == pytest.approx(math.cos(math.pi / 8))  # a turn by 45 degrees
    with pytest.raises(MissionError, match="its base is floating"):
        resampled(recording)


def test_a_leap_to_another_branch_is_told(robot, tmp_path):
    mechanism = robot("four_bar")
    q = mechanism.q_home
    other = mechanism.close(mechanism.configuration({"joint2": -q[1], "joint3": -q[2]}), ["joint1"])
    assert np.abs(other - q).max() > 1.0
    recording = record(tmp_path / "run.jsonl", mechanism, [0.0, 0.5, 0.51, 1.0], [q, q, other, other])
    with pytest.raises(MissionError, match=r"between 0.500 and 0.510 s of the recording it jumps to another branch"):
        resampled(recording)


def test_loops_that_were_open_are_told(robot, tmp_path):
    mechanism = robot("four_bar")
    q = np.array([mechanism.q_home] * 3)
    q[1, 2] += 0.1
    recording = record(tmp_path / "run.jsonl", mechanism, [0.0, 0.5, 1.0], q)
    with pytest.raises(MissionError, match=r"at 0.500 s loops of linkage are open by"):
        resampled(recording)
    q[1, 2] -= 0.1 - 1e-7  # rounded values are closed
    assert check(resampled(record(tmp_path / "run.jsonl", mechanism, [0.0, 0.5, 1.0], q))).closure <= 1e-12


# --- singularities between samples -----------------------------------------------------------------------------------


def _five_bar(mechanism, x, y):
    """The five-bar with its tool at x, y, the one elbow left and the other right of its arm, inwards."""
    first, second, _ = two_bar_angles(x + 0.15, y, 0.25, 0.4, 1.0)
    third, fourth, _ = two_bar_angles(x - 0.15, y, 0.25, 0.4, -1.0)
    values = {"joint1": first, "joint2": second, "joint3": third, "joint4": fourth}
    return mechanism.configuration({**values, "joint5": first + second - third - fourth})


def _area(mechanism, x, y):
    """The sine of the angle between the outer bars: 0 where the motors don't hold the tool."""
    q = dict(zip(mechanism.joints, _five_bar(mechanism, x, y), strict=True))
    return math.sin(q["joint1"] + q["joint2"] - q["joint3"] - q["joint4"])


@pytest.mark.parametrize(("step", "rate", "x"), [(0.01, 125.0, 0.0), (0.2, 500.0, 0.03), (0.1, 10.0, 0.03)])
def test_a_type_2_singularity_between_two_samples_is_found(robot, tmp_path, step, rate, x):
    """The tool goes straight, from 0.57 to 0.62 m: in between, both elbows are at the same place."""
    mechanism = robot("five_bar")
    times = np.arange(round(1.0 / step) + 1) * step
    q = [_five_bar(mechanism, x, 0.57 + 0.05 * time) for time in times]
    assert max(map(mechanism.closure, q)) < 1e-12
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        same = _area(mechanism, x, 0.57) * _area(mechanism, x, 0.57 + 0.05 * middle) > 0.0
        low, high = (middle, high) if same else (low, middle)
    assert low == pytest.approx((0.2 + math.sqrt(0.16 - x * x) - 0.57) / 0.05)
    motion = resampled(record(tmp_path / "run.jsonl", mechanism, times, q), rate=rate)
    findings = check(motion)
    assert findings.closure <= 1e-12
    (finding,) = (finding for finding in findings if finding.kind is FindingKind.TYPE_2)
    assert finding.recorded == pytest.approx(low, abs=5e-3 / rate + 4e-2 * step**2)
    assert finding.time == pytest.approx(motion.passes[-1, 0] * low, abs=0.05)
    assert finding.sigma < 1e-6
    assert mechanism.closure(finding.q) <= 1e-12
    assert math.sin(finding.q[mechanism.q_index("joint5")]) == pytest.approx(0.0, abs=1e-6)
    assert "passes through a type 2 singularity" in str(finding)
    assert finding in findings.serious
    # the motion goes on on the branch that was recorded
    assert motion.q[-1] == pytest.approx(q[-1], abs=1e-9)
    assert motion.positions(mechanism.actuated)[-1] == pytest.approx(q[-1][[0, 2]], abs=1e-12)


def test_singularities_far_apart_from_samples():
    """However far two samples are apart, as far as the way between them is known: each is found, and nothing else. The
    rocker of a four-bar loses its hold where the crank and the coupler are in line."""
    crank, rocker = (cinegen.load(four_bar(words=words)) for words in (("actuated 1", "", ""), ("", "", "actuated 1")))
    reaches = np.array([0.48, 0.24])  # from the crank's axis to the rocker's end
    dead = np.arccos((0.4**2 + reaches**2 - 0.24**2) / (2.0 * 0.4 * reaches)) + np.array([0.0, math.pi])
    rows, counts, rng = of_passive_joints(rocker), [], np.random.default_rng(1)
    for begin, way in zip(rng.uniform(-6.0, 6.0, 40), rng.uniform(0.1, 2.5, 40), strict=True):
        forward = ForwardKinematics(crank)
        first, second = forward.move({"joint1": begin}), forward.move({"joint1": begin + way})
        expected = sorted((dead - begin) % (2.0 * math.pi))
        angles = [crossing.q[0] - begin for crossing in crossings(rows, partial(between, rocker, first, second))]
        assert angles == pytest.approx([angle for angle in expected if angle < way], abs=1e-6)
        counts.append(len(angles))
    assert set(counts) == {0, 1}


@pytest.mark.parametrize("samples", [36, 180])
def test_dead_centres_between_two_samples_are_passed(raff, samples):
    """A piston turns back where its crank and its rod are in line. It moves in one direction of three: its Jacobian
    has rank 1."""
    mechanism = raff("""
robot slider_crank {
  base { parameters { gamma -90 d 200 alpha 60 theta 11 r 300 } }
  link 1 { parameters { theta 60 } type 2 pred 0 actuated 1 }
  link 2 { parameters { d 90 theta -80 } type 2 pred 1 }
  frame 4 { parameters { d 230 } pred 2 }
  link 3 { parameters { gamma 90 alpha 90 r 260 } type 1 pred 0 }
  frame 5 { parameters { alpha -90 } pred 3 }
  constraint { frame 4 frame 5 type 2 }
}
""")
    forward, step = ForwardKinematics(mechanism), 2.0 * math.pi / samples
    path = [forward.move({"joint1": math.radians(60.0) + k * step}) for k in range(samples + 1)]
    angles = [
        crossing.q[0]
        for a, b in pairwise(path)
        for crossing in crossings(of_end(mechanism), partial(between, mechanism, a, b))
    ]
    assert angles == pytest.approx([math.pi, 2.0 * math.pi], abs=1e-6)


@pytest.mark.parametrize("turn", [0.0, 1.0, 1.8, 2.6])
@pytest.mark.parametrize("zero", [-1.0, 0.1, 0.37])
def test_a_matrix_that_turns_between_two_samples(robot, turn, zero):
    """Its singular vectors turn by so much (rad) that from sample to sample they may seem to have turned round."""
    arm = robot("planar_3r")

    def matrix(q):
        cos, sin = math.cos(turn * q[0]), math.sin(turn * q[0])
        return np.array([[cos, -sin], [sin, cos]]) @ np.diag([4.0, q[0] - zero])

    zeros = [crossing.x for crossing in crossings(Rows(matrix, 2), partial(between, arm, np.zeros(3), np.ones(3)))]
    assert zeros == pytest.approx([zero] if 0.0 < zero < 1.0 else [], abs=1e-8)


def test_a_motion_near_a_type_2_singularity_is_noted_where_it_is_nearest_and_one_that_ends_there_is_serious(
    robot, tmp_path
):
    mechanism, times = robot("five_bar"), np.arange(101) / 100

    def checked(heights):
        q = [_five_bar(mechanism, 0.0, height) for height in heights]
        return check(resampled(record(tmp_path / "run.jsonl", mechanism, times, q)))

    findings = checked(0.58 + 0.015 * np.sin(np.pi * times))
    (near,) = (finding for finding in findings if finding.kind is FindingKind.NEAR_TYPE_2)
    assert near.recorded == pytest.approx(0.5, abs=0.01)
    assert near.sigma == findings.passive_sigma < 0.05
    assert near not in findings.serious
    assert FindingKind.TYPE_2 not in _kinds(findings)
    assert FindingKind.TYPE_2 in _kinds(checked(0.57 + 0.03 * times).serious)


def test_an_elbow_that_is_stretched_is_noted(robot, tmp_path):
    arm = robot("planar_3r")
    times = np.arange(11) / 10
    q = [[0.3, 0.4 - 0.77 * time, 0.5] for time in times]
    findings = check(resampled(record(tmp_path / "run.jsonl", arm, times, q), rate=10.0))
    (finding,) = (finding for finding in findings if finding.kind is FindingKind.TYPE_1)
    assert finding.q[1] == pytest.approx(0.0, abs=1e-6)
    assert finding.recorded == pytest.approx(0.4 / 0.77, abs=1e-2)
    assert not findings.serious
    assert finding.sigma < 1e-6
    assert findings.passive_sigma == math.inf


# --- what a check finds ----------------------------------------------------------------------------------------------


def _made(mechanism, q, accelerates=False):
    times = np.arange(len(q)) / 100.0
    limits = motion_limits(mechanism)
    if not accelerates:
        limits = limits._replace(acceleration=np.full(mechanism.model.nv, np.inf))
    return Trajectory("made", mechanism, 100.0, times, q, np.zeros_like(q), np.column_stack([times, times]), limits)


def test_what_is_open_beyond_a_limit_or_too_fast_is_found(robot):
    mechanism = robot("four_bar")
    q = np.array([mechanism.q_home] * 9)
    q[3:5, 1] += [1e-3, 2e-3]
    findings = check(_made(mechanism, q))
    (finding,) = (finding for finding in findings if finding.kind is FindingKind.OPEN)
    assert (finding.time, finding in findings.serious) == (0.03, True)
    assert findings.closure == max(map(mechanism.closure, q)) > 1e-4
    arm = robot("planar_3r")
    q = np.zeros((9, 3))
    q[:, 1] = 0.5
    high, fastest = arm.model.upperPositionLimit[0], arm.model.upperVelocityLimit
    q[4:, 0] = high + 0.1
    findings = check(_made(arm, q))
    assert _kinds(findings.serious) == {FindingKind.LIMIT, FindingKind.SPEED}
    assert sorted(finding.time for finding in findings.serious) == pytest.approx([0.03, 0.04])
    assert "joint1 is 5.73 deg beyond its upper limit" in " ".join(map(str, findings))
    q[:, 0] = np.arange(9) * fastest[0] / 100
    assert not check(_made(arm, q)).serious
    assert check(_made(arm, 1.01 * q)).serious
    findings = check(_made(arm, q, accelerates=True))  # at once at full speed, and stopped at once
    assert [finding.time for finding in findings.serious] == pytest.approx([0.0, 0.08])
    assert _kinds(findings.serious) == {FindingKind.ACCELERATION}
    assert f"joint1 accelerates at {100 * fastest[0]:.4g} rad/s^2, its limit is 10 rad/s^2" in str(findings.serious[0])


def test_joints_without_limits_obey_stated_defaults(raff, tmp_path):
    arm = raff("robot r {\n base { }\n link 1 { type 2 pred 0 }\n link 2 { parameters { d 300 } type 1 pred 1 }\n}\n")
    times = np.arange(51) / 50
    recording = record(tmp_path / "run.jsonl", arm, times, np.column_stack([4.0 * times, 1.0 - np.cos(6.0 * times)]))
    motion = resampled(recording)
    assumed = "velocity limit of {0}: 1 rad/s, 0.25 m/s; acceleration limit of {0}: 10 rad/s^2, 2.5 m/s^2"
    assert str(motion.limits) == assumed.format("joint1, joint2")
    assert (np.abs(np.diff(motion.q, axis=0)) * motion.rate <= np.array([1.0, 0.25]) * (1.0 + 1e-6)).all()
    assert (_accelerations(motion) <= 1.0 + 1e-6).all()
    assert not check(motion).serious


@pytest.mark.parametrize(("motors", "noted"), [("joint1 joint2 joint3", False), ("joint3", True)])
def test_motors_in_excess_and_motors_that_are_missing(robot, raff, root, tmp_path, motors, noted):
    """Where motors don't determine the motion, or contradict each other between samples, it is still the recorded."""
    times, q = swung(robot("five_bar"), 1.0)
    text = (root / "robots" / "five_bar.raff").read_text(encoding="utf-8").partition("\n")[2]
    text = text.replace("    actuated 1\n", "").replace("    type 2\n", "    type 2\n    actuated 0\n")
    for motor in motors.split():
        head, link, rest = text.partition(f"  link {motor[-1]} {{")
        text = head + link + rest.replace("actuated 0", "actuated 1", 1)
    mechanism = raff(text)
    assert mechanism.actuated == tuple(motors.split())
    motion = resampled(record(tmp_path / "run.jsonl", mechanism, times, q), rate=200.0)
    findings = check(motion)
    assert not findings.serious
    assert (FindingKind.UNCONTROLLED in _kinds(findings)) == noted
    exact = np.array([motion.q[min(round(200 * time), len(motion.q) - 1)] for time in motion.passes[:, 0]])
    assert exact == pytest.approx(q, abs=1e-2)
    assert motion.q[[0, -1]] == pytest.approx(q[[0, -1]], abs=1e-12)
