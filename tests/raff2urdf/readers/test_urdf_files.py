"""A URDF is read with what is wrong in it told by its line."""

import json
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_like_names import names
from urdf_text import BARS, joint_at, joint_text, links, robot

import cinegen
from raff2urdf import readers
from raff2urdf.errors import RaffError
from raff2urdf.readers.ignored import ignored
from raff2urdf.readers.urdf import default_value, joints, limits, velocity
from raff2urdf.readers.urdf_file import parse
from raff2urdf.readers.xml_file import parse_xml, read_text
from raff2urdf.urdf2raff.cli import main as urdf2raff

ARM = """<robot name="arm">
  <link name="base"><visual><geometry><mesh filename="nowhere.stl" scale="2 2 2"/></geometry></visual></link>
  <link name="upper"/>
  <link name="tool"/>
  <joint name="turn" type="revolute">
    <parent link="base"/>
    <child link="upper"/>
    <origin xyz="0.1 0 1" rpy="0 0 0.5"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" effort="1" velocity="3"/>
  </joint>
  <joint name="hold" type="fixed">
    <parent link="upper"/>
    <child link="tool"/>
  </joint>
</robot>"""


@pytest.mark.parametrize(("change", "says"), [
    (('<child link="tool"/>', '<child link="upper"/>'), r"x:12: joint 'hold' has the child 'upper' .*line 5: "),
    (('<link name="tool"/>', '<link name="upper"/>'), r"x:4: link 'upper' is defined twice, first on line 3"),
    (('rpy="0 0 0.5"', 'rpy="0 0"'), r'x:8: rpy="0 0" of <origin> must be three numbers'),
    (('velocity="3"', 'velocity="-3"'), r"x:10: the velocity limit of joint 'turn' is -3: it must not be negative"),
    (('lower="-1"', 'lower="nan"'), r"x:10: the lower limit 'nan' of joint 'turn' is not a number"),
    (('<limit', '<dynamics damping="thick"/><limit'), r"x:10: the damping 'thick' of joint 'turn' must be a"),
    (('<limit', '<dynamics friction="-1"/><limit'), r"x:10: the friction '-1' of joint 'turn' .* not negative"),
    (('xyz="0.1 0 1"', 'xyz="0 1e308 1"'), r"x:8: .* must be three numbers \(none beyond 1e\+13\)"),
])  # fmt: skip
def test_what_is_wrong_is_told_by_its_line(change, says):
    assert len(joints(parse(ARM, "x"))) == 2
    wrong = ARM.replace(*change)
    assert wrong != ARM
    with pytest.raises(RaffError, match=says):
        parse(wrong, "x")


@pytest.mark.parametrize(("limit", "allowed", "fastest"), [
    ('<limit lower="-1" upper="2" velocity="3"/>', (-1.0, 2.0), 3.0),
    ('<limit lower="-1"/>', (-1.0, 0.0), None),
    ('<limit effort="1" velocity="0"/>', None, None),
    ("", None, None),
    ('<limit lower="-1e9" upper="1e9" velocity="1e9"/>', None, None),
    ('<limit lower="-inf" upper="inf" velocity="inf"/>', None, None),
    ('<limit lower="2" upper="inf" velocity="0"/>', (2.0, 1e9), None),
    ('<limit lower="-1e308" upper="2"/>', (-1e9, 2.0), None),
])  # fmt: skip
def test_limits_that_are_left_out_or_beyond_all_measure_are_none(limit, allowed, fastest):
    text = ARM.replace('<limit lower="-1" upper="2" effort="1" velocity="3"/>', limit)
    turn = joints(parse(text, "x"))[0]
    assert limits(turn) == allowed
    assert velocity(turn) == fastest


def test_a_joint_stands_at_zero_or_inside_its_limits():
    assert [default_value(allowed) for allowed in (None, (-1.0, 2.0), (1.0, 2.0))] == [0.0, 0.0, 1.5]
    assert [default_value(allowed) for allowed in ((2.0, 1e9), (-1e9, -3.0))] == [3.0, -4.0]


