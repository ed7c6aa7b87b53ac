"""Motions through singularities of type 2, and over points at which torques do not hold a mechanism at rest."""

import math
import re
from functools import partial

import numpy as np
import pinocchio as pin
import pytest
from pinocchio_constraints import constraint_dynamics
from random_masses import free_motions, massive
from recorded import record
from scipy.optimize import brentq

import cinegen
from cinegen.cli import main
from cinegen.dynamics import InverseDynamics
from cinegen.errors import CinegenError
from cinegen.mission import resampled
from cinegen.planning.singular_crossing import CrossingDynamics, guided
from cinegen.planning.timing import TimingError
from cinegen.planning.torque_limits import TorqueLimits

DOWN = (0.0, -9.81, 0.0)
NEVER = 1e4  # a limit of acceleration that is not reached
UPPER, FORE = 0.25, 0.33


@pytest.fixture(scope="module")
def five_bar(root, tmp_path_factory):
    """A five-bar whose outer bars can be in line, above its base."""
    text = (root / "robots/five_bar.raff").read_text()
    path = tmp_path_factory.mktemp("five_bar") / "five_bar.raff"
    path.write_text(re.sub(r"limits {[^}]*}", "", re.sub(r"\bd 400\.0", "d 330", text)))
    return massive(cinegen.load(path))


def straight(five_bar, first, last, count=41):
    """Configurations along a line of the tool, elbows outwards: by the law of cosines."""
    found = []
    for tool in np.linspace(first, last, count):
        values = []
        for x, side in ((-0.15, 1.0), (0.15, -1.0)):
            far = tool - (x, 0.0)
            length = np.hypot(*far)
            angle = math.atan2(far[1], far[0]) + side * math.acos(
                (length**2 + UPPER**2 - FORE**2) / (2.0 * UPPER * length)
            )
            outer = tool - (x, 0.0) - UPPER * np.array([math.cos(angle), math.sin(angle)])
            values += [angle, math.atan2(outer[1], outer[0]) - angle]
        found.append(five_bar.close(np.array([*values, 0.0]), five_bar.joints[:4]))
    return np.unwrap(found, axis=0)


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
            q[k + 1], *(dict(zip(five_bar.actuated, one[columns], strict=True)) for one in (v[k], a[k]))
        ))  # fmt: skip
    jumps = np.abs(np.diff(a[:, 1], prepend=a[:1, 1])) > 0.2 * np.abs(a[:, 1]).max()  # between two intervals of the law
    smooth = far & ~jumps & ~np.roll(jumps, -1)
    assert np.nanmax(np.abs(needed[smooth])) <= 1.05 * limit
    for k in range(2):
        needed[:, k] = np.interp(np.arange(len(v)), np.flatnonzero(far), needed[far, k])

    def rates(state, torque):
        return np.r_[state[5:], by_model(state[:5], state[5:], torque)]

    state, step = np.r_[q[1], v[0]], 1.0 / rate
    worst = 0.0
    for k in range(len(v) - 1):
        torque, ahead = needed[k], needed[k + 1]
        one = rates(state, torque)
        two = rates(state + 0.5 * step * one, 0.5 * (torque + ahead))
        three = rates(state + 0.5 * step * two, 0.5 * (torque + ahead))
        four = rates(state + step * three, ahead)
        state = state + step / 6.0 * (one + 2.0 * two + 2.0 * three + four)
        worst = max(worst, np.abs(state[:4] - q[k + 2, :4]).max())
    assert worst < 0.03  # rad


