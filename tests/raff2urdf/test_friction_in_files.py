"""The inertia of rotors, and the friction of joints, in RAFF, URDF, SDF and MJCF: no format loses a digit."""

import json
import math
import warnings

import pytest
from wrong_raff import text_of

import cinegen
import raff2urdf
from raff2urdf import RaffError
from raff2urdf.raff.reader import parse

MASS = "inertial { mass 1 moments { 100 100 100 } }"
ARM = text_of(
    f"link 1 {{ type 2 pred 0 armature 2500 damping 0.03 friction 0.7 {MASS} }}\n"
    f"link 2 {{ parameters {{ alpha 90 }} type 1 pred 1 armature 0.3 damping 0.1 friction 2 {MASS} }}\n"
    f"link 3 {{ type 2 pred 2 {MASS} }}"
)
NUMBERS = (  # armature, damping and friction of the three joints, SI units
    (2500.0e-6, 0.3, 0.0),
    (0.03 * 180.0 / math.pi, 100.0, 0.0),
    (0.7, 2.0, 0.0),
)


def numbers_of(mechanism: cinegen.Mechanism) -> tuple[tuple[float, ...], ...]:
    """Return armature, damping and friction of a mechanism's joints, in file order."""
    model, columns = mechanism.model, [mechanism.v_index(joint) for joint in mechanism.joints]
    fields = model.armature, model.damping, model.upperDryFrictionLimit
    return tuple(tuple(map(float, field[columns])) for field in fields)


def test_raff_gives_inertia_of_rotors_and_friction_in_its_own_units():
    mechanism = cinegen.load(ARM)
    for numbers, expected in zip(numbers_of(mechanism), NUMBERS, strict=True):
        assert numbers == pytest.approx(expected, rel=1e-15)
    assert (mechanism.model.lowerDryFrictionLimit == -mechanism.model.upperDryFrictionLimit).all()
    metres = cinegen.load(ARM.replace("\n", "\nunits m\n", 1).replace("armature 2500", "armature 2500e-6"))
    assert numbers_of(metres)[1] == pytest.approx((NUMBERS[1][0], 0.1, 0.0), rel=1e-15)
    assert numbers_of(metres)[0] == pytest.approx(NUMBERS[0], rel=1e-15)


@pytest.mark.parametrize("kind", ["urdf", "sdf", "mjcf"])
def test_every_format_and_raff_again_have_the_same_numbers_and_gravity(tmp_path, kind):
    """A URDF has friction, and its constraints file the armature."""
    path, written, back, down = tmp_path / "arm.raff", tmp_path / "out", tmp_path / "back.raff", [0.25, 0.0, -1.62]
    path.write_text(ARM.replace("\n", "\ngravity { 0.25 0 -1.62 }\n", 1))
    original = cinegen.load(path)
    raff2urdf.convert(path, written, format=kind)
    (file,) = [output for output in written.iterdir() if output.suffix in (".urdf", ".sdf", ".xml")]
    with warnings.catch_warnings(action="error"):
        raff2urdf.to_raff(file, back)
    for loaded in (cinegen.load(file), cinegen.load(back)):
        assert (numbers_of(loaded), loaded.gravity.tolist()) == (numbers_of(original), down)
    again = parse(back.read_text())
    assert again.gravity == tuple(down)
    for link, other in zip(again.robots[0].links, parse(ARM).robots[0].links, strict=True):
        assert (link.armature, link.damping, link.friction) == (other.armature, other.damping, other.friction)
    if kind == "urdf":
        entries = json.loads((written / "arm.constraints.json").read_text())["joints"]
        assert [entry.get("armature") for entry in entries] == [2500.0e-6, 0.3, None]
        assert file.read_text().count("<dynamics") == 2
        assert '<dynamics damping="100.0" friction="2.0"/>' in file.read_text()