# --- common slips -----------------------------------------------------------------------------------------------------
# Slips in URDFs that have one meaning are read so, with a note.


@pytest.mark.parametrize(("before", "after", "note"), [
    ("0.1 0 1", "0.1, 0, 1", 'xyz="0.1, 0, 1" of <origin> on line 8: commas between numbers are left out'),
    ('scale="2 2 2"', 'scale="2 2 2 1"', 'scale="2 2 2 1" of <mesh> on line 2: the first three factors are read'),
])  # fmt: skip
def test_what_has_one_meaning_is_read(before, after, note):
    written, meant = cinegen.load(ARM.replace(before, after)), cinegen.load(ARM)
    assert written.source.notes == (*meant.source.notes, note)
    assert written.placement(written.q_home, "tool") == meant.placement(meant.q_home, "tool")


def test_a_speed_or_an_effort_of_less_one_is_no_limit():
    arm = cinegen.load(ARM.replace('effort="1" velocity="3"', 'effort="-1" velocity="-1.0"'))
    assert arm.limits["turn"] == (-1.0, 2.0, float("inf"), float("inf"))
    assert arm.source.notes == ('velocity="-1.0" of <limit> on line 10 and 1 more: -1 is read as no limit',)


def test_commas_may_be_decimal_ones():
    with pytest.raises(cinegen.CinegenError, match=r'xyz="0,1 0 1,0" of <origin> must be three numbers'):
        cinegen.load(ARM.replace('xyz="0.1 0 1"', 'xyz="0,1 0 1,0"'))


# --- ignored ----------------------------------------------------------------------------------------------------------
# Elements that are not read are listed; none that could remove degrees of freedom is among them.


FIXED = "<joint name='j' type='fixed'><parent link='crank'/>"
ENDS = '<a link="crank"/><b link="rocker"/>'


def write(folder: Path, added: str) -> Path:
    path = folder / "bars.urdf"
    path.write_text(f"{BARS}{added}\n</robot>")
    return path


@pytest.mark.parametrize(("added", "element"), [
    ("<transmission name='t'><type>t</type></transmission>", "robot/transmission"),
    ("<gazebo reference='crank'><material>Gazebo/Blue</material></gazebo>", "gazebo/material"),
    ("<gazebo><plugin name='p' filename='control.so'/></gazebo>", "gazebo/plugin"),
    ("<gazebo><joint name='a'><parent>world</parent><child>ground</child></joint></gazebo>", "gazebo/joint"),
    ("<gazebo><joint name='a' type='fixed'><parent>rocker</parent><child>camera</child></joint></gazebo>",
     "gazebo/joint"),
    ("<ros2_control name='r' type='system'/>", "robot/ros2_control"),
    ("<ros2_control name='r'><joint name='drive'><state_interface/></joint></ros2_control>", "robot/ros2_control"),
    ("<sensor name='s'/>", "robot/sensor"),
    (f"<link name='x'><custom/></link>{FIXED}<child link='x'/></joint>", "link/custom"),
    ("<frame name='tool' link='crank'/>", "robot/frame"),
    # loops and couplings are read, but not what stands beside them
    ("<loop_joint name='pin' type='spherical'><link1 link='crank'/><link2 link='rocker'/></loop_joint>", None),
    ("<frame name='closing_a_1' link='crank'/><frame name='closing_a_2' link='rocker'/>", None),
    ("<ros2_control name='r' type='system'><joint name='swing'><param name='mimic'>drive</param></joint><hardware/>"
     "</ros2_control>", "ros2_control/hardware"),
    # what only sounds like a loop
    ("<!-- <loop name='x'/> -->", None),
    ("<gazebo><plugin name='wheel_loop' filename='a.so'><closed_loop>true</closed_loop></plugin></gazebo>",
     "gazebo/plugin"),
    ("<ros2_control name='c'><joint name='drive'><param name='loop'>1</param></joint></ros2_control>",
     "robot/ros2_control"),
    ("<enclosure/>", "robot/enclosure"),
    # what drives joints
    ("<transmission name='t'><type>transmission_interface/FourBarLinkageTransmission</type><joint name='drive'/>"
     "<joint name='swing'/></transmission>", None),
    ("<gazebo><plugin name='p' filename='libdiff_drive.so'><leftJoint>drive</leftJoint></plugin></gazebo>", None),
    ("<ros2_control name='r'><joint name='drive'><command_interface name='c'/></joint></ros2_control>", None),
])  # fmt: skip
def test_elements_that_are_not_read_are_listed(added, element, tmp_path):
    path = write(tmp_path, added)
    with warnings.catch_warnings(action="error"):
        readers.read(path)
    assert ignored(path) == ([(element, 1, (6,))] if element else [])


