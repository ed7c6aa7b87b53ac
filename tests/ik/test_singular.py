"""Singularities against closed forms: which direction is lost, which motion is gained."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loop_openings import Openings, pin_screws
from planar import ROCKER, TWO_R, singular_values, two_r

from cinegen import Solver

DT = 0.01
seeds = st.integers(0, 2**32 - 1)
ROBOTS = ["planar_3r", "serial_5dof", "arm7", "five_bar", "delta4", "hybrid", "sr400"]
LOOPED = ["five_bar", "planar_hybrid", "delta4", "gough", "hybrid", "sr400"]


def _unit(mechanism):
    return np.array([mechanism.length] * 3 + [1.0] * 3)


def _world(mechanism, q, node):
    """(6, nv) Jacobian of a node in the world's axes."""
    turn = np.kron(np.eye(2), mechanism.placement(q, node).rotation)
    return turn @ mechanism.jacobian(q, node)


def _random(mechanism, seed):
    return mechanism.random_closed(1, seed)[-1]


# --- type 1 ----------------------------------------------------------------------------------------------------------


def test_a_two_r_arm_loses_what_its_closed_form_says(raff):
    a, b = 0.4, 0.3
    arm = raff(TWO_R % {"first": 30, "second": 40, "a": 1000 * a, "b": 1000 * b})
    for second in (0.6, 0.1, 1e-3, 1e-6, -0.4, math.pi - 0.2):
        q = arm.configuration({"joint1": 0.7, "joint2": second})
        solver = Solver(arm, DT, q=q)
        solver.add_task("tool", rotation=0)
        step = solver.step()
        lost = step.lost_dof
        greater, smaller = singular_values(two_r(a, b, 0.7, second) / arm.length)
        assert lost.sigma == pytest.approx(smaller, abs=1e-12)
        assert step.singular_values == pytest.approx([greater, smaller], abs=1e-12)


@given(seeds, st.sampled_from(ROBOTS))
def test_along_the_weakest_joint_direction_pulls_move_by_sigma(robot, seed, name):
    """J v = sigma t, loops closed to first order, both of unit length; nothing moves the tasks less."""
    mechanism = robot(name)
    q = _random(mechanism, seed)
    solver = Solver(mechanism, DT, q=q)
    solver.add_task(mechanism.end)
    step = solver.step()
    lost, unit = step.lost_dof, _unit(mechanism)
    jacobian = _world(mechanism, step.q, mechanism.end)
    assert jacobian @ lost.joints / unit == pytest.approx(lost.sigma * lost.twists[0] / unit, abs=1e-9)
    mechanism.structure.system.evaluate(step.q)
    cut = mechanism.structure.system.cut_rates() @ (lost.joints / mechanism.scale)
    assert np.linalg.norm([*(lost.joints / mechanism.scale), *cut]) == pytest.approx(1.0)
    assert np.linalg.norm(lost.twists[0] / unit) == pytest.approx(1.0)
    if mechanism.is_constrained:
        assert mechanism.loop_jacobian(step.q) @ lost.joints == pytest.approx(0.0, abs=1e-9)
    assert lost.sigma == pytest.approx(step.singular_values[-1], abs=1e-9)


@given(seeds)
def test_several_pulls_of_any_weight_share_one_direction(robot, seed):
    mechanism, rng = robot("hybrid"), np.random.default_rng(seed)
    nodes, weights = ("tool", "link2"), rng.uniform(0.2, 5.0, 2)
    solver = Solver(mechanism, DT, q=_random(mechanism, seed))
    for node, weight in zip(nodes, weights, strict=True):
        solver.add_task(node, weight=weight, axes=str(rng.choice(["target", "world", "tool"])))
    step = solver.step()
    lost, unit = step.lost_dof, _unit(mechanism)
    total = 0.0
    for node, weight, twist in zip(nodes, weights / weights.max(), lost.twists, strict=True):
        moved = _world(mechanism, step.q, node) @ lost.joints
        assert moved / unit == pytest.approx(lost.sigma * twist / unit, abs=1e-9)
        total += np.linalg.norm(weight * twist / unit) ** 2
    assert total == pytest.approx(1.0)


# --- type 2 ----------------------------------------------------------------------------------------------------------


def _pins(mechanism, q):
    """(4, 2) where a four-bar's pins are; the first is actuated."""
    return np.array([mechanism.placement(q, node).translation[:2] for node in ("link1", "link2", "link3", "frame4")])


