"""The mechanism: placements, Jacobians, closure, names."""

import inspect
import json
import re
import warnings

import numpy as np
import pytest
from urdf_text import joint_at, joint_text, limit, links
from urdf_text import robot as urdf

import cinegen
from raff2urdf.constraints import HASH
from raff2urdf.readers.urdf import hash_of
from raff2urdf.readers.urdf_file import parse


def test_the_extended_jacobian_labels_its_rows_and_columns(robot):
    delta = robot("delta4")
    matrix = delta.extended_jacobian(delta.q_home, ["platform", "link1"])
    assert matrix.shape == (24, 15)
    rows = [("platform", "x"), ("link1", "rz"), (delta.loops[0].name, "x")]
    assert [matrix.rows[i] for i in (0, 11, 12)] == rows
    assert matrix.columns[delta.v_index("joint12")] == "joint12"
    assert np.array_equal(np.asarray(matrix)[:6], delta.jacobian(delta.q_home, "platform"))
    assert np.array_equal(matrix.block(delta.loops[1].name), delta.loop_jacobian(delta.q_home)[6:])
    assert "platform rz" in str(matrix)


@pytest.mark.parametrize("axis", ["1 0 0", "0 1 0", "0 0 1", "0.6 0.8 0"])
def test_a_prismatic_joint_of_any_axis_is_one_translation_and_the_next_joint_is_none(axis):
    """The scale of a prismatic joint is the characteristic length, that of a revolute joint 1 rad."""
    slide = joint_text("p", "a", "b", f'<axis xyz="{axis}"/>{limit(-1, 1)}', "prismatic")
    turn = joint_at("r", "b", "c", "0.3 0.1 0.2", limit(-1, 1), "revolute")
    mechanism = cinegen.load(urdf(links(*"abc"), slide, turn))
    assert (mechanism.is_prismatic("p"), mechanism.is_prismatic("r")) == (True, False)
    assert mechanism.length != 1.0
    assert mechanism.scale == pytest.approx([mechanism.length, 1.0])


def test_differences_of_configurations_are_in_rad_and_m_scaled_ones_in_characteristic_lengths(robot):
    mechanism = robot("delta4_linear")
    start, goal = mechanism.q_home, mechanism.random_closed(1)[0]
    step = mechanism.difference(start, goal)
    assert step == pytest.approx(goal - start)
    assert mechanism.scaled_difference(start, goal) * mechanism.scale == pytest.approx(step)
    assert mechanism.distance(start, goal) == np.abs((goal - start) / mechanism.scale).max() > 0.0
    assert mechanism.integrate(start, step) == pytest.approx(goal)
    assert mechanism.interpolate(start, goal, 0.25) == pytest.approx(0.75 * start + 0.25 * goal)


def test_a_mechanism_never_changes(robot):
    delta = robot("delta4")
    for name in ("actuated", "q_home", "loop_rank", "limits", "anything"):
        with pytest.raises(AttributeError):
            setattr(delta, name, None)
    with pytest.raises(ValueError, match="read-only"):
        delta.q_home[0] = 0.0


def test_mechanisms_and_jacobians_are_shown_in_one_line_and_as_tables(robot):
    delta = robot("delta4")
    assert repr(delta) == "<Mechanism r1: 19 nodes, 15 joints (3 actuated), 2 loops, mobility 3>"
    assert all(f"<td>{name}</td>" in delta._repr_html_() for name in (*delta.joints, delta.loops[0].name))
    matrix = delta.extended_jacobian(delta.q_home, "platform")
    assert repr(matrix) == "<ExtendedJacobian 18 x 15: platform, link5-link11, link5-link17>"
    assert matrix._repr_html_().count("<td>.</td>") == int((matrix.matrix == 0.0).sum())
    long = cinegen.model.ExtendedJacobian(np.zeros((99, 1)), tuple((f"node{k}", "x") for k in range(99)), ("joint1",))
    assert len(repr(long)) <= 100


def test_what_a_mechanism_shows_is_in_the_reference(robot):
    """All that completion offers has a docstring, from which the API reference is built."""
    kind = type(robot("delta4"))
    fields = re.findall(r"^ {4}(\w+): ", inspect.getdoc(kind).partition("Attributes:\n")[2], flags=re.MULTILINE)
    shown = {name for name in dir(robot("delta4")) if not name.startswith("_")}
    assert {name for name in shown if not inspect.getdoc(inspect.getattr_static(kind, name, None))} <= set(fields)
    assert set(kind.__dataclass_fields__) - set(fields) == set()


# --- group state ------------------------------------------------------------------------------------------------------
# Home of a URDF is the group state of its SRDF.


def limited(name, parent, child, low=-3, high=3, inside=""):
    return joint_at(name, parent, child, "1 0 0", limit(low, high) + inside, "revolute")


JOINTS = joint_at("flange", "d", "tool", "1 0 0", kind="fixed") + limited("j1", "a", "b") + limited("j2", "b", "c")
ARM = urdf(links(*"abcd", "tool"), JOINTS, limited("j3", "c", "d", 1, 2), "{}", name="arm")
PLAIN = ARM.format("")


def state(name, group, **values):
    joints = "".join(f'<joint name="{joint}" value="{value}"/>' for joint, value in values.items())
    return f'<group_state name="{name}" group="{group}">{joints}</group_state>'