def test_other_formats(root, text_file):
    shapes = '<link name="l"><collision name="c"/><visual name="v"/></link>'
    model = f'<model name="m">{shapes}\n<plugin name="p" filename="f"/></model>'
    path = text_file("arm.sdf", f'<sdf version="1.9">{model}</sdf>')
    assert ignored(path) == [("link/collision", 1, (1,)), ("model/plugin", 1, (2,))]
    world = '<worldbody><light pos="0 0 1"/><body><geom size="1"/></body></worldbody>'
    path = text_file("arm.xml", f"<mujoco>{world}<sensor/></mujoco>")
    assert ignored(path) == [("worldbody/light", 1, (1,)), ("mujoco/sensor", 1, (1,))]
    for name in ("five_bar", "delta4"):
        assert ignored(root / "generated" / f"{name}.urdf") == []


def test_the_command_lists_them(tmp_path, typed):
    path = write(tmp_path, 2 * "<sensor name='s'/>\n")
    assert typed("info", path, "--ignored").out.endswith("  not read:\n    2 <sensor> in <robot>, lines 6, 7\n")
    (listed,) = json.loads(typed("info", path, "--ignored", "--json").out)[0]["ignored"]
    assert listed == {"element": "robot/sensor", "number": 2, "lines": [6, 7]}
    assert typed("info", "four_bar", "--ignored").out.endswith("  everything is read\n")


# --- nothing that looks like a loop is dropped in silence --------------------------------------------------------


@settings(max_examples=300)
@given(name=names(), form=st.integers(0, 5), prefix=st.sampled_from(["", "drake:", "gz:", "my:"]))
def test_no_loop_like_element_is_dropped_in_silence(name, form, prefix, tmp_path_factory):
    """It is read, refused at its line, or warned of; and it is never in the list of what is ignored."""
    element = f"<{prefix}{name} name='e'>{ENDS}</{prefix}{name}>"
    added = [
        element,
        f"<extension>{element}</extension>",
        f"<gazebo>{element}</gazebo>",
        f"<gazebo reference='crank'><plugin name='p' filename='f'>{element}</plugin></gazebo>",
        f"<link name='more'>{element}</link>{FIXED}<child link='more'/></joint>",
        f"<ros2_control name='r' type='system'>{element}</ros2_control>",
    ][form]
    path = write(tmp_path_factory.mktemp("fuzz"), added)
    try:
        with warnings.catch_warnings(action="error"):
            source = readers.read(path)
        noticed = bool(source.constraints and (source.constraints["loops"] or source.constraints.get("couplings")))
    except RaffError as error:
        noticed = f"bars.urdf:6: <{prefix}{name}> 'e'" in str(error)
    except UserWarning:
        noticed = True
    assert noticed, added
    assert not any(name in entry.element for entry in ignored(path))


# --- roots ------------------------------------------------------------------------------------------------------------
# URDFs whose root is not declared, whose trees are joined by loops only, or whose limits are reversed.


PIN = """<loop_joint name="{0}" type="continuous">
  <link1 link="{1}" xyz="{3}"/><link2 link="{2}" xyz="{4}"/><axis xyz="0 0 1"/>
</loop_joint>"""
LIMITED = joint_text("j", "a", "b", '<axis xyz="0 0 1"/><limit {} velocity="1" effort="1"/>', "revolute")


@pytest.fixture
def load(text_file):
    return lambda *elements, **options: cinegen.load(text_file("r.urdf", robot(*elements)), **options)


