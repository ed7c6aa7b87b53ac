"""The fastest motion along a recorded path within limits of torque: closed forms, and Pinocchio's dynamics."""

import math
import re
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import scipy.linalg
from five_bar import two_bar_angles
from pinocchio_constraints import constraint_dynamics
from random_masses import free_motions, massive
from recorded import record, swung
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from small_robots import four_bar, parallelogram
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.dynamics import InverseDynamics
from cinegen.dynamics.errors import MassError
from cinegen.dynamics.trajectory import torques_along
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.mission import Recording, resampled
from cinegen.planning.singular_crossing import guided
from cinegen.planning.timing import TimingError
from cinegen.planning.torque_limits import TorqueLimits

MASS, FORCE = 2.0, 30.0
NEVER = 1e4  # a limit of acceleration that is not reached


@pytest.fixture
def slid(tmp_path: Path):
    """`slid("0 0 1", 30.0)`: a cart on a rail, and a recording in which it moves by 1 m."""

    def make(axis: str, effort: float = FORCE, friction: str = "") -> tuple[cinegen.Mechanism, Recording]:
        body = f'''<inertial><mass value="{MASS}"/>
          <inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>'''
        rail = UrdfJoint("x", "rail", "cart", "0 0 0", axis, "prismatic", (-5.0, 5.0), effort, 100.0, more=friction)
        mechanism = cinegen.load(urdf_text([rail], {"cart": body}))
        return mechanism, record(tmp_path / "run.jsonl", mechanism, [0.0, 9.0], [[0.0], [1.0]])

    return make


def test_what_cannot_be_held_is_refused(slid):
    _, recording = slid("0 0 1", 10.0)
    with pytest.raises(CinegenError, match=r"x needs 19\.62 N to hold the mechanism at rest .* its limit is 10 N"):
        resampled(recording, torques=TorqueLimits)
    assert resampled(recording, torques=partial(TorqueLimits, efforts={"x": 20.0})).seconds >= 9.0


def required(mechanism: cinegen.Mechanism, q: np.ndarray, rate: float) -> np.ndarray:
    """The torques (n - 2, actuated) of actuated joints at inner samples, by Pinocchio and finite differences of all
    joints."""
    data, columns = mechanism.model.createData(), [mechanism.v_index(name) for name in mechanism.actuated]
    torques = []
    for before, now, after in zip(q[:-2], q[1:-1], q[2:], strict=True):
        ahead, behind = mechanism.difference(now, after), mechanism.difference(now, before)
        v, a = 0.5 * rate * (ahead - behind), rate**2 * (ahead + behind)
        free = free_motions(mechanism, now)
        tree = pin.rnea(mechanism.model, data, now, v, a)
        torques.append(scipy.linalg.lstsq(free[columns].T, free.T @ tree)[0])
    return np.array(torques)


@pytest.mark.parametrize("name", ["planar_3r", "delta4"])
def test_robots_move_as_fast_as_their_torques_allow(robot, tmp_path, name):
    mechanism = massive(robot(name))
    recording = record(tmp_path / "run.jsonl", mechanism, *swung(mechanism, 1.0, 25.0), name=name)
    q, rate = recording.q[name], 400.0
    hold = np.abs(required(mechanism, q, 0.0)).max(axis=0)
    efforts = dict(zip(mechanism.actuated, (1.5 * hold + 3.0).tolist(), strict=True))
    torques = TorqueLimits(mechanism, efforts=efforts)
    motion = resampled(recording, rate=rate, speed=math.inf, acceleration=NEVER, torques=lambda _: torques)
    used = np.abs(required(mechanism, motion.q, rate)) / list(efforts.values())
    assert used.max() <= 1.0 + 1e-3
    assert np.median(used.max(axis=1)) > 0.75  # one of them is near its limit most of the time
    slower = resampled(recording, rate=rate, speed=math.inf, acceleration=0.05, torques=lambda _: torques)
    assert slower.seconds > motion.seconds


def test_limits_that_are_missing_or_wrong(robot, slid):
    massless, heavy = robot("planar_3r"), robot("delta4")
    with pytest.raises(MassError, match="have no mass"):
        TorqueLimits(massless, efforts=10.0)
    with pytest.raises(CinegenError, match=r"no actuated joint has a limit of torque or force: .* \('effort'\)"):
        TorqueLimits(heavy)
    with pytest.raises(CinegenError, match="of joint6 must be positive, not 0"):
        TorqueLimits(heavy, efforts={"joint1": 3.0, "joint6": 0.0})
    with pytest.raises(UnknownNameError, match="joint2"):
        TorqueLimits(heavy, efforts={"joint2": 3.0})
    assert TorqueLimits(heavy, efforts={"joint6": 3.0}).joints == ("joint6",)