@pytest.fixture
def write(tmp_path):
    def write(*states, urdf=PLAIN):
        (tmp_path / "arm.urdf").write_text(urdf)
        (tmp_path / "arm.srdf").write_text(f'<robot name="arm"><group name="g"/>{"".join(states)}</robot>')
        return tmp_path / "arm.urdf"

    return write


def load(path, **options):
    with warnings.catch_warnings(action="error"):
        return cinegen.load(path, **options)


def home(mechanism):
    return {joint: float(mechanism.q_home[mechanism.q_index(joint)]) for joint in mechanism.joints}


@pytest.mark.parametrize(("states", "expected", "label"), [
    ([state("up", "arm", j1=2)], {"j1": 0, "j2": 0, "j3": 1.5}, ""),
    ([state("home", "arm", j1=0.5, j2=-1)], {"j1": 0.5, "j2": -1, "j3": 1.5}, "'home' of arm"),
    ([state("ready", "arm", j1=1), state("home", "arm", j1=0.5)], {"j1": 0.5, "j2": 0, "j3": 1.5}, "'home' of arm"),
    ([state("Ready", "arm", j1=1)], {"j1": 1, "j2": 0, "j3": 1.5}, "'ready' of arm"),
    (  # several groups: together; that of all joints holds
        [state("home", "all", j1=0.1, j2=0.2, j3=1.3), state("home", "hand", j3=2)],
        {"j1": 0.1, "j2": 0.2, "j3": 1.3}, "'home' of all, hand",
    ),
    ([state("home", "x", j1=0.1), state("home", "y", j3=2)], {"j1": 0.1, "j2": 0, "j3": 2}, "'home' of x, y"),
    ([state("home", "arm", j1=0.1, j3=2.0005, flange=0)], {"j1": 0.1, "j2": 0, "j3": 2}, "'home' of arm"),
])  # fmt: skip
def test_home_is_the_group_state_of_that_name(write, states, expected, label):
    mechanism = load(write(*states))
    assert home(mechanism) == pytest.approx(expected)
    assert mechanism.source.notes == ((f"home is the group state {label} in arm.srdf",) if label else ())
    assert mechanism.actuated == ("j1", "j2", "j3")


def test_another_srdf_and_none(write, tmp_path):
    path = write(state("home", "arm", j1=0.5))
    (tmp_path / "other.srdf").write_text(f'<robot name="arm">{state("home", "arm", j1=0.7)}</robot>')
    assert home(load(path, srdf=tmp_path / "other.srdf"))["j1"] == 0.7
    assert home(cinegen.load(path, ignore=["arm.srdf"]))["j1"] == 0.0
    assert home(load(path, actuated=["j2"])) == {"j1": 0.5, "j2": 0.0, "j3": 1.5}
    assert load(path, actuated=["j2"]).actuated == ("j2",)


def test_a_home_in_the_constraints_file_is_stronger(write, tmp_path):
    path = write(state("home", "arm", j1=0.5))
    joints = [{"name": name, "home": value, "actuated": True} for name, value in (("j1", 0.25), ("j2", 0), ("j3", 1))]
    values = {
        "format": "raff2urdf constraints", "version": 2, "robot": "arm", "nodes": [*"abcd", "tool"],
        "joints": joints, "loops": [], "mobility": 3, HASH: hash_of(parse(PLAIN, "arm"), "arm"),
    }  # fmt: skip
    path.with_suffix(".constraints.json").write_text(json.dumps(values))
    assert home(cinegen.load(path))["j1"] == 0.25


def test_loops_and_couplings_are_closed_near_it(write):
    """A follower has the value that its leader gives it; a state with rounded numbers is closed."""
    follower = ARM.format(links("e") + limited("k", "a", "e", inside='<mimic joint="j1" multiplier="2"/>'))
    mechanism = load(write(state("home", "arm", j1=0.4, j2=0.1), urdf=follower))
    assert home(mechanism) == pytest.approx({"j1": 0.4, "j2": 0.1, "j3": 1.5, "k": 0.8})
    closing = '<loop_joint name="l" type="spherical"><link1 link="tool"/><link2 link="e"/></loop_joint>'
    four = ARM.format(links("e") + closing + joint_at("e", "a", "e", "1 1 0", kind="fixed"))
    for angle in (0.1, 0.3):
        rounded = state("home", "arm", j1=angle, j2=round(1.5708 - angle, 2), j3=round(1.5708 + angle, 2))
        mechanism = load(write(rounded, urdf=four))
        assert mechanism.closure(mechanism.q_home) < 1e-9
        assert home(mechanism)["j1"] == pytest.approx(angle, abs=0.01)


def test_what_does_not_fit_is_told(write):
    with pytest.warns(UserWarning, match=r"'home' of arm.* is outside the limits of j3: held"):
        mechanism = cinegen.load(write(state("home", "arm", j1=1, j3=2.5)))
    assert home(mechanism) == pytest.approx({"j1": 1, "j2": 0, "j3": 2})
    with pytest.warns(UserWarning, match=r"names what is no joint of the robot: j4: did you mean 'j1', 'j2'|j4"):
        assert home(cinegen.load(write(state("home", "arm", j1=1, j4=2.5))))["j1"] == 1
    base = state("home", "arm", j1=1, root_joint="0 0 1 0 0 0 1")
    assert "places root_joint: not read" in load(write(base)).source.notes[1]
    with pytest.raises(cinegen.CinegenError, match=r"arm.srdf:1: value='one' of joint 'j1' in the group state 'home'"):
        cinegen.load(write(state("home", "arm", j1="one")))