@pytest.mark.parametrize(("kind", "floating"), [("fixed", False), ("floating", True)])
def test_a_world_that_is_not_declared_is_the_base(load, kind, floating):
    at = joint_text("at", "world", "a", '<origin xyz="0 0 1"/>', kind)
    arm = load(links("a", "b"), at, joint_at("j", "a", "b", "1 0 0"))
    assert (arm.nodes, arm.floating) == (("world", "a", "b"), floating)
    np.testing.assert_allclose(arm.placement(arm.q_home, "b").translation, [1.0, 0.0, 1.0])
    assert "link 'world' is the parent of a joint, and not declared: it is the base" in arm.source.notes
    declared = load(links("world", "a", "b"), at, joint_at("j", "a", "b", "1 0 0"))
    assert (declared.nodes, declared.source.notes) == (arm.nodes, ())


FOUR_BAR = (
    links("ground", "crank", "rocker", "coupler"),
    joint_at("drive", "ground", "crank"),
    joint_at("swing", "ground", "rocker", "0.4 0 0"),
)


@pytest.mark.parametrize("first", ["ground", "coupler"])
def test_a_tree_that_only_loops_join_to_the_base_is_held_by_them(load, first):
    """A coupler without a parent is that of the four-bar in which it has one."""
    pins = [PIN.format("a", "crank", "coupler", "0 0.1 0", "0 0 0")]
    pins += [PIN.format("b", "coupler", "rocker", "0.5 0 0", "0 0.3 0")]
    bodies = links(*sorted(["ground", "crank", "rocker", "coupler"], key=lambda name: name != first))
    mechanism = load(bodies, *FOUR_BAR[1:], *pins)
    usual = load(*FOUR_BAR, joint_at("a", "crank", "coupler", "0 0.1 0"), pins[1])
    assert (mechanism.mobility, usual.mobility) == (1, 1)
    assert mechanism.nodes[0] == "ground"
    assert set(mechanism.nodes) == {"ground", "crank", "rocker", "coupler"}
    assert mechanism.actuated == ("drive",)
    assert "link 'coupler' has no parent: it moves freely on 'ground', and loops hold it" in mechanism.source.notes
    for q in (mechanism.q_home, *mechanism.random_closed(5)):
        crank, coupler, rocker = (mechanism.placement(q, link).homogeneous for link in ("crank", "coupler", "rocker"))
        np.testing.assert_allclose(crank @ [0.0, 0.1, 0.0, 1.0], coupler @ [0.0, 0.0, 0.0, 1.0], atol=1e-9)
        np.testing.assert_allclose(coupler @ [0.5, 0.0, 0.0, 1.0], rocker @ [0.0, 0.3, 0.0, 1.0], atol=1e-9)
        np.testing.assert_allclose(coupler[2], [0.0, 0.0, 1.0, 0.0], atol=1e-9)  # it stays in the plane


def test_two_trees_meet_in_a_link_with_two_parents(load):
    """Both trees are open chains of one arm of three joints: the mobility is that of the arm."""
    meeting = [joint_at(name, parent, "tool", "0.5 0 0") for name, parent in (("j1", "a1"), ("j2", "b1"))]
    trees = [joint_at("ja", "a", "a1", "0 0 0"), joint_at("jb", "b", "b1", "0 0 0")]
    assert load(links("a", "a1", "b", "b1", "tool"), *trees, *meeting).mobility == 4


def test_trees_that_nothing_joins_are_refused_with_a_joint_that_joins_them(load):
    elements = [*FOUR_BAR, PIN.format("a", "crank", "rocker", "0 0.1 0", "0.4 0.1 0")]
    says = r"r.urdf:2: 2 links have no parent, .*: 'ground' .*, 'coupler' "
    with pytest.raises(cinegen.CinegenError, match=says) as refused:
        load(*elements)
    joining = re.search("<joint .*</joint>", str(refused.value))[0]
    assert load(*elements, joining).nodes[0] == "ground"
    pinned = [*FOUR_BAR, PIN.format("a", "crank", "coupler", "0 0.1 0", "0 0 0")]
    with pytest.raises(cinegen.CinegenError, match="2 links have no parent"):
        load(*pinned, ignore_loops=True)
    assert load(*pinned, joining, ignore_loops=True).mobility == 2