def test_the_gravity_of_a_world_around_it_replaces_that_of_an_sdf_of_ours(tmp_path, text_file):
    path = text_file("arm.raff", ARM.replace("\n", "\ngravity { 0 0 -1.62 }\n", 1))
    raff2urdf.convert(path, tmp_path, format="sdf")
    text = (tmp_path / "arm.sdf").read_text().replace("</sdf>", "</world></sdf>")
    text = text.replace("<model", '<world name="w"><gravity>0 0 -3.7</gravity><model', 1)
    assert cinegen.load(text).gravity.tolist() == [0.0, 0.0, -3.7]


def test_what_is_beyond_all_numbers_in_si_units_is_an_error():
    with pytest.raises(RaffError, match=r"a number of 'gravity' is beyond 1e\+12 m/s2"):
        cinegen.load(ARM.replace("\n", "\ngravity { 0 0 1e13 }\n", 1))
    with pytest.raises(RaffError, match=r":3:\d+: the damping of joint1 is beyond 1e\+12 in SI units"):
        cinegen.load(text_of("link 1 { type 2 pred 0 damping 1e11 }"))
    with pytest.raises(RaffError, match=r"'mass' of the inertial of link 1 is beyond 1e\+12 in SI units"):
        cinegen.load(text_of("link 1 { type 2 pred 0 inertial { mass 1e13 } }"))


def test_a_variable_of_several_has_its_own_numbers_and_then_a_ball_is_no_spherical_joint():
    text = text_of("link 1 { joint ball pred 0 variable y { armature 1000000 damping 1 friction 3 } }")
    ball = cinegen.load(text)
    assert ball.joints == ("joint1_X", "joint1_Y", "joint1_Z")
    armature, damping, friction = (row[1] for row in numbers_of(ball))
    assert (armature, friction) == (1.0, 3.0)
    assert damping == pytest.approx(180.0 / math.pi)
    assert cinegen.load(text_of("link 1 { joint ball pred 0 }")).balls == ("joint1",)


URDF = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
  <joint name="turn" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
    <dynamics damping="0.2" friction="0.1" spring_stiffness="4"/></joint>
  <joint name="roll" type="planar"><parent link="b"/><child link="c"/><dynamics damping="3"/></joint></robot>"""


def test_what_a_urdf_has_for_joints_of_several_variables_is_told():
    mechanism = cinegen.load(URDF)
    assert numbers_of(mechanism) == ((0.0,) * 4, (0.2, 0.0, 0.0, 0.0), (0.1, 0.0, 0.0, 0.0))
    assert "forces leave out the damping of roll, the springs of turn" in mechanism.source.notes


SDF = """<sdf version="1.9"><model name="m"><link name="a"/><link name="b"/>
  <link name="c"><pose>1 0 0 0 0 0</pose></link>
  <joint name="ground" type="fixed"><parent>world</parent><child>a</child></joint>
  <joint name="cross" type="universal"><parent>a</parent><child>b</child>
    <axis><xyz>0 0 1</xyz><dynamics><damping>0.2</damping></dynamics></axis>
    <axis2><xyz>0 1 0</xyz><dynamics><friction>0.3</friction></dynamics></axis2></joint>
  <joint name="hinge" type="revolute"><parent>b</parent><child>c</child><axis><xyz>0 0 1</xyz></axis></joint>
  <joint name="cut" type="revolute"><parent>a</parent><child>c</child>
    <axis><xyz>0 0 1</xyz><dynamics><friction>1</friction></dynamics></axis></joint></model></sdf>"""


def test_each_axis_of_an_sdf_has_its_friction_and_that_of_a_cut_joint_is_told():
    mechanism = cinegen.load(SDF)
    assert numbers_of(mechanism) == ((0.0,) * 3, (0.2, 0.0, 0.0), (0.0, 0.3, 0.0))
    assert "forces leave out the friction of cut" in mechanism.source.notes
    with pytest.raises(cinegen.CinegenError, match=r":5: the damping '-0.2' of joint 'cross' must be a number, and"):
        cinegen.load(SDF.replace("<damping>0.2<", "<damping>-0.2<"))
