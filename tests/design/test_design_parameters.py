"""Names, ties, bounds and values of parameters, and their RAFF text."""

import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import raff2urdf
from cinegen.design import Design, DesignError, Parameters, Tolerances, tolerance
from cinegen.errors import CinegenWarning, ClosureError

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
        ({"names": "link1.t*"}, "variables of moving joints (link1.theta)"),
        ({"ties": ["link2.d = link2.alpha"]}, "a length and an angle"),
        ({"ties": ["link2.d = 2*link4.d + 10"]}, "'10' has no unit: write it, such as 10mm"),
        ({"ties": ["link2.d = link4.d * link5.d"]}, "not affine"),
        ({"ties": ["2*link2.d = link4.d"]}, "is not a single parameter"),
        ({"ties": ["link2.d = 2*link4.d", "link4.d = 3*link5.d", "link5.d = 0.1*link2.d"]}, "link2.d -> link4.d -> "),
        ({"ties": ["link2.d = 2*link4.d", "link2.d = 3*link5.d"]}, "contradictory ties: 'link2.d = 2*link4.d' and"),
        ({"names": "link2.d", "ties": ["link2.d = 250mm"]}, "tied to a constant"),
        ({"bounds": {"link2.d": "1..2deg"}}, "bounds of link2.d: "),
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
    full = dict(zip((one.name for one in parameters.all), parameters.full([0.3, 0.7]), strict=True))
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
    comments = [[line.partition("//")[2] for line in one.split("\n")] for one in (text, before)]
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
    here = design.evaluate(parameters.values + 0.01).placements(longer.end)[0]
    np.testing.assert_allclose(here, longer.placement(longer.q_home, longer.end).homogeneous, atol=1e-9)
    assert "robot" in parameters.with_values(parameters.values)


def test_errors_out_of_the_plane_open_a_planar_linkage():
    parameters = Parameters("five_bar")
    design = Design(parameters)
    assert len(design.evaluate().opening) == 18
    for name in ("link2.alpha", "link3.r"):
        assert name in design.evaluate().opening
        p = parameters.values.copy()
        p[parameters.index(name)] += 1e-3
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
    here = design.evaluate(q=mechanism.random_closed(1)[0])
    assert here.gap[0] < 1e-12
    for node in mechanism.nodes:
        placed = mechanism.placement(here.q[0], node).homogeneous
        np.testing.assert_allclose(here.placements(node)[0], placed, atol=1e-12)
    assert design.evaluate(parameters.values + 1e-3).gap[0] < 1e-12
    with pytest.warns(CinegenWarning, match="healed"):
        assert parameters.mechanism_with(parameters.values + 1e-3).mobility == 2
    assert Tolerances(parameters, {"link2.d": 1e-4}).at(samples=100).monte_carlo.failed == 0


def test_other_joints_may_be_fixed():
    """The elbows of a five-bar are fixed, and its actuated joints move."""
    parameters = Parameters("five_bar", "link*.d")
    design, mechanism = Design(parameters, fixed=("joint2", "joint4")), parameters.mechanism
    here = design.evaluate()
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
        np.testing.assert_allclose(here.pose_derivative("tool", "world")[0, :3, k], numeric, atol=1e-8)


def test_evaluation_in_place_is_that_of_a_loaded_mechanism():
    parameters = Parameters("delta4")
    design, mechanism = Design(parameters), parameters.mechanism
    rng = np.random.default_rng(2)
    p = parameters.values + 1e-3 * rng.normal(size=(4, len(parameters)))
    q = np.array(mechanism.random_closed(4))
    found = design.evaluate(p, q)
    for values, start, closed, pose in zip(p, q, found.q, found.placements(mechanism.end), strict=True):
        loaded = parameters.mechanism_with(values)
        again = loaded.close(start, mechanism.actuated)
        np.testing.assert_allclose(closed, again, atol=1e-10)
        np.testing.assert_allclose(pose, loaded.placement(again, mechanism.end).homogeneous, atol=1e-10)
    assert found.gap.max() < 1e-12


def test_designs_go_to_other_processes():
    design = pickle.loads(
        pickle.dumps(Design(Parameters("five_bar", "link*.d", ["link2.d = link4.d"]), [("joint2", "x")]))
    )
    assert design.names == ("link1.d", "link2.d", "link3.d", "link5.d", "joint2.x")
    tolerances = pickle.loads(pickle.dumps(Tolerances("five_bar", {"link2.d": 1e-4})))
    assert tolerances.at().position == tolerance("five_bar", {"link2.d": 1e-4}).position
