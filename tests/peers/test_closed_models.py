"""Closed mechanisms as CAD exports them, in URDF and robot.yaml: and Cassie of others, in SDF."""

import sysconfig
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from urdf_text import UrdfJoint, urdf_text

import cinegen
import raff2urdf

CASSIE = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots/cassie_description/robots"

# Both ends of a loop are joints of their own, and at 0 all bars lie along x: the ends are far apart.
FIVE_BAR = [  # joint, parent, child, origin, axis
    ("motor1", "base", "inner1", "-0.15 0 0", "0 0 1"),
    ("elbow1", "inner1", "outer1", "0.25 0 0", "0 0 1"),
    ("end1", "outer1", "end_a", "0.4 0 0", "0 0 1"),
    ("motor2", "base", "inner2", "0.15 0 0", "0 0 1"),
    ("elbow2", "inner2", "outer2", "0.25 0 0", "0 0 1"),
    ("end2", "outer2", "end_b", "0.4 0 0", "0 0 1"),
]
SPATIAL = [  # a crank, a coupler with a ball joint of three axes, a rocker whose axis is askew
    ("crank", "base", "arm", "0 0 0", "0 0 1"),
    ("ball1", "arm", "a", "0.1 0 0", "1 0 0"),
    ("ball2", "a", "b", "0 0 0", "0 1 0"),
    ("ball3", "b", "coupler", "0 0 0", "0 0 1"),
    ("fixed", "coupler", "end_a", "0.5 0 0", None),
    ("rocker", "base", "lever", "0.4 0.1 0", "0.6 0 0.8"),
    ("tip", "lever", "end_b", "-0.3 0 0", None),
]
WRITTEN = {"five_bar": (FIVE_BAR, "6d", ["motor1", "motor2"]), "spatial": (SPATIAL, "3d", ["crank"])}
MODELS = {  # joints (a ball counts as three), loops, freedoms that loops leave to motors, to nothing
    "five_bar": (6, 1, 2, 1),
    "spatial": (5, 1, 1, 1),
    # left and right the same: hip roll, yaw and pitch, knee, shin or its spring, tarsus and foot, less what loops hold
    "cassie_v2": (22, 4, 12, 0),
    "cassie_simple": (27, 4, 11, 0),
}


@pytest.fixture(scope="module")
def file_of(tmp_path_factory):
    """`file_of(case)`: the path of a model."""

    def path(case):
        if case not in WRITTEN:
            return CASSIE / f"{case}.sdf"
        joints, kind, motors = WRITTEN[case]
        folder = tmp_path_factory.mktemp(case)
        kinds = [UrdfJoint(*row[:4], axis=row[4] or "", kind="revolute" if row[4] else "fixed") for row in joints]
        (folder / "robot.urdf").write_text(urdf_text([joint._replace(limit=(-3.2, 3.2)) for joint in kinds], name=case))
        (folder / "robot.yaml").write_text(f"closed_loop: [[end_a, end_b]]\ntype: [{kind}]\nname_mot: {motors}\n")
        return folder / "robot.urdf"

    return path


@pytest.fixture(params=MODELS)
def case(request):
    return request.param


@pytest.fixture(scope="module")
def loaded(file_of):
    """`loaded(case)`: a model, loaded once."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return {case: cinegen.load(file_of(case)) for case in MODELS}.__getitem__


@pytest.fixture
def mechanism(case, loaded, recwarn):
    return loaded(case)


def test_it_closes_at_the_first_try(case, mechanism):
    joints, loops, driven, idle = MODELS[case]
    assert (len(mechanism.joints) + 3 * len(mechanism.balls), len(mechanism.loops)) == (joints, loops)
    assert mechanism.closure(mechanism.q_home) < 1e-12
    left = len(mechanism.structure.passive_columns) - mechanism.structure.passive_rank
    assert (mechanism.mobility - left, left) == (driven, idle)
    assert len(mechanism.actuated) == driven


@pytest.mark.parametrize("case", WRITTEN)
def test_its_ends_lie_far_apart_at_neutral(mechanism):
    neutral = pin.neutral(mechanism.model)
    for loop in mechanism.loops:
        first, second = (mechanism.placement(neutral, node) for node in (loop.first, loop.second))
        assert np.linalg.norm(first.translation - second.translation) > 0.1 * mechanism.length
    assert mechanism.gap_as_written > 0.5


def test_constraint_jacobians_and_mobility_are_those_of_finite_differences(mechanism):
    step, basis = 1e-6, np.eye(mechanism.model.nv)

    def residual(q, direction):
        return mechanism.loop_residual(pin.integrate(mechanism.model, q, direction))

    for q in [mechanism.q_home, *mechanism.random_closed(3)]:
        slopes = [(residual(q, step * way) - residual(q, -step * way)) / (2.0 * step) for way in basis]
        assert np.allclose(np.column_stack(slopes), mechanism.loop_jacobian(q), atol=1e-8)
        assert mechanism.mobility == mechanism.model.nv - np.linalg.matrix_rank(np.column_stack(slopes), tol=1e-7)


@pytest.mark.parametrize("case", ["five_bar", "cassie_v2"])
def test_dragged_about_it_does_not_tear(mechanism):
    """Its end is pulled to and fro, further than it can go: loops closed in every tick, no joint leaps."""
    solver = cinegen.Solver(mechanism, 1e-3)
    end = mechanism.end
    home = mechanism.placement(mechanism.q_home, end)
    task = solver.add_task(end, home, rotation=0)
    q = solver.q.copy()
    worst = leap = 0.0
    for tick in range(1000):
        phase = 2.0 * np.pi * tick / 500
        offset = mechanism.length * np.array([np.sin(phase), np.sin(2.0 * phase), np.cos(phase) - 1.0])
        task.target = pin.SE3(home.rotation, home.translation + offset)
        step = solver.step()
        worst = max(worst, step.closure)
        leap = max(leap, float(np.abs(pin.difference(mechanism.model, q, solver.q)).max()))
        q = solver.q.copy()
    assert worst <= 1e-10  # what the solver grants, at singularities too
    assert leap < 0.2
    assert np.linalg.norm(mechanism.placement(q, end).translation - home.translation) < 3.0 * mechanism.length


def test_a_loop_that_is_cut_by_a_ball_leaves_it_free(file_of):
    held = cinegen.load(file_of("five_bar"))
    name = held.loops[0].name
    ball = cinegen.load(file_of("five_bar"), loops={name: "ball"})
    assert ball.mobility == held.mobility + 1  # both ends turn on their own then


@pytest.mark.parametrize("case", ["five_bar", "spatial", "cassie_v2"])
def test_it_can_be_said_in_raff(case, mechanism, file_of, tmp_path):
    original = mechanism
    conversion = raff2urdf.to_raff(file_of(case), tmp_path / "it.raff", graphics=False)
    nodes = {link: node for link, node in conversion.nodes.items() if link in original.nodes}
    ours = cinegen.load(tmp_path / "it.raff")
    assert ours.mobility == original.mobility
    assert ours.loop_rank == original.loop_rank
    if case != "cassie_v2":
        assert {conversion.joints[joint] for joint in original.actuated} == set(ours.actuated)
    for q in (original.q_home, *original.random_closed(3)):
        values = {conversion.joints[joint]: q[original.q_index(joint)] for joint in original.joints}
        p = ours.configuration({joint: value + conversion.offsets[joint] for joint, value in values.items()})
        assert ours.closure(p) < 1e-11
        for link, node in nodes.items():
            expected, pose = original.placement(q, link).homogeneous, ours.placement(p, node).homogeneous
            assert np.abs(expected - pose).max() < 1e-9
