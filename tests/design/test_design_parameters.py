"""Names, ties, bounds and values of parameters, and their RAFF text."""

import pickle
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_openings import jacobian_by
from small_robots import rssr

import raff2urdf
from cinegen.design import Design, DesignError, Parameters, Tolerances, holding_torques, tolerance
from cinegen.dynamics import InverseDynamics, Payload
from cinegen.errors import CinegenWarning, ClosureError
from cinegen.model import Mechanism
from cinegen.model.masses import stated
from raff2urdf.raff.compound import VARIABLES
from raff2urdf.raff.document import (
    CompoundKind,
    Document,
    JointType,
    RaffBase,
    RaffFrame,
    RaffLink,
    RaffParameters,
    RaffRobot,
    RaffVariable,
)

ROBOTS = Path(__file__).parents[2] / "robots"


def test_names_and_values():
    parameters = Parameters("five_bar")
    assert len(parameters.all) == 7 * 6
    assert len(parameters) == 7 * 6 - 5  # without the variables of its five joints
    assert parameters.values[parameters.index("link2.d")] == 0.25
    assert parameters.index("tool.d") == parameters.index("frame20.d")
    assert parameters.own_variable("joint1").name == "link1.theta"
    assert Parameters("five_bar", "link1.theta").names == ("link1.theta",)
    assert Parameters("five_bar", ["link*.d", "base.*"]).names[:2] == ("base.gamma", "base.epsilon")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"names": "lnk2.d"}, "did you mean 'link2.d'"),
        ({"names": ["link9.d", "lnk2.d", "q*.d"]}, "'link9.d' (known: link1.d, link2.d"),
        ({"names": ["link9.d", "lnk2.d", "q*.d"]}, "did you mean 'link2.d'"),
        ({"names": ["link9.d", "lnk2.d", "q*.d"]}, "'q*.d' matches no parameter"),
        ({"names": "link1.t*"}, "variables of moving joints (link1.theta)"),
        ({"ties": ["link2.d = link2.alpha"]}, "a length and an angle"),
        ({"ties": ["link2.d = 2*link4.d + 10"]}, "'10' has no unit: write it, such as 10mm"),
        ({"ties": ["link2.d = link4.d * link5.d"]}, "not affine"),
        ({"ties": ["2*link2.d = link4.d"]}, "is not a single parameter"),
        (
            {"ties": ["link2.d = 2*link4.d", "link4.d = 3*link5.d", "link5.d = 0.1*link2.d"]},
            "'link4.d = 3*link5.d' and",
        ),
        ({"ties": ["link2.d = 2*link4.d", "link2.d = 3*link5.d"]}, "ties of link2.d: 'link2.d = 2*link4.d' and"),
        ({"names": "link2.d", "ties": ["link2.d = 250mm"]}, "tied to a constant"),
        ({"bounds": {"link2.d": "1..2deg"}}, "bounds of link2.d: "),
        ({"bounds": {"link2.d": "1..2deg", "link4.d": "2..1m"}}, "bounds of link4.d: 2 is not below 1"),
        ({"bounds": {"link2.d": (1.0, 2.0)}}, "link2.d is 0.25 m in the file, outside its bounds 1 m to 2 m"),
    ],
)
def test_errors(arguments, message):
    with pytest.raises(DesignError) as caught:
        Parameters("five_bar", **arguments)
    assert message in str(caught.value)