@pytest.mark.parametrize(("damping", "dry"), [(0.0, 0.0), (0.0, 6.0), (40.0, 6.0)])
def test_a_cart_with_friction_moves_as_fast_as_its_equation_has_it(slid, damping, dry):
    """Full force until it must brake, and then full force back: m a = F - d v - f, and m a = -F - d v - f."""
    mechanism, recording = slid("1 0 0", friction=f'<dynamics damping="{damping}" friction="{dry}"/>')
    torques = TorqueLimits(mechanism)
    motion = resampled(recording, rate=1000.0, speed=math.inf, acceleration=NEVER, torques=lambda _: torques)

    def braking(speed, power):
        """The distance (power 1) or the time (power 0) from a speed to rest."""
        return quad(lambda v: MASS * v**power / (FORCE + dry + damping * v), 0.0, speed)[0]

    forwards = solve_ivp(lambda _, state: [state[1], (FORCE - dry - damping * state[1]) / MASS], (0.0, 9.0), [0.0, 0.0],
                         rtol=1e-10, atol=1e-12, dense_output=True).sol  # fmt: skip
    turning = brentq(lambda t: forwards(t)[0] + braking(forwards(t)[1], 1) - 1.0, 0.0, 9.0)
    wanted = turning + braking(forwards(turning)[1], 0)
    assert wanted - 0.002 <= motion.seconds <= 1.03 * wanted + 0.003
    v, a = np.gradient(motion.q[:, 0], 1e-3), np.diff(np.pad(motion.q[:, 0], 1, mode="edge"), 2) * 1e6
    forces = MASS * a + damping * v + dry * np.sign(v)
    assert np.abs(forces).max() <= FORCE * 1.001
    assert np.median(np.abs(forces)) > 0.95 * FORCE


def test_friction_of_passive_joints_slows_a_closed_mechanism(tmp_path):
    """Torques along the samples, computed by inverse dynamics with friction, keep the limits; without they are far."""
    text = parallelogram('range="-200 200"', 'damping="3"', 'damping="1" frictionloss="2"', coupler=1.0)
    motor = '<motor joint="drive" ctrlrange="-10 10" ctrllimited="true"/>'
    mechanism = cinegen.load(text.replace('<motor joint="drive"/>', motor))
    assert mechanism.limits["drive"].effort == 10.0
    turned = mechanism.q_home.copy()
    turned[mechanism.q_index("drive")] += 1.5
    turned = mechanism.close(turned, ["drive"])
    recording = record(tmp_path / "run.jsonl", mechanism, [0.0, 9.0], [mechanism.q_home, turned])
    torques = TorqueLimits(mechanism)
    motion = resampled(recording, rate=500.0, speed=math.inf, acceleration=NEVER, torques=lambda _: torques)
    with_friction = torques_along(cinegen.InverseDynamics(mechanism), motion.times, motion.q)
    assert 9.0 < with_friction.peak[0] <= 10.0
    assert motion.used == pytest.approx(with_friction.peak / 10.0, rel=1e-6)
    smooth = torques_along(cinegen.InverseDynamics(mechanism, friction=False), motion.times, motion.q)
    assert smooth.peak[0] > 10.0  # friction helps to brake


def test_what_torques_leave_out_is_in_the_report(slid):
    mechanism, _ = slid("1 0 0", friction='<dynamics damping="1" spring_stiffness="3"/>')
    assert TorqueLimits(mechanism).notes == ("forces leave out the springs of x",)
    crossing = TorqueLimits(mechanism, crosses=True).notes
    assert crossing[0] == "forces leave out the springs of x"
    assert "leave out the friction of joints" in crossing[1]


# --- singular crossing ------------------------------------------------------------------------------------------------
# Motions through singularities of type 2, and over points at which torques do not hold a mechanism at rest.


DOWN = (0.0, -9.81, 0.0)

UPPER, FORE = 0.25, 0.33


@pytest.fixture(scope="module")
def five_bar(root):
    """A five-bar whose outer bars can be in line, above its base."""
    text = (root / "robots/five_bar.raff").read_text()
    return massive(cinegen.load(re.sub(r"limits {[^}]*}", "", re.sub(r"\bd 400\.0", "d 330", text))))


