"""What holds for every robot of the repository, whatever it is."""

import re

import numpy as np
import pinocchio as pin
import pytest
from elementary import ROBOTS, document, placed, values, within_limits
from repository import EVERY, load, one_of_each_kind

import cinegen
from raff2urdf.loops.mobility import analyse

every_robot = pytest.mark.parametrize(("name", "which"), EVERY)


def header(name: str) -> str:
    """The comment at the top of a file."""
    lines = (ROBOTS / f"{name}.raff").read_text(encoding="utf-8").splitlines()[1:]
    comment = []
    for line in lines:
        if line and not line.startswith("//"):
            break
        comment.append(line.removeprefix("//").strip())
    return "\n".join(comment)


def configurations(mechanism: cinegen.Mechanism, count: int, seed: int = 0) -> list[tuple[np.ndarray, bool]]:
    """Home, random closed configurations, and the same disturbed: open if there are loops."""
    rng = np.random.default_rng(seed)
    closed = [mechanism.q_home, *mechanism.random_closed(count, seed)]
    open_ = [q + rng.normal(0.0, 0.3, len(q)) * mechanism.scale for q in closed]
    return [(q, True) for q in closed] + [(q, False) for q in open_]


@every_robot
def test_it_has_the_mobility_of_its_header_motors_for_it_and_an_end_that_a_sensor_may_constrain(name, which):
    mechanism = load(name, which)
    match = re.search(r"^Mobility\s+(.*?)(?=\n\S+ {2,}|\n\n|\Z)", header(name), re.MULTILINE | re.DOTALL)
    assert match, "the header states no mobility"
    by_robot = dict((robot, int(count)) for count, robot in re.findall(r"(\d+) \((\w+)\)", match[1]))
    stated = by_robot[which] if len(document(name).robots) > 1 else int(re.match(r"\d+", match[1])[0])
    assert mechanism.mobility == len(mechanism.actuated) == stated
    analysis = analyse(document(name), document(name).robot(which))  # the converter's, without Pinocchio
    assert (analysis.mobility, analysis.actuated) == (stated, mechanism.actuated)
    end = document(name).robot(which).parts[-1].node
    assert end in ("tool", "platform")
    assert (mechanism.nodes[-1], mechanism.sensor_constraints) == (end, ((end, (0, 1)),))
    assert list(mechanism.sensors) == [1]


@every_robot
def test_home_is_closed_within_limits_and_what_the_file_states_but_for_its_rounding(name, which):
    mechanism, text = load(name, which), document(name)
    assert mechanism.closure(mechanism.q_home) <= 1e-12
    assert within_limits(mechanism, mechanism.q_home)
    assert mechanism.gap_as_written <= 1e-5
    for link in text.robot(which).links:
        if link.joint in mechanism.joints:
            r, theta = link.parameters.r / 1e3, np.radians(link.parameters.theta)
            written = r if mechanism.is_prismatic(link.joint) else theta
            assert mechanism.q_home[mechanism.q_index(link.joint)] == pytest.approx(written, abs=2e-5)


@one_of_each_kind
def test_all_nodes_are_where_the_product_of_six_elementary_transforms_puts_them(name, which):
    mechanism, text = load(name, which), document(name)
    for q, _ in configurations(mechanism, 5):
        for node, expected in placed(text, text.robot(which), values(mechanism, q)).items():
            assert mechanism.placement(q, node).homogeneous == pytest.approx(expected, abs=1e-12)


def derivative(mechanism, function, q: np.ndarray, h: float = 1e-6) -> np.ndarray:
    """Central differences on the manifold."""
    columns = []
    for i in range(mechanism.model.nv):
        step = np.zeros(mechanism.model.nv)
        step[i] = h * mechanism.scale[i]
        ahead, behind = pin.integrate(mechanism.model, q, step), pin.integrate(mechanism.model, q, -step)
        columns.append((function(ahead) - function(behind)) / (2.0 * step[i]))
    return np.array(columns).T


@one_of_each_kind
def test_the_loops_jacobian_is_the_derivative_of_their_residual_closed_and_open(name, which):
    mechanism = load(name, which)
    if not mechanism.is_constrained:
        assert mechanism.loop_jacobian(mechanism.q_home).shape == (0, mechanism.model.nv)
        return
    for q, closed in configurations(mechanism, 4):
        assert (mechanism.closure(q) <= 1e-12) == closed
        expected = derivative(mechanism, mechanism.loop_residual, q)
        assert mechanism.loop_jacobian(q) == pytest.approx(expected, abs=1e-6)


@one_of_each_kind
def test_the_nodes_jacobians_are_the_derivatives_of_their_placements(name, which):
    mechanism = load(name, which)
    for q, _ in configurations(mechanism, 1):
        for node in mechanism.nodes:
            pose = mechanism.placement(q, node)

            def twist(q_moved, pose=pose, node=node):
                return pin.log6(pose.actInv(mechanism.placement(q_moved, node))).vector

            assert mechanism.jacobian(q, node) == pytest.approx(derivative(mechanism, twist, q), abs=1e-6)


@one_of_each_kind
def test_the_rank_of_the_loops_is_the_same_all_over_its_workspace(name, which):
    """So that home is no singular posture, and the mobility no accident of where it was counted."""
    mechanism = load(name, which)
    if not mechanism.is_constrained:
        assert mechanism.loop_rank == 0
        return
    samples = [mechanism.q_home] + [q for seed in range(4) for q in mechanism.random_closed(5, seed)]
    sigmas = [np.linalg.svd(mechanism.structure.system.evaluate(q)[1], compute_uv=False) for q in samples]
    assert {np.count_nonzero(sigma > 1e-7) for sigma in sigmas} == {mechanism.loop_rank}
    assert sigmas[0][mechanism.loop_rank - 1] > 0.02