@settings(max_examples=40)
@given(st.lists(st.floats(-5.0, 5.0, allow_subnormal=False), min_size=4, max_size=4))
def test_ties_of_any_factors(numbers):
    a, b, c, d = (round(x, 3) for x in numbers)
    ties = [f"link2.d = {a}*link4.d + {b}mm", f"link4.d = {c}*link5.d - {d}*frame20.d"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        parameters = Parameters("five_bar", ["link5.d", "frame20.d"], ties)
    full = dict(zip((parameter.name for parameter in parameters.all), parameters.full([0.3, 0.7]), strict=True))
    np.testing.assert_allclose(full["link4.d"], c * 0.3 - d * 0.7, atol=1e-12)
    np.testing.assert_allclose(full["link2.d"], a * (c * 0.3 - d * 0.7) + b / 1000.0, atol=1e-12)


def test_derivatives_of_tied_parameters():
    ties = ["link2.d = link4.d", "link5.d = 2*link2.d - 100mm", "frame20.d = link5.d"]
    tied, plain = Parameters("five_bar", "*.d", ties), Parameters("five_bar", "*.d")
    by_tied = Design(tied).evaluate().pose_derivative("tool")[0]
    by_plain = dict(zip(plain.names, Design(plain).evaluate().pose_derivative("tool")[0].T, strict=True))
    whole = by_plain["link2.d"] + by_plain["link4.d"] + 2.0 * (by_plain["link5.d"] + by_plain["frame20.d"])
    np.testing.assert_allclose(by_tied[:, tied.index("link2.d")], whole, atol=1e-12)


@pytest.mark.parametrize("name", ["gough", "arm7"])
def test_text_with_other_values(name):
    parameters = Parameters(name)
    rng = np.random.default_rng(4)
    p = parameters.values + 1e-4 * rng.normal(size=len(parameters))
    text, wanted = parameters.with_values(p), parameters.document_with(p)
    before = (ROBOTS / f"{name}.raff").read_text()
    assert raff2urdf.loads(text) == wanted
    comments = [[line.partition("//")[2] for line in source.split("\n")] for source in (text, before)]
    assert comments[0] == comments[1]
    assert parameters.with_values(parameters.values) == before


def test_text_of_one_value():
    parameters = Parameters("five_bar")
    text = parameters.with_values(parameters.with_changed({"link2.d": "251.5mm", "base.d": "1mm"}))
    before = (ROBOTS / "five_bar.raff").read_text().split("\n")
    changed = [(old, new) for old, new in zip(before, text.split("\n"), strict=True) if old != new]
    assert changed == [
        ("  base { } // midway between the actuated joints",
         "  base { parameters { d 1 } } // midway between the actuated joints"),
        ("    parameters { theta -85.310313 d 250.0 }", "    parameters { theta -85.310313 d 251.5 }"),
    ]  # fmt: skip


def test_a_urdf(tmp_path):
    raff2urdf.convert(ROBOTS / "arm7.raff", tmp_path)
    parameters = Parameters(tmp_path / "arm7.urdf", "link*.r")
    longer = parameters.mechanism_with(parameters.values + 0.01)
    assert len(parameters) > 0
    design = Design(parameters)
    placed = design.evaluate(parameters.values + 0.01).placements(longer.end)[0]
    np.testing.assert_allclose(placed, longer.placement(longer.q_home, longer.end).homogeneous, atol=1e-9)
    assert "robot" in parameters.with_values(parameters.values)


def test_errors_out_of_the_plane_open_a_planar_linkage():
    parameters = Parameters("five_bar")
    design = Design(parameters)
    assert len(design.evaluate().opening) == 18
    p = parameters.with_changed({"link3.r": "1mm"})
    with pytest.raises(ClosureError):
        design.close(p)
    with pytest.raises(ClosureError):
        parameters.mechanism_with(p)


def test_a_healed_mechanism_is_evaluated_as_it_was_healed(tmp_path):
    """Bars of 0.01 degrees out of their plane are rounding, which loading heals; so it is done at other values."""
    text = (ROBOTS / "five_bar.raff").read_text()
    (tmp_path / "bent.raff").write_text(text.replace("theta -85.310313 d 250.0", "theta -85.310313 d 250.0 alpha 0.01"))
    with pytest.warns(CinegenWarning, match="healed"):
        parameters = Parameters(tmp_path / "bent.raff", "link2.d")
    design, mechanism = Design(parameters), parameters.mechanism
    evaluation = design.evaluate(q=mechanism.random_closed(1)[0])
    assert evaluation.gap[0] < 1e-12
    for node in mechanism.nodes:
        placed = mechanism.placement(evaluation.q[0], node).homogeneous
        np.testing.assert_allclose(evaluation.placements(node)[0], placed, atol=1e-12)
    assert design.evaluate(parameters.values + 1e-3).gap[0] < 1e-12
    with pytest.warns(CinegenWarning, match="healed"):
        assert parameters.mechanism_with(parameters.values + 1e-3).mobility == 2
    assert Tolerances(parameters, {"link2.d": 1e-4}).at(samples=100).monte_carlo.failed == 0


def test_other_joints_may_be_fixed():
    """The elbows of a five-bar are fixed, and its actuated joints move."""
    parameters = Parameters("five_bar", "link*.d")
    design, mechanism = Design(parameters, fixed=("joint2", "joint4")), parameters.mechanism
    evaluation = design.evaluate()
    for k in range(len(parameters)):
        poses = []
        for step in (1e-5, -1e-5):
            p = parameters.values + step * np.eye(len(parameters))[k]
            changed = parameters.mechanism_with(p)
            q = changed.close(mechanism.q_home, design.fixed)
            np.testing.assert_allclose(design.close(p), q, atol=1e-10)
            assert q[mechanism.q_index("joint2")] == mechanism.q_home[mechanism.q_index("joint2")]
            poses.append(changed.placement(q, "tool").translation)
        numeric = (poses[0] - poses[1]) / 2e-5
        np.testing.assert_allclose(evaluation.pose_derivative("tool", "world")[0, :3, k], numeric, atol=1e-8)


def test_designs_go_to_other_processes():
    tied = Parameters("five_bar", "link*.d", ["link2.d = link4.d"])
    design = pickle.loads(pickle.dumps(Design(tied, [("joint2", "x")])))
    assert design.names == ("link1.d", "link2.d", "link3.d", "link5.d", "joint2.x")
    tolerances = pickle.loads(pickle.dumps(Tolerances("five_bar", {"link2.d": 1e-4})))
    assert tolerances.at().position == tolerance("five_bar", {"link2.d": 1e-4}).position


# --- design derivatives -----------------------------------------------------------------------------------------------
# Derivatives by parameters, against central differences of documents that are edited and loaded again.


FEW = ["arm7", "delta4", "sr400", "differential_wrist"]
RSSR = raff2urdf.loads(rssr())  # a loop with a ball joint
CAM = """RAFF cam
robot cam {
  link 1 { parameters { theta 20 } type 2 pred 0 actuated 1 limits { 0 60 } }
  link 2 { parameters { alpha 30 d 50 theta 24 } type 2 pred 1 limits { 0 60 } }
  frame 3 { parameters { d 40 r 10 } pred 2 }
  coupling { link 2 link 1 polynomial ( 0.2 0.06 -0.0005 ) }
}
"""
STEPS = np.array([1.0, -1.0, 2.0, -2.0, 3.0, -3.0])
WEIGHTS = np.array([45.0, -45.0, -9.0, 9.0, 1.0, -1.0]) / 60.0  # of a sixth-order difference


@cache
def design(name: str) -> Design:
    return Design(Parameters(RSSR if name == "rssr" else name))


def edited(parameters: Parameters, k: int, step: float) -> Mechanism:
    """Return the mechanism of the edited document, measured by the length of the one as written."""
    p = parameters.values.copy()
    p[k] += step
    return replace(parameters.mechanism_with(p), length=parameters.mechanism.length)


def difference(values: list[np.ndarray], step: float) -> np.ndarray:
    return np.tensordot(WEIGHTS, np.array(values), 1) / step


def sampled(
    source: Design, opening: Sequence[str], seed: int, count: int
) -> Iterator[tuple[int, float, float, list[Mechanism]]]:
    """Yield some parameters that open no loop: index, unit, step, and the mechanisms of the edited documents."""
    chosen = np.random.default_rng(seed).permutation([k for k, name in enumerate(source.names) if name not in opening])
    for k in chosen[:count]:
        is_length = source.parameters.all[source.parameters.find(source.names[k])].unit == "m"
        unit = source.mechanism.length if is_length else 1.0
        yield k, unit, 1e-3 * unit, [edited(source.parameters, k, s * 1e-3 * unit) for s in STEPS]


@pytest.mark.parametrize("name", [*FEW, "rssr"])
def test_edited_documents(name: str) -> None:
    source = design(name)
    mechanism = source.mechanism
    q = [mechanism.q_home, *mechanism.random_closed(1, 5)][-1]
    at_q, node, length = source.evaluate(q=q), mechanism.end, mechanism.length
    assert at_q.gap[0] < 1e-12
    nominal = mechanism.placement(at_q.q[0], node)
    scale = np.repeat([1.0 / length, 1.0], 3)
    amplified = at_q.amplification(node)[0]
    np.testing.assert_allclose(
        amplified, jacobian_by(mechanism, at_q.q[0], node, source.fixed), atol=1e-9 * max(1.0, length)
    )
    by_p = at_q.amplification_derivative(node)[0]
    if name == "rssr":
        assert at_q.opening == ()
    for k, unit, step, changed in sampled(source, at_q.opening, 3, 6):
        open_poses = [pin.log6(nominal.actInv(m.placement(at_q.q[0], node))).vector * scale for m in changed]
        moved = at_q.node_parameters(node)[0, :, k] * scale
        np.testing.assert_allclose(unit * moved, unit * difference(open_poses, step), atol=1e-8)
        residuals = [m.structure.system.evaluate(at_q.q[0])[0] for m in changed]
        np.testing.assert_allclose(unit * at_q.loop_parameters[0, :, k], unit * difference(residuals, step), atol=1e-8)
        closed = [m.close(at_q.q[0], mechanism.actuated) for m in changed]
        placed = [m.placement(c, node) for m, c in zip(changed, closed, strict=True)]
        ahead = source.evaluate(source.parameters.values + STEPS[0] * step * np.eye(len(source.names))[k], at_q.q[0])
        np.testing.assert_allclose(ahead.placements(node)[0], placed[0].homogeneous, atol=1e-10)
        poses = [pin.log6(nominal.actInv(place)).vector * scale for place in placed]
        moved = at_q.pose_derivative(node)[0, :, k] * scale
        np.testing.assert_allclose(unit * moved, unit * difference(poses, step), atol=1e-8)
        jacobians = [jacobian_by(m, c, node, source.fixed) for m, c in zip(changed, closed, strict=True)]
        numeric = difference(jacobians, step) * scale[:, None] * unit
        size = max(1.0, np.abs(numeric).max())
        np.testing.assert_allclose(by_p[..., k] * scale[:, None] * unit, numeric, atol=1e-8 * size)


WRENCH = np.array([3.0, -2.0, 5.0, 0.3, 0.7, -0.4])


@pytest.mark.parametrize("name", FEW)
def test_torques_that_hold(name: str) -> None:
    """Against the inverse dynamics of edited documents; masses that follow from dimensions stay those of the file."""
    source = design(name)
    mechanism = source.mechanism
    loads = [Payload(mechanism.end, wrench=tuple(WRENCH))]
    at_q = source.evaluate(q=[mechanism.q_home, *mechanism.random_closed(1, 5)][-1])
    torques, by_p = holding_torques(at_q, {mechanism.end: WRENCH}, massless=True)
    expected = InverseDynamics(mechanism, loads, massless=True).torques(at_q.q[0])
    size = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(torques[0], expected, atol=1e-9 * size)
    torques, by_p = holding_torques(at_q, {mechanism.end: WRENCH}, gravity=(0.0, 0.0, 0.0))
    weights, by_weight = holding_torques(at_q, massless=True)
    for k, unit, step, changed in sampled(source, at_q.opening, 7, 4):
        closed = [m.close(at_q.q[0], mechanism.actuated) for m in changed]
        pairs = list(zip(changed, closed, strict=True))
        held = [InverseDynamics(m, loads, (0.0, 0.0, 0.0), True).torques(c) for m, c in pairs]
        size = max(1.0, float(np.abs(torques).max()))
        np.testing.assert_allclose(unit * by_p[0, :, k], unit * difference(held, step), atol=1e-8 * size)
        if same_masses(changed[0], mechanism):
            held = [InverseDynamics(m, massless=True).torques(c) for m, c in pairs]
            size = max(1.0, float(np.abs(weights).max()))
            np.testing.assert_allclose(unit * by_weight[0, :, k], unit * difference(held, step), atol=1e-8 * size)


def same_masses(first: Mechanism, other: Mechanism) -> bool:
    masses = [{link: (body.mass, *body.centre) for link, body in stated(m).items()} for m in (first, other)]
    same = masses[0].keys() == masses[1].keys()
    return same and all(np.allclose(masses[0][link], masses[1][link], 1e-12, 1e-12) for link in masses[0])


# --- design of random robots ------------------------------------------------------------------------------------------
# Parameters of random trees with joints of all kinds, against edited documents.


def random_robot(rng: np.random.Generator, size: int) -> Document:
    """Return a document of a tree whose links have joints of all kinds."""

    def written() -> RaffParameters:
        numbers = rng.uniform(-1.0, 1.0, 6) * rng.integers(0, 2, 6)
        theta, alpha, gamma = (150.0 * numbers[:3]).tolist()
        r, d, epsilon = (400.0 * numbers[3:]).tolist()
        return RaffParameters(theta, r, d, alpha, gamma, epsilon)

    parts: list[RaffLink | RaffFrame] = []
    for number in range(1, size + 1):
        pred, kind = int(rng.integers(0, number)), rng.integers(0, 5)
        if kind == 0:
            parts.append(RaffFrame(number, written(), pred))
        elif kind < 3:
            parts.append(RaffLink(number, written(), JointType(int(rng.integers(0, 3))), pred))
        else:
            compound = list(CompoundKind)[rng.integers(0, 4)]
            free = [name for name, parameter in VARIABLES[compound].items() if parameter is None]
            variables = tuple(RaffVariable(name, float(rng.uniform(-40.0, 40.0))) for name in free)
            parts.append(RaffLink(number, written(), JointType.FIXED, pred, compound=compound, variables=variables))
    return Document("random", (RaffRobot("random", RaffBase(written()), tuple(parts)),))


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(1, 6))
def test_random_trees(seed: int, size: int):
    rng = np.random.default_rng(seed)
    parameters = Parameters(random_robot(rng, size))
    design, mechanism = Design(parameters), parameters.mechanism
    q = mechanism.structure.system.integrate(mechanism.q_home, rng.normal(size=mechanism.model.nv))
    p = parameters.values + rng.uniform(-0.3, 0.3, len(parameters))
    at_p, changed = design.evaluate(p, q), parameters.mechanism_with(p)
    for node in mechanism.nodes:
        np.testing.assert_allclose(at_p.placements(node)[0], changed.placement(q, node).homogeneous, atol=1e-12)
    k, node, step = int(rng.integers(len(p))), mechanism.nodes[int(rng.integers(len(mechanism.nodes)))], 1e-4
    ahead, behind = (design.evaluate(p + sign * step * np.eye(len(p))[k], q) for sign in (1.0, -1.0))
    seen = pin.SE3(at_p.placements(node)[0])
    moved = [pin.log6(seen.actInv(pin.SE3(evaluation.placements(node)[0]))).vector for evaluation in (ahead, behind)]
    np.testing.assert_allclose(at_p.pose_derivative(node)[0, :, k], (moved[0] - moved[1]) / (2.0 * step), atol=1e-7)
    by_p = (ahead.amplification(node)[0] - behind.amplification(node)[0]) / (2.0 * step)
    np.testing.assert_allclose(at_p.amplification_derivative(node)[0, ..., k], by_p, atol=1e-6)


