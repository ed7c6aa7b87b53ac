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

# Bennett's linkage, with one length a millimetre off: a rigid or revolute closure contradicts itself, a ball doesn't.
BENT = """
robot bent {
  base { }
  link 1 { parameters { theta 40 } type 2 pred 0 }
  link 2 { parameters { theta 60 d 200 alpha 30 } type 2 pred 1 }
  link 3 { parameters { theta 70 d 301 alpha 50 } type 2 pred 2 }
  link 4 { parameters { theta 50 d 200 alpha 30 } type 2 pred 3 }
  frame 5 { parameters { d 303 alpha 58 } pred 4 name "end" }
  constraint { base frame 5 }
}
"""


def test_the_first_robot_of_several_is_loaded_unless_another_is_named(root):
    path = root / "robots" / "two_arms.raff"
    first, second = (robot.name for robot in raff2urdf.load(path).robots)
    assert cinegen.load(path).name == first
    assert cinegen.load(path, second).name == second
    with pytest.raises(raff2urdf.RaffError, match=f"no robot 'rihgt'.*'{second}'"):
        cinegen.load(path, "rihgt")


def test_a_mechanism_that_contradicts_itself_is_refused_with_the_way_out(raff):
    with pytest.raises(cinegen.ClosureError) as caught:
        raff(BENT)
    said = str(caught.value)
    assert "base-end" in said
    assert "6 loop rows of rank" in said
    assert '"base-end": "' in said
    assert isinstance(caught.value, raff2urdf.RaffError)


def test_a_loop_can_be_closed_otherwise_without_touching_the_file(raff):
    mechanism = raff(BENT, loops={"base-end": "ball"})
    assert mechanism.closure(mechanism.q_home) <= 1e-12
    assert mechanism.mobility == 1
    with pytest.raises(cinegen.CinegenError, match="no loop 'end-base'"):
        raff(BENT, loops={"end-base": "ball"})
    with pytest.raises(raff2urdf.RaffError, match="'hinge' is not a kind of loop"):
        raff(BENT, loops={"base-end": "hinge"})


ARM = """<robot name="arm">
  <link name="base"/>
  <link name="tool"/>
  <joint name="turn" type="revolute">
    <parent link="base"/>
    <child link="tool"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" effort="1" velocity="3"/>
  </joint>
</robot>"""


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("limit", ["", '<limit effort="1" velocity="3"/>'])
def test_a_joint_whose_limits_are_left_out_has_none_and_one_warning_says_so(kind, limit, tmp_path):
    path = tmp_path / "arm.urdf"
    told = ARM.replace('<limit lower="-1" upper="2" effort="1" velocity="3"/>', limit).replace("revolute", kind)
    path.write_text(told)
    with pytest.warns(cinegen.CinegenWarning, match="'turn': no lower and upper limit") as seen:
        mechanism = cinegen.load(path)
    assert len(seen) == 1
    assert mechanism.model.lowerPositionLimit[0] == -np.inf
    assert mechanism.model.upperPositionLimit[0] == np.inf
    assert mechanism.is_prismatic("turn") == (kind == "prismatic")


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
    path.write_text(path.read_text().replace("continuous", "fixed"))
    assert cinegen.load(path).mobility == 0
