"""What holds a driven robot at rest: payloads, bases that tilt, singularities, robots without masses."""

import numpy as np
import pinocchio as pin
import pytest
from variants import FEWER

import cinegen
from cinegen.dynamics import Payload
from cinegen.session import commands as c
from cinegen.session.holding import BearingReporter, Holding, why_no_forces
from cinegen.session.state import CarriedMass

pytestmark = pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")
STANDING = pin.SE3(pin.rpy.rpyToMatrix(np.pi / 2, 0.0, 0.0), np.zeros(3))  # what lay flat stands


def test_the_torques_are_those_of_the_configuration_and_the_payload(session, robot):
    """A drag moves the robot; its torques balance the change of its potential energy, by finite differences."""
    one, delta = session("delta4"), robot("delta4")
    begin = delta.placement(delta.q_home, "platform").translation
    one.obey(c.StartDrag("delta4", "platform"))
    one.obey(c.MoveDrag(tuple(begin + np.array([0.2, -0.1, 0.1]))))
    one.obey(c.SetPayload("delta4", "link3", 7.5))
    for _ in range(500):
        one.tick()
    state = one.state().robots["delta4"]
    assert state.carried == CarriedMass("link3", 7.5)

    def energy(q):
        data = delta.model.createData()
        weight = pin.computePotentialEnergy(delta.model, data, q)
        return weight + 9.81 * 7.5 * delta.placement(q, "link3").translation[2]

    step, indices = 1e-5, [delta.q_index(name) for name in delta.actuated]
    for column, index in enumerate(indices):
        sides = []
        for sign in (1.0, -1.0):
            q = state.q.copy()
            q[index] += sign * step
            sides.append(energy(delta.close(q, locked=delta.actuated)))
        assert state.torques[column] == pytest.approx((sides[0] - sides[1]) / (2 * step), rel=1e-6)


def test_gravity_is_the_worlds_also_on_a_base_that_tilts(session, robot):
    lying, standing = session("five_bar"), session("five_bar", bases=["five_bar=0,0,0,90,0,0"])
    assert np.abs(lying.state().robots["five_bar"].torques).max() < 1e-9
    torques = standing.state().robots["five_bar"].torques
    five_bar = robot("five_bar")
    expected = cinegen.forces(five_bar, five_bar.q_home, gravity=STANDING.rotation.T @ [0, 0, -9.81]).torques
    assert np.abs(expected).min() > 0.1
    np.testing.assert_allclose(torques, expected, rtol=1e-9)


def test_a_robot_without_masses_has_no_torques_and_carries_nothing(session, robot):
    one = session("tssm", "delta4")
    one.obey(c.SetPayload("tssm", "platform", 1.0))
    state = one.state()
    assert state.robots["tssm"].torques is None
    assert state.robots["tssm"].carried is None
    assert state.robots["delta4"].torques is not None
    assert state.notices[-1].warning
    assert "tssm carries no payload: no mass is given for " in state.notices[-1].text
    for link in robot("tssm").massless:
        assert link in why_no_forces(robot("tssm"))


def stretched(turn=0.0):
    """The five-bar's values with both outer bars in one line; the left motor is turned back."""
    return np.radians([180.0, -180.0, 0.0, 180.0, -180.0]) - turn * np.array([1.0, -1.0, 0.0, 0.0, 0.0])


def test_no_torques_hold_a_load_in_a_singularity_and_next_to_it(robot):
    five_bar = robot("five_bar")
    holding = Holding(five_bar)
    holding.load(CarriedMass("tool", 2.0), STANDING)
    assert five_bar.closure(stretched()) < 1e-12
    assert np.isnan(holding.torques(stretched())).all()
    near, far = (five_bar.close(stretched(turn), locked=five_bar.actuated) for turn in (1e-7, 0.1))
    down = STANDING.rotation.T @ [0.0, 0.0, -9.81]
    largest = np.abs(cinegen.forces(five_bar, near, payloads=[Payload("tool", 2.0)], gravity=down).torques).max()
    assert not largest < 1e3  # N m, or NaN: of 3 kg, at 0.4 m
    assert np.isnan(holding.torques(near)).all()
    assert np.isfinite(holding.torques(far)).all()


def test_reactions_balance_each_other_and_undetermined_ones_are_named(session, robot):
    """The forces on a platform, of all joints and loops that it has, carry its weight and its payload."""
    one, delta = session("delta4", bases=["delta4=1,1,1,20,10,5"]), robot("delta4")
    one.obey(c.SetPayload("delta4", delta.end, 4.0))
    state = one.state().robots["delta4"]
    found = BearingReporter(delta).report(state)
    assert [report.undetermined for report in found] == [()] * 17
    joints, loops = found[:15], found[15:]
    assert [report.kind for report in loops] == ["loop", "loop"]
    on = {delta.model.frames[delta.frame_id(report.node)].parentJoint for report in found}
    assert len(on) == 15
    carrier = delta.model.frames[delta.frame_id(delta.end)].parentJoint
    own = sum(
        np.array(report.force)
        for report in found
        if delta.model.frames[delta.frame_id(report.node)].parentJoint == carrier
    )
    firsts = [loop.first for loop in delta.loops]
    against = sum(
        np.array(report.force)
        for report, first in zip(loops, firsts, strict=True)
        if delta.model.frames[delta.frame_id(first)].parentJoint == carrier
    )
    weight = 9.81 * (delta.model.inertias[carrier].mass + 4.0)
    np.testing.assert_allclose(own - against, [0.0, 0.0, weight], atol=1e-8 * weight)
    for report in joints:
        joint = delta.model.getJointId(report.name)
        data = delta.model.createData()
        pin.forwardKinematics(delta.model, data, state.q)
        at = delta.placement(state.q, report.node).act(np.array(report.point))
        np.testing.assert_allclose(at, data.oMi[joint].translation, atol=1e-12)


def test_a_description_lists_actuated_joints_in_the_order_of_the_torques(robot):
    for name in FEWER:
        mechanism = robot(name)
        assert tuple(joint for joint in mechanism.joints if joint in mechanism.actuated) == mechanism.actuated