def test_the_condition_at_the_singularity(five_bar):
    """With all actuated joints locked, gravity and inertia do no work on the motion that remains."""
    path = straight(five_bar, (0.02, 0.30), (0.02, 0.10), 9)
    driven = guided(five_bar, path)
    dynamics = CrossingDynamics(InverseDynamics(five_bar, gravity=DOWN), driven)
    height = brentq(lambda y: in_line(straight(five_bar, (0.02, y), (0.02, y), 1)[0]), 0.10, 0.30, xtol=1e-14)
    here = straight(five_bar, (0.02, height), (0.02, height), 1)[0]
    tangent, bend = np.array([1.0, -0.4]), np.array([0.3, 0.2])
    inertial, centrifugal, static, weight = dynamics.terms(here, tangent, bend)
    assert weight < 1e-9
    square = 3.0
    growth = -(centrifugal[0] * square + static[0]) / inertial[0]
    zero = inertial * growth + centrifugal * square + static
    assert zero == pytest.approx([0.0, 0.0], abs=1e-9 * np.abs(static).max())
    guide = [five_bar.joints.index(name) for name in driven.actuated]
    body = InverseDynamics(driven, gravity=DOWN)
    v, a = body.motion(
        here,
        dict(zip(driven.actuated, (math.sqrt(square) * tangent).tolist(), strict=True)),
        dict(zip(driven.actuated, (growth * tangent + square * bend).tolist(), strict=True)),
    )
    assert v[guide] == pytest.approx(math.sqrt(square) * tangent)
    model = pin.Model(five_bar.model)
    model.gravity.linear = np.array(DOWN)
    tree = pin.rnea(model, model.createData(), here, v, a)
    free = free_motions(five_bar, here)
    locked = free @ np.linalg.svd(free[[0, 2]])[2][-1]  # hardly moves joint1 and joint3
    assert np.abs(locked[[0, 2]]).max() < 1e-9
    assert locked @ tree == pytest.approx(0.0, abs=1e-8 * np.abs(tree).max())


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


def test_the_option_of_the_command(root, fall, tmp_path, capsys):
    """With the masses of the file and limits in it: too weak to hold the linkage at rest near the singularity."""
    text = re.sub(r"limits {[^}]*}", "", (root / "robots/five_bar.raff").read_text())
    path = tmp_path / "weak.raff"
    path.write_text(text.replace("d 400.0", "d 330").replace("actuated 1", "effort 4 actuated 1"))
    five_bar = cinegen.load(path)
    way = straight(five_bar, (0.02, 0.30), (0.02, 0.10))
    assert np.nanmax(np.abs(InverseDynamics(five_bar, gravity=DOWN).torques_of(way))) > 4.0
    run = record(tmp_path / "weak.jsonl", five_bar, np.linspace(0.0, 2.0, len(way)), way)
    command = ["export", str(run.path), "--to", "csv", "--fastest", "--acceleration", "1000", "--force"]
    crossing = ["--torques", "--cross-singularities", "--gravity", "0,-9.81,0"]
    assert main([*command, *crossing]) == 0
    out = capsys.readouterr().out
    assert "of its 4 Nm" in out
    assert "DO NOT SEND" not in out
    assert "it passes through a type 2 singularity" in out
    assert "at a speed at which torques stay within their limits" in out
    assert "no type 2 singularity passed" not in out
    assert main([*command, "--torques", "--gravity", "0,-9.81,0"]) == 1
    assert "--cross-singularities" in capsys.readouterr().err
    for option in (["--cross-singularities"], ["--gravity", "0,-9.81,0"]):
        assert main([*command, *option]) == 2
        assert f"{option[0]} has no effect without --torques" in capsys.readouterr().err


@pytest.fixture
def pendulum(tmp_path):
    """A point mass of 2 kg on a bar of 0.5 m, recorded from hanging down to standing upright."""
    path = tmp_path / "pendulum.urdf"
    path.write_text("""<robot name="pendulum"><link name="base"/><link name="bar"><inertial><origin xyz="0 0 -0.5"/>
      <mass value="2"/><inertia ixx="1e-9" iyy="1e-9" izz="1e-9" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="pin" type="revolute"><parent link="base"/><child link="bar"/><axis xyz="0 1 0"/>
      <limit lower="-4" upper="4" effort="1" velocity="100"/></joint></robot>""")
    mechanism = cinegen.load(path)
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