@pytest.mark.parametrize("name", ["five_bar", "differential_wrist", "belt_five_bar", "cam"])
def test_encoders_move_what_follows(name: str) -> None:
    """An offset of an actuated joint's encoder is a motion of this joint; loops and couplings are closed after it."""
    robot = raff2urdf.loads(CAM) if name == "cam" else name
    whole = Parameters(robot)
    parameters = Parameters(robot, [whole.own_variable(joint).name for joint in whole.mechanism.actuated])
    design, mechanism = Design(parameters), parameters.mechanism
    at_q, node, step = design.evaluate(q=mechanism.random_closed(1, 5)[-1]), mechanism.end, 1e-3
    by_p = at_q.amplification_derivative(node)[0]
    torques_by = holding_torques(at_q, {node: WRENCH}, massless=True)[1][0]
    dynamics = InverseDynamics(mechanism, [Payload(node, wrench=tuple(WRENCH))], massless=True)
    nominal = mechanism.placement(at_q.q[0], node)
    for k, joint in enumerate(parameter.joint for parameter in parameters.free):
        moved = [at_q.q[0].copy() for _ in STEPS]
        for q, size in zip(moved, STEPS, strict=True):
            q[mechanism.q_index(joint)] += size * step
        moved = [mechanism.close(q, design.fixed) for q in moved]
        poses = [pin.log6(nominal.actInv(mechanism.placement(q, node))).vector for q in moved]
        np.testing.assert_allclose(at_q.pose_derivative(node)[0, :, k], difference(poses, step), atol=1e-8)
        jacobians = [jacobian_by(mechanism, q, node, design.fixed) for q in moved]
        np.testing.assert_allclose(by_p[..., k], difference(jacobians, step), atol=1e-8)
        held = [dynamics.torques(q) for q in moved]
        np.testing.assert_allclose(torques_by[:, k], difference(held, step), atol=1e-7)
        passive = [v for v in range(mechanism.model.nv) if v in design.moving]
        changed = [mechanism.difference(at_q.q[0], q)[passive] for q in moved]
        np.testing.assert_allclose(at_q.joint_derivative[0, passive, k], difference(changed, step), atol=1e-8)