@pytest.mark.parametrize(("limits", "edit"), [
    ('lower="1" upper="-0.5"', 'lower="-0.5" upper="1"'),
    ('upper="-1"', 'lower="-1" upper="0"'),
    ('lower="0.5"', 'lower="0" upper="0.5"'),
])  # fmt: skip
def test_reversed_limits_are_refused_and_exchanged_on_request(tmp_path, text_file, limits, edit, typed):
    path = text_file("r.urdf", robot(links("a", "b"), LIMITED.format(limits)))
    said = typed("info", path, code=1).err
    assert f"swap them ({edit}), or add --swap-limits (in Python swap_limits=True)" in said
    option = re.search(r"add (--\S+)", said)[1]
    assert "lower and upper limits exchanged, as requested: j" in typed("info", path, option).err
    assert urdf2raff([str(path), "-o", str(tmp_path / "r.raff"), option]) == 0
    with pytest.warns(UserWarning, match="exchanged"):
        swapped = cinegen.load(path, swap_limits=True)
    path.write_text(robot(links("a", "b"), LIMITED.format(edit)))
    assert swapped.limits["j"][:2] == cinegen.load(path).limits["j"][:2]


# --- xml file ---------------------------------------------------------------------------------------------------------
# XML as robots are published in; what could make a program read what it must not is refused.


@pytest.mark.parametrize("text", [
    "<robot><drake:joint drake:name='x'/><link/></robot>", "<robot><plugin gz::kind='x'/><link/></robot>",
    "<robot><!-- a -- b --><link/></robot>", "\n  <?xml version='1.0'?><robot><link/></robot>",
    "<?xml version='0.0'?><robot><link/></robot>",
    "\ufeff<?xml version='1.0' encoding='utf-16'?><robot><link/></robot>",
    "<robot xmlns='http://drake.mit.edu'><link/></robot>",
])  # fmt: skip
def test_what_can_mean_only_one_thing_is_read(text):
    tree = parse_xml(text, "x")
    assert tree.tag == "robot"
    assert tree.find("link") is not None


@pytest.mark.parametrize(("text", "says"), [
    ("", "x:1: invalid XML"),
    ("<robot>\n<link>\n</robot>", r"x:3: invalid XML: Opening and ending tag mismatch"),
    ("<robot/><robot/>", "x:1: invalid XML: Extra content"),
    ("<robot>\n" + 10_000 * "<a>" + 10_000 * "</a>" + "</robot>", "x:2: invalid XML: Excessive depth"),
    ("<!DOCTYPE r [<!ENTITY a 'ha'><!ENTITY b '&a;&a;'>]><r>&b;</r>", "x:1: the entity 'a' is not read"),
    ("<!DOCTYPE r [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><r>&a;</r>", "x:1: the entity 'a' is not read"),
    ("<!DOCTYPE r SYSTEM 'x.dtd'><r>\n&b;</r>", r"x:\d: the entity 'b' is not read"),
    (b"<r>\n\xe9</r>", "x:2: this is not text in utf-8: save the file as UTF-8"),
    (b"<?xml version='1.0' encoding='klingon'?><r/>", "x:1: unknown encoding 'klingon'"),
])  # fmt: skip
def test_what_is_no_xml_is_told_by_its_line(text, says, tmp_path):
    path = tmp_path / "x"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(RaffError, match=says):
        parse_xml(read_text(path), "x")


def test_a_text_is_read_in_the_encoding_that_it_says(tmp_path):
    path = tmp_path / "a.xml"
    text = "<r a='\xe9'/>"
    declared = f"<?xml version='1.0' encoding='ISO-8859-1'?>{text}".encode("latin-1")
    for content in (text.encode(), text.encode("utf-8-sig"), text.encode("utf-16"), declared):
        path.write_bytes(content)
        assert parse_xml(read_text(path), "x").get("a") == "\xe9"