def straight(five_bar, first, last, count=41):
    """Configurations along a line of the tool, elbows outwards: by the law of cosines."""
    configurations = []
    for tool in np.linspace(first, last, count):
        values = []
        for x, elbow in ((-0.15, -1.0), (0.15, 1.0)):
            values += two_bar_angles(tool[0] - x, tool[1], UPPER, FORE, elbow)[:2]
        configurations.append(five_bar.close(np.array([*values, 0.0]), five_bar.joints[:4]))
    return np.unwrap(configurations, axis=0)


def in_line(q):
    """The sine of the angle between the outer bars."""
    return np.sin(q[..., 0] + q[..., 1] - q[..., 2] - q[..., 3])


def heavy_limits(mechanism, efforts=40.0, **options):
    """Limits of the mechanism with random masses, which a recording does not contain."""
    return TorqueLimits(massive(mechanism), efforts=efforts, gravity=DOWN, **options)


@pytest.fixture(scope="module")
def fall(five_bar, tmp_path_factory):
    """The tool goes straight down, through the line of both elbows."""
    path = straight(five_bar, (0.02, 0.30), (0.02, 0.10))
    assert in_line(path[0]) * in_line(path[-1]) < 0.0
    return record(tmp_path_factory.mktemp("fall") / "fall.jsonl", five_bar, np.linspace(0.0, 2.0, len(path)), path)


def test_torques_stay_finite_and_pinocchio_s_dynamics_follow_them(five_bar, fall):
    """At rest no torques hold it there. Integrated by Pinocchio, these torques move it along the path."""
    dynamics, rate, limit = InverseDynamics(five_bar, gravity=DOWN), 2000.0, 40.0
    at_rest = np.abs([dynamics.torques(q) for q in fall.q["robot"]])
    assert at_rest.max() > 2.0 * limit
    torques = TorqueLimits(five_bar, efforts=limit, gravity=DOWN, crosses=True)
    motion = resampled(fall, rate=rate, speed=math.inf, acceleration=NEVER, torques=lambda _: torques)
    assert 0.9 < motion.used.max() <= 1.0
    q = motion.q
    v = (q[2:] - q[:-2]) * (0.5 * rate)
    a = (q[2:] - 2.0 * q[1:-1] + q[:-2]) * rate**2
    columns = [five_bar.v_index(joint) for joint in five_bar.actuated]
    by_model = constraint_dynamics(five_bar, DOWN)
    far = np.abs(in_line(q[1:-1])) > 0.02  # nearer, differences of samples are no accelerations
    assert (~far).sum() < 0.1 * len(far)
    needed = np.full((len(v), 2), np.nan)
    for k in np.flatnonzero(far):
        needed[k] = dynamics.torques(q[k + 1], *dynamics.motion(
            q[k + 1], *(dict(zip(five_bar.actuated, derivative[columns], strict=True)) for derivative in (v[k], a[k]))
        ))  # fmt: skip
    jumps = np.abs(np.diff(a[:, 1], prepend=a[:1, 1])) > 0.2 * np.abs(a[:, 1]).max()  # between two intervals of the law
    smooth = far & ~jumps & ~np.roll(jumps, -1)
    assert np.nanmax(np.abs(needed[smooth])) <= 1.05 * limit
    for k in range(2):
        needed[:, k] = np.interp(np.arange(len(v)), np.flatnonzero(far), needed[far, k])

    times = np.arange(len(v)) / rate

    def rates(t, state):
        return np.r_[state[5:], by_model(state[:5], state[5:], [np.interp(t, times, column) for column in needed.T])]

    followed = solve_ivp(rates, times[[0, -1]], np.r_[q[1], v[0]], t_eval=times, rtol=1e-6, max_step=1.0 / rate).y
    worst = np.abs(followed[:4].T - q[1:-1, :4]).max()
    assert worst < 0.03  # rad


def test_a_path_all_along_which_no_joint_moves_must_be_divided():
    """Each joint of a four-bar of three rockers rests somewhere: where two bars are in line, by the cosine rule."""

    def angle(a: float, b: float, opposite: float) -> float:
        return math.acos((a * a + b * b - opposite * opposite) / (2.0 * a * b))

    bars = cinegen.load(four_bar((60, -40, 100), (300, 500, 400, 350)))
    crank, last = angle(0.3, 0.5, 0.75), angle(0.5, 0.75, 0.3)
    path = [[crank, -crank - last, math.pi - last]]
    crank, last = angle(0.3, 0.15, 0.4), angle(0.15, 0.4, 0.3)
    path += [[crank, -crank - last, math.pi], [angle(0.5, 0.7, 0.35), 0.0, math.pi - angle(0.5, 0.35, 0.7)]]
    assert guided(bars, np.array(path[:2])).actuated == ("joint3",)
    with pytest.raises(CinegenError, match="no choice of 1 joint determines its motion all along this path: divide"):
        guided(bars, np.array(path))


