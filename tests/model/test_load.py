"""Loading: RAFF and its conversion are one mechanism; what can't be one is refused, with the way out."""

import numpy as np
import pinocchio as pin
import pytest

import cinegen
import raff2urdf

FOUR_BAR = """
robot linkage {
  base { }
  link 1 { parameters { theta 70 } type 2 pred 0 }
  link 2 { parameters { theta -60 d 100 } type 2 pred 1 }
  link 3 { parameters { theta 95 d 200 } type 2 pred 0 }
  frame 4 { parameters { d 250 } pred 2 name "tool" }
  frame 5 { parameters { d 180 } pred 3 }
  constraint { frame 4 frame 5 type 3 }
}
"""


def test_the_first_robot_of_several_is_loaded_unless_another_is_named(root):
    path = root / "robots" / "two_arms.raff"
    first, second = (robot.name for robot in raff2urdf.load(path).robots)
    assert cinegen.load(path).name == first
    assert cinegen.load(path, second).name == second
    with pytest.raises(raff2urdf.RaffError, match=f"no robot 'rihgt'.*'{second}'"):
        cinegen.load(path, "rihgt")


def test_a_warning_of_a_home_outside_the_limits_is_of_the_line_that_loads(tmp_path):
    path = tmp_path / "stuck.raff"
    held = FOUR_BAR.replace("type 2 pred 0", "type 2 pred 0 limits { 170 171 }", 1)
    held = held.replace("type 2 pred 0 }", "type 2 pred 0 limits { 94 96 } }")  # while the other one stays
    path.write_text(f"RAFF stuck\n{held}")
    with pytest.warns(cinegen.CinegenWarning, match="home is outside those of joint1") as caught:
        cinegen.load(path)
    assert {warning.filename for warning in caught} == {__file__}


def test_a_base_that_a_sensor_may_move_is_free_and_adds_six(raff):
    text = """
      sensor 1 { port "/dev/null" translation 3 rotation 3 }
      robot r { base { parameters { d 100 alpha 90 } } link 1 { type 2 pred 0 }
        frame 2 { parameters { d 50 } pred 1 name "tool" }
        constraint { base sensor ( 0 1 ) } }"""
    mechanism = raff(text)
    assert mechanism.floating
    assert mechanism.mobility == 7
    assert (mechanism.model.nq, mechanism.model.nv) == (8, 7)
    assert mechanism.joints == ("joint1",)
    home = mechanism.placement(mechanism.q_home, "base")
    assert np.allclose(home.translation, [0.1, 0.0, 0.0], atol=1e-15)
    assert np.allclose(home.rotation @ [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], atol=1e-15)
    moved = pin.integrate(mechanism.model, mechanism.q_home, np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))
    assert np.allclose(mechanism.placement(moved, "base").translation, [0.1, -1.0, 0.0])
    assert mechanism.sensor_constraints == (("base", (0, 1)),)


def arm(joint="", links='<link name="a"/><link name="b"/>', name='name="arm"'):
    held = f'<joint name="j" type="revolute"><parent link="a"/><child link="b"/>{joint}</joint>'
    return f"<robot {name}>{links}{held}</robot>"


def test_what_no_motion_depends_on_may_be_wrong(tmp_path):
    """Pinocchio refuses a robot without a name, and a material that is said twice."""
    path = tmp_path / "arm.urdf"
    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    shape = '<visual><geometry><sphere radius="1"/></geometry><material name="red"/></visual>'
    mass = '<inertial><mass value="1"/></inertial>'
    path.write_text(
        arm('<limit lower="-1"/>', f'{red}{red}<link name="a">{mass}</link><link name="b">{shape}</link>', "")
    )
    with pytest.warns(cinegen.CinegenWarning, match="<inertial> of link 'a' has no inertia: its mass is left out"):
        mechanism = cinegen.load(path)
    assert mechanism.name == "robot"
    (ball,) = mechanism.visual.geometryObjects
    assert ball.meshColor.tolist() == [1.0, 0.0, 0.0, 1.0]


def test_a_thousand_joints_load_without_pinocchios_tensors_of_second_derivatives(tmp_path):
    path = tmp_path / "long.urdf"
    links = "".join(f'<link name="l{i}"/>' for i in range(1001))
    turns = "".join(
        f'<joint name="j{i}" type="continuous"><parent link="l{i - 1}"/><child link="l{i}"/>'
        f'<origin xyz="0.1 0 0"/><axis xyz="0 0 1"/></joint>'
        for i in range(1, 1001)
    )
    path.write_text(f'<robot name="r">{links}{turns}</robot>')
    mechanism = cinegen.load(path)
    assert mechanism.mobility == 1000
    jacobian = mechanism.jacobian(mechanism.q_home, "l1000")  # all joints turn about z, on a line along x
    assert jacobian[1] == pytest.approx(0.1 * np.arange(999, -1, -1), abs=1e-11)