def test_a_four_bar_gains_a_motion_as_its_closed_form_says(robot):
    bar = robot("four_bar")
    for q in bar.random_closed(20, seed=1):
        solver = Solver(bar, DT, q=q)
        step = solver.step()
        expected = np.linalg.svd(pin_screws(_pins(bar, q), _pins(bar, bar.q_home))[:, 1:], compute_uv=False)
        assert step.passive_singular_values == pytest.approx(expected, abs=1e-12)
        assert step.uncontrolled_dof.sigma == pytest.approx(expected[2], abs=1e-12)


def test_a_four_bar_driven_by_its_rocker_has_a_dead_point(raff):
    bar = raff(ROCKER)
    a, b, c, d = 0.12, 0.36, 0.24, 0.4
    crank = math.acos(((a + b) ** 2 + d**2 - c**2) / (2 * (a + b) * d))  # stretched: the law of cosines
    rocker = math.pi - math.acos((c**2 + d**2 - (a + b) ** 2) / (2 * c * d))
    q = bar.close(bar.configuration({"joint1": crank, "joint2": 0.0, "joint3": rocker}))
    assert bar.closure(q) < 1e-12
    step = Solver(bar, DT, q=q).step()
    gained = step.uncontrolled_dof
    assert gained.sigma < 1e-6  # closing leaves the square root of rounding
    # crank and coupler buckle, the rocker stands: the pin stays where it is to first order
    expected = {"joint1": b, "joint2": -(a + b), "joint3": 0.0}
    size = math.hypot(*expected.values(), a)  # and the cut pin's
    for joint, value in expected.items():
        assert abs(gained.joints[bar.v_index(joint)]) == pytest.approx(abs(value) / size, abs=1e-6)
    assert gained.joints[bar.v_index("joint1")] * gained.joints[bar.v_index("joint2")] < 0.0
    assert bar.loop_jacobian(q) @ gained.joints == pytest.approx(0.0, abs=1e-6)
    for h in (1e-2, 1e-3):  # moved along it with the motor held, loops open by its square only
        assert bar.closure(pin.integrate(bar.model, q, h * gained.joints)) < 2.0 * h * h


@given(seeds, st.sampled_from(LOOPED))
def test_along_the_gained_motion_loops_open_by_sigma(robot, seed, name):
    mechanism = robot(name)
    q = _random(mechanism, seed)
    step = Solver(mechanism, DT, q=q).step()
    gained = step.uncontrolled_dof
    motors = [mechanism.v_index(joint) for joint in mechanism.actuated]
    assert not gained.joints[motors].any()
    assert gained.sigma == pytest.approx(step.passive_singular_values[-1])
    opened = Openings(mechanism).matrix(q)
    cut = opened.shape[1] - mechanism.model.nv
    assert len(step.passive_singular_values) == mechanism.loop_rank + cut  # the actuated joints determine all
    passive = np.delete(opened, motors, axis=1)
    values = np.linalg.svd(passive, compute_uv=False)
    assert step.passive_singular_values == pytest.approx(values[: mechanism.loop_rank + cut], abs=1e-7)
    of_joints, of_cut = np.split(opened, [mechanism.model.nv], axis=1)
    joints = gained.joints / mechanism.scale
    # the cut joints follow so that |K x| = sigma |x| is least
    follow = -np.linalg.solve(of_cut.T @ of_cut - gained.sigma**2 * np.eye(cut), of_cut.T @ of_joints @ joints)
    assert np.linalg.norm([*joints, *follow]) == pytest.approx(1.0)
    assert np.linalg.norm(of_joints @ joints + of_cut @ follow) == pytest.approx(gained.sigma, abs=1e-7)


def test_a_joint_that_no_motor_determines_is_no_singularity(raff):
    """A coupler's end with a link hanging from it, without a motor: idle everywhere, so nothing is gained there."""
    idle = raff(ROCKER.replace("frame 4 {", "link 6 { parameters { d 100 } type 2 pred 2 actuated 0 }\n    frame 4 {"))
    bar = raff(ROCKER, name="plain")
    assert len(idle.structure.passive_columns) == 3
    assert idle.structure.passive_rank == 2
    q = Solver(idle, DT).step()
    assert q.passive_singular_values == pytest.approx(Solver(bar, DT).step().passive_singular_values)
    assert q.uncontrolled_dof.joints[idle.v_index("joint6")] == pytest.approx(0.0, abs=1e-12)


def test_values_do_not_change_with_later_ticks(robot):
    delta = robot("delta4")
    solver = Solver(delta, DT)
    task = solver.add_task("platform")
    step = solver.step()
    before = step.lost_dof.joints, step.uncontrolled_dof.joints, step.passive_singular_values
    task.target.translation += [0.2, 0.1, -0.1]
    solver.step()
    for one, other in zip(
        before, (step.lost_dof.joints, step.uncontrolled_dof.joints, step.passive_singular_values), strict=True
    ):
        assert np.array_equal(one, other)