def test_without_the_option_and_where_there_is_no_pace_it_is_refused(five_bar, fall, tmp_path):
    with pytest.raises(CinegenError, match=r"passes a type 2 singularity.* --cross-singularities"):
        resampled(fall, speed=math.inf, torques=heavy_limits)
    with pytest.raises(TimingError, match="some speed must keep torques within limits there"):
        resampled(fall, speed=math.inf, torques=partial(heavy_limits, efforts=22.0, crosses=True))
    ends_there = straight(five_bar, (0.02, 0.30), (0.02, 0.178))
    near = record(tmp_path / "near.jsonl", five_bar, np.linspace(0.0, 2.0, len(ends_there)), ends_there)
    with pytest.raises(CinegenError, match="to hold the mechanism at rest where the path ends"):
        resampled(near, speed=math.inf, torques=partial(heavy_limits, crosses=True))
    with pytest.raises(CinegenError, match=r"all actuated joints need limits .*: joint3"):
        TorqueLimits(five_bar, efforts={"joint1": 40.0}, crosses=True)
    with pytest.raises(CinegenError, match="jerks are not limited where a singularity is crossed"):
        resampled(fall, jerk=100.0, torques=partial(heavy_limits, crosses=True))


def test_the_option_of_the_command(root, fall, tmp_path, typed):
    """With the masses of the file and limits in it: too weak to hold the linkage at rest near the singularity."""
    text = re.sub(r"limits {[^}]*}", "", (root / "robots/five_bar.raff").read_text())
    five_bar = cinegen.load(text.replace("d 400.0", "d 330").replace("actuated 1", "effort 4 actuated 1"))
    way = straight(five_bar, (0.02, 0.30), (0.02, 0.10))
    assert np.nanmax(np.abs(InverseDynamics(five_bar, gravity=DOWN).torques_of(way))) > 4.0
    run = record(tmp_path / "weak.jsonl", five_bar, np.linspace(0.0, 2.0, len(way)), way)
    command = ["export", str(run.path), "--to", "csv", "--fastest", "--acceleration", "1000", "--force"]
    crossing = ["--torques", "--cross-singularities", "--gravity", "0,-9.81,0"]
    out = typed(*command, *crossing).out
    assert "of its 4 Nm" in out
    assert "DO NOT SEND" not in out
    assert "it passes through a type 2 singularity" in out
    assert "at a speed at which torques stay within their limits" in out
    assert "no type 2 singularity passed" not in out
    assert "--cross-singularities" in typed(*command, "--torques", "--gravity", "0,-9.81,0", code=1).err
    for option in (["--cross-singularities"], ["--gravity", "0,-9.81,0"]):
        assert f"{option[0]} has no effect without --torques" in typed(*command, *option, code=2).err


@pytest.fixture
def pendulum(tmp_path):
    """A point mass of 2 kg on a bar of 0.5 m, recorded from hanging down to standing upright."""
    body = """<inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
      <inertia ixx="1e-9" iyy="1e-9" izz="1e-9" ixy="0" ixz="0" iyz="0"/></inertial>"""
    hinge = UrdfJoint("pin", "base", "bar", axis="0 1 0", limit=(-4.0, 4.0), velocity=100.0)
    mechanism = cinegen.load(urdf_text([hinge], {"bar": body}))
    return record(tmp_path / "up.jsonl", mechanism, [0.0, 9.0], [[0.0], [math.pi]])


def test_only_the_ends_must_be_held_at_rest(pendulum):
    """A torque below m g l swings it up at once if its work, torque times pi, exceeds 2 m g l."""
    most = 2.0 * 9.81 * 0.5
    limits = partial(TorqueLimits, efforts=0.8 * most)
    motion = resampled(pendulum, rate=500.0, speed=math.inf, acceleration=NEVER, torques=limits)
    assert motion.used.max() <= 1.0
    angle = motion.q[:, 0]
    torque = 2.0 * 0.25 * np.diff(angle, 2) * 500.0**2 + most * np.sin(angle[1:-1])
    assert np.quantile(np.abs(torque), 0.98) <= 0.8 * most * 1.01
    assert motion.seconds < 3.0
    with pytest.raises(TimingError, match="do not hold the mechanism at rest"):
        resampled(pendulum, speed=math.inf, acceleration=NEVER, torques=partial(TorqueLimits, efforts=0.6 * most))
