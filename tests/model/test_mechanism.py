"""The mechanism: placements, Jacobians, closure, names."""

import inspect
import re

import numpy as np
import pytest

import cinegen
from cinegen.errors import ConfigurationError


def test_what_is_no_configuration_is_refused(robot):
    delta = robot("delta4")
    with pytest.raises(ConfigurationError, match="15 numbers"):
        delta.placement(np.zeros(3), "platform")
    with pytest.raises(ConfigurationError, match="not finite"):
        delta.close(np.full(15, np.nan))


def test_joints_can_be_set_by_name(robot):
    arm = robot("arm7")
    q = arm.configuration({"joint3": 0.5, "joint7": -0.25})
    assert q[arm.q_index("joint3")] == 0.5
    assert q[arm.q_index("joint7")] == -0.25
    assert q[arm.q_index("joint1")] == arm.q_home[arm.q_index("joint1")]
    assert arm.q_home.flags.writeable is False


def test_the_extended_jacobian_labels_its_rows_and_columns(robot):
    delta = robot("delta4")
    matrix = delta.extended_jacobian(delta.q_home, ["platform", "link1"])
    assert matrix.shape == (24, 15)
    assert matrix.rows[0] == ("platform", "x")
    assert matrix.rows[11] == ("link1", "rz")
    assert matrix.rows[12] == (delta.loops[0].name, "x")
    assert matrix.columns[delta.v_index("joint12")] == "joint12"
    assert np.array_equal(np.asarray(matrix)[:6], delta.jacobian(delta.q_home, "platform"))
    assert np.array_equal(matrix.block(delta.loops[1].name), delta.loop_jacobian(delta.q_home)[6:])
    assert "platform rz" in str(matrix)


def test_a_joint_that_does_not_move_a_loop_has_exactly_zero_there(robot):
    delta = robot("delta4")
    q = delta.random_closed(3)[-1]
    loop = delta.extended_jacobian(q).block("link5-link11")
    assert not loop[:, [delta.v_index(f"joint{i}") for i in range(12, 17)]].any()
    assert np.abs(loop[:, delta.v_index("joint1")]).max() > 0.1


@pytest.mark.parametrize("axis", ["1 0 0", "0 1 0", "0 0 1", "0.6 0.8 0"])
def test_a_prismatic_joint_of_any_axis_is_one_translation_and_the_next_joint_is_none(tmp_path, axis):
    """The scale of a prismatic joint is the characteristic length, that of a revolute joint 1 rad."""
    path = tmp_path / "two.urdf"
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    path.write_text(f"""<robot name="two"><link name="a"/><link name="b"/><link name="c"/>
      <joint name="p" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="{axis}"/>{limit}</joint>
      <joint name="r" type="revolute"><origin xyz="0.3 0.1 0.2"/><parent link="b"/><child link="c"/>
        <axis xyz="0 0 1"/>{limit}</joint></robot>""")
    mechanism = cinegen.load(path)
    assert (mechanism.is_prismatic("p"), mechanism.is_prismatic("r")) == (True, False)
    assert mechanism.length != 1.0
    assert mechanism.scale == pytest.approx([mechanism.length, 1.0])


@pytest.mark.parametrize("name", ["delta4", "delta4_linear", "rx90"])
def test_differences_of_configurations_are_in_rad_and_m_scaled_ones_in_characteristic_lengths(robot, name):
    mechanism = robot(name)
    here, there = mechanism.q_home, mechanism.random_closed(1)[0]
    step = mechanism.difference(here, there)
    assert step == pytest.approx(there - here)
    assert mechanism.scaled_difference(here, there) * mechanism.scale == pytest.approx(step)
    assert mechanism.distance(here, there) == np.abs((there - here) / mechanism.scale).max() > 0.0
    assert mechanism.integrate(here, step) == pytest.approx(there)
    assert mechanism.interpolate(here, there, 0.25) == pytest.approx(0.75 * here + 0.25 * there)


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
    html = delta._repr_html_()
    assert html.count("<tr>") == 1 + len(delta.joints) + 1 + len(delta.loops)
    assert all(f"<td>{name}</td>" in html for name in (*delta.joints, delta.loops[0].name))
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
