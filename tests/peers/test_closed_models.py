"""Closed mechanisms of others: Cassie (SDF), and two of Gepetto's example-parallel-robots (URDF and robot.yaml)."""

from __future__ import annotations

import sysconfig
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import cinegen
import raff2urdf

GEPETTO = Path(__file__).parent / "data/example-parallel-robots"
CASSIE = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots/cassie_description/robots"

MODELS = {  # path, joints (a ball counts as three), loops, freedoms that loops leave to motors, to nothing
    "5bar": (GEPETTO / "5bar_linkage/robot.urdf", 6, 1, 2, 1),
    "delta": (GEPETTO / "robot_delta/robot.urdf", 14, 3, 2, 3),
    # left and right the same: hip roll, yaw and pitch, knee, shin or its spring, tarsus and foot, less what loops hold
    "cassie_v2": (CASSIE / "cassie_v2.sdf", 22, 4, 12, 0),
    "cassie_reduced": (CASSIE / "cassie_reduced.sdf", 23, 4, 11, 0),
    "cassie_simple": (CASSIE / "cassie_simple.sdf", 27, 4, 11, 0),
    "cassie_wo_gearbox_spring": (CASSIE / "cassie_wo_gearbox_spring.sdf", 27, 4, 13, 0),
}


@pytest.fixture(params=MODELS)
def case(request):
    return request.param


@pytest.fixture
def mechanism(case, recwarn):
    return cinegen.load(MODELS[case][0])


def test_it_closes_at_the_first_try(case, mechanism):
    _, joints, loops, driven, idle = MODELS[case]
    assert (len(mechanism.joints) + 3 * len(mechanism.balls), len(mechanism.loops)) == (joints, loops)
    assert mechanism.closure(mechanism.q_home) < 1e-12
    left = len(mechanism.passive_columns) - mechanism.passive_rank
    assert (mechanism.mobility - left, left) == (driven, idle)
    assert len(mechanism.actuated) == driven


@pytest.mark.parametrize("name", ["5bar", "delta"])
def test_its_ends_lie_far_apart_at_neutral(name, recwarn):
    mechanism = cinegen.load(MODELS[name][0])
    neutral = pin.neutral(mechanism.model)
    for loop in mechanism.loops:
        first, second = (mechanism.placement(neutral, node) for node in (loop.first, loop.second))
        assert np.linalg.norm(first.translation - second.translation) > 0.1 * mechanism.length
    assert mechanism.gap_as_written > 1.0  # rad


def test_constraint_jacobians_are_those_of_finite_differences(mechanism):
    rng = np.random.default_rng(0)
    for q in [
        mechanism.q_home,
        *mechanism.random_closed(3),
        pin.integrate(mechanism.model, mechanism.q_home, rng.normal(size=mechanism.model.nv) / 10),
    ]:
        jacobian, step = mechanism.loop_jacobian(q), 1e-6
        for column in range(mechanism.model.nv):
            ahead, behind = (
                mechanism.loop_residual(
                    pin.integrate(mechanism.model, q, sign * step * np.eye(mechanism.model.nv)[column])
                )
                for sign in (1.0, -1.0)
            )
            assert np.allclose((ahead - behind) / (2.0 * step), jacobian[:, column], atol=1e-8)


def test_its_freedoms_are_those_of_finite_differences(mechanism):
    """The rank of the loops, counted without our Jacobian, wherever it is closed: the freedoms that are left."""
    for q in mechanism.random_closed(3):
        columns, step = [], 1e-5
        for direction in np.eye(mechanism.model.nv):
            ahead, behind = (
                mechanism.loop_residual(pin.integrate(mechanism.model, q, sign * step * direction))
                for sign in (1.0, -1.0)
            )
            columns.append((ahead - behind) / (2.0 * step))
        rank = np.linalg.matrix_rank(np.column_stack(columns), tol=1e-7)
        assert mechanism.mobility == mechanism.model.nv - rank


def test_dragged_about_it_does_not_tear(mechanism):
    """Its end is pulled to and fro, further than it can go: loops closed in every tick, no joint leaps."""
    solver = cinegen.Solver(mechanism, 1e-3)
    end = mechanism.end
    home = mechanism.placement(mechanism.q_home, end)
    task = solver.add_task(end, home, rotation=0)
    q = solver.q.copy()
    worst = leap = 0.0
    start = home.translation.copy()
    for tick in range(1500):
        phase = 2.0 * np.pi * tick / 500
        offset = mechanism.length * np.array([np.sin(phase), np.sin(2.0 * phase), np.cos(phase) - 1.0])
        task.target = pin.SE3(home.rotation, start + offset)
        step = solver.step()
        worst = max(worst, step.closure)
        leap = max(leap, float(np.abs(pin.difference(mechanism.model, q, solver.q)).max()))
        q = solver.q.copy()
    assert worst <= 1e-10  # what the solver grants, at singularities too
    assert leap < 0.2
    assert np.linalg.norm(mechanism.placement(q, end).translation - start) < 3.0 * mechanism.length


def test_a_loop_that_is_cut_by_a_ball_leaves_it_free(recwarn):
    held = cinegen.load(MODELS["5bar"][0])
    name = held.loops[0].name
    ball = cinegen.load(MODELS["5bar"][0], loops={name: "ball"})
    assert ball.mobility == held.mobility + 1  # both ends turn on their own then


@pytest.mark.parametrize("case", ["5bar", "delta", "cassie_v2"])
def test_it_can_be_said_in_raff(case, tmp_path, recwarn):
    original = cinegen.load(MODELS[case][0])
    found = raff2urdf.to_raff(MODELS[case][0], tmp_path / "it.raff", graphics=False)
    nodes = {link: node for link, node in found.nodes.items() if link in original.nodes}
    ours = cinegen.load(tmp_path / "it.raff")
    assert ours.mobility == original.mobility
    assert ours.loop_rank == original.loop_rank
    if case != "cassie_v2":
        assert {found.joints[joint] for joint in original.actuated} == set(ours.actuated)
    for q in (original.q_home, *original.random_closed(3)):
        values = {
            found.joints[joint]: q[original.q_index(joint)] + found.offsets[found.joints[joint]]
            for joint in original.joints
        }
        p = ours.configuration(values)
        assert ours.closure(p) < 1e-11
        for link, node in nodes.items():
            there, here = original.placement(q, link).homogeneous, ours.placement(p, node).homogeneous
            assert np.abs(there - here).max() < 1e-9
