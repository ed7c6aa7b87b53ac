"""Loops and couplings that a URDF declares in elements that are not read: refused at their line, never lost."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import pytest

import raff2urdf
from raff2urdf import readers
from raff2urdf.errors import RaffError, RaffWarning

HEAD = """<robot name="bars">
  <link name="ground"/> <link name="crank"/> <link name="coupler"/> <link name="rocker"/>
  <joint name="drive" type="continuous"> <parent link="ground"/> <child link="crank"/> </joint>
  <joint name="elbow" type="continuous"> <parent link="crank"/> <child link="coupler"/> </joint>
  <joint name="swing" type="continuous"> <parent link="ground"/> <child link="rocker"/> </joint>
"""  # what is added begins on line 6

ENDS = '<parent link="coupler"/><child link="rocker"/>'
SDF_ENDS = "<parent>coupler</parent><child>rocker</child>"
YAML = "closed_loop: [[coupler, rocker]]\ntype: [3d]\nname_mot: [drive]\n"


@pytest.fixture
def bars(tmp_path):
    def write(added: str, name: str = "bars.urdf") -> Path:
        path = tmp_path / name
        path.write_text(f"{HEAD}{added}\n</robot>")
        return path

    return write


DIALECTS = {
    "URDF+": (
        '<loop name="pin" type="revolute"><predecessor link="coupler"/><successor link="rocker"/></loop>',
        "<loop> 'pin' ('coupler', 'rocker') declares a loop",
    ),
    "URDF+ coupling": (
        '<coupling name="gear"><predecessor link="crank"/><successor link="rocker"/><ratio value="6"/></coupling>',
        "<coupling> 'gear' ('crank', 'rocker') declares a coupling, which is not read from a URDF. Couplings are not",
    ),
    "ROS proposal": (
        f'<constraint name="pin" type="revolute">{ENDS}</constraint>',
        "<constraint> 'pin' ('coupler', 'rocker') declares a loop",
    ),
    "onshape-to-robot": (
        '<link name="closing_pin_1"/><link name="closing_pin_2"/>'
        '<joint name="closing_pin_1_frame" type="fixed"><parent link="coupler"/><child link="closing_pin_1"/></joint>\n'
        '<joint name="closing_pin_2_frame" type="fixed"><parent link="rocker"/><child link="closing_pin_2"/></joint>',
        "the frames 'closing_pin_1' and 'closing_pin_2' (line 6) declare a loop",
    ),
    "frames": (
        '<frame name="left/closing_pin_1" link="coupler"/>\n<frame name="left/closing_pin_2" link="rocker"/>',
        "the frames 'left/closing_pin_1' and 'left/closing_pin_2' (line 7) declare a loop",
    ),
    "Isaac Sim": (
        '<loop_joint name="pin" type="spherical"><link1 link="coupler"/><link2 link="rocker"/></loop_joint>',
        "<loop_joint> 'pin' ('coupler', 'rocker') declares a loop",
    ),
    "Drake constraint": (
        '<drake:ball_constraint><drake:ball_constraint_body_A name="coupler"/>'
        '<drake:ball_constraint_body_B name="rocker"/></drake:ball_constraint>',
        "<drake:ball_constraint> ('coupler', 'rocker') declares a loop",
    ),
    "Drake bushing": (
        '<drake:linear_bushing_rpy xmlns:drake="urn:d"><drake:bushing_frameA name="crank"/></drake:linear_bushing_rpy>',
        "<drake:linear_bushing_rpy> ('crank') declares a loop",
    ),
    "Drake joint": (
        f'<drake:joint name="pin" type="universal">{ENDS}</drake:joint>',
        "<drake:joint> 'pin' ('coupler', 'rocker') declares a loop",
    ),
    "Gazebo joint": (
        f'<gazebo><joint name="pin" type="revolute">{SDF_ENDS}</joint></gazebo>',
        "<joint> 'pin' in <gazebo> ('coupler', 'rocker') declares a loop",
    ),
    "Gazebo joint to the world": (
        '<gazebo><joint name="a" type="fixed"><parent>world</parent><child>ground</child></joint>'
        '<joint name="b" type="revolute"><parent>world</parent><child>bars::rocker</child></joint></gazebo>',
        "<joint> 'b' in <gazebo> ('world', 'rocker') declares a loop",
    ),
    "Gazebo plugin": (
        f'<gazebo><plugin name="l" filename="libclosed_loop.so"><joint>pin</joint>{SDF_ENDS}</plugin></gazebo>',
        "<plugin> 'l' in <gazebo> ('coupler', 'rocker') declares a loop",
    ),
    "Gazebo plugin with other words": (
        '<gazebo><plugin name="ClosedLoop" filename="x.so"><a>coupler</a><b>rocker</b></plugin></gazebo>',
        "<plugin> 'ClosedLoop' in <gazebo> ('coupler', 'rocker') declares a loop",
    ),
    "MuJoCo": ('<mujoco><equality><connect body1="coupler" body2="rocker"/></equality></mujoco>', "<equality> ("),
    "raff2urdf": (
        "<!-- raff2urdf constraints: pin-hole.constraints.json (2 loops) -->",
        "according to this comment, the loops are in pin-hole.constraints.json, but none was read. Restore that file",
    ),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_each_dialect_is_refused_at_its_line_with_a_remedy(dialect, bars):
    added, says = DIALECTS[dialect]
    path = bars(added)
    with pytest.raises(RaffError) as caught:
        readers.read(path)
    assert str(caught.value).startswith(f"{path}:6: {says}" if dialect != "Drake joint" else f"{path}:6: ")
    assert says in str(caught.value)
    assert "--ignore-loops (in Python ignore_loops=True)" in str(caught.value)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_each_dialect_is_opened_on_demand_with_a_warning_that_names_it(dialect, bars):
    path = bars(DIALECTS[dialect][0])
    with pytest.warns(
        RaffWarning, match=r"left out, as requested; every joint moves independently: .*\(line [67]\)"
    ) as seen:
        _, said = readers.read(path, ignore_loops=True)
    assert len(seen) == 1
    assert said is None


@pytest.mark.parametrize("dialect", [name for name in DIALECTS if "coupling" not in name])
def test_each_dialect_loads_where_a_sidecar_file_closes_the_loop(dialect, bars, tmp_path):
    (tmp_path / "robot.yaml").write_text(YAML)
    _, said = readers.read(bars(DIALECTS[dialect][0]))
    assert [loop["name"] for loop in said["loops"]] == ["coupler-rocker"]


def test_a_sidecar_file_cannot_declare_couplings(bars, tmp_path):
    (tmp_path / "robot.yaml").write_text(YAML)
    with pytest.raises(RaffError, match="declares a coupling"):
        readers.read(bars(DIALECTS["URDF+ coupling"][0]))


def test_a_sidecar_file_must_close_as_many_loops_as_are_declared(bars, tmp_path):
    (tmp_path / "robot.yaml").write_text(YAML)
    loop = DIALECTS["URDF+"][0]
    readers.read(bars(f"{loop}{DIALECTS['ROS proposal'][0]}"))  # twice the same
    with pytest.raises(RaffError, match=r"Also not read: <loop> 'pin' \(line 6\). Declare all loops .* which has 1"):
        readers.read(bars(2 * loop))
    with pytest.raises(RaffError, match=r"<loop> 'pin' .* declares a loop"):  # the comment's loop was read
        readers.read(bars(f"{DIALECTS['raff2urdf'][0]}{2 * loop}"))
    (tmp_path / "robot.yaml").write_text("name_mot: [drive]\n")
    with pytest.raises(RaffError, match="<loop> 'pin'"):
        readers.read(bars(loop))


WORDS = [
    *("loop", "Loop", "LOOP", "loops", "closed_loop", "closed-loop", "loopClosure", "closure", "closing", "cut_joint"),
    *("kinematic_constraint", "weld_constraint", "bushing", "Coupling", "drake:gear_constraint"),
]
FORMS = (
    "<{}/>",
    "<{} name='x'>{}</{}>",
    "<group><{}/></group>",
    "<x:{} xmlns:x='urn:x'/>",
    "<gazebo><{}>{}</{}></gazebo>",
)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("word", WORDS)
def test_no_loop_like_element_is_lost(word, form, bars):
    word = word.partition(":")[2] if "x:{}" in form and ":" in word else word
    with pytest.raises(RaffError, match=r":6: <.*> .*declares a (loop|coupling)"):
        readers.read(bars(form.format(word, '<a link="crank"/><b>rocker</b>', word)))


@pytest.mark.parametrize("within", ["link", "joint"])
def test_a_loop_like_element_within_a_link_or_a_joint_is_not_lost(within, bars):
    path = bars("")
    text = path.read_text().replace('<link name="crank"/>', '<link name="crank"><constraint name="x"/></link>')
    if within == "joint":
        text = path.read_text().replace('<child link="crank"/>', '<child link="crank"/><Constraint name="x"/>')
    path.write_text(text)
    with pytest.raises(RaffError, match=rf":{2 if within == 'link' else 3}: <[cC]onstraint> 'x' declares a loop"):
        readers.read(path)


@pytest.mark.parametrize(
    "added",
    [
        "<!-- <loop name='x'/> -->",
        "<gazebo><plugin name='wheel_loop' filename='a.so'><closed_loop>true</closed_loop><loop_rate>9</loop_rate>"
        "</plugin></gazebo>",
        "<gazebo><plugin name='closed_loop_controller' filename='a.so'><joint>drive</joint></plugin></gazebo>",
        "<gazebo><joint name='fix' type='fixed'><parent>world</parent><child>ground</child></joint></gazebo>",
        "<gazebo><joint name='a' type='fixed'><parent>rocker</parent><child>camera</child></joint></gazebo>",
        "<transmission name='t'><type>transmission_interface/FourBarLinkageTransmission</type><joint name='drive'/>"
        "<joint name='swing'/></transmission>",
        "<ros2_control name='c' type='system'><joint name='drive'><param name='loop'>1</param></joint></ros2_control>",
        "<sensor name='s'><parent link='crank'/></sensor>",
        "<enclosure/>",
    ],
)
def test_what_is_no_loop_raises_no_alarm(added, bars):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert readers.read(bars(added))[1] is None


def test_a_closing_frame_without_its_partner_is_warned_of(bars):
    ends = '<parent link="crank"/><child link="closing_pin_1"/>'
    added = f'<link name="closing_pin_1"/><joint name="f" type="fixed">{ends}</joint>'
    with pytest.warns(RaffWarning, match=r":6: the frame 'closing_pin_1' .* there is no 'closing_pin_2'"):
        readers.read(bars(added))


def test_a_loop_of_old_gazebo_is_warned_of(bars):
    """Such elements stand in robots that everybody loads as trees: the PR2."""
    hinge = "<joint:hinge name='{}'><body1>coupler</body1><body2>rocker</body2></joint:hinge>"
    with pytest.warns(RaffWarning, match=r":6: <joint:hinge> 'a' in <gazebo> .* Also not read: <joint:hinge> 'b'"):
        readers.read(bars(f"<gazebo>{hinge.format('a')}{hinge.format('b')}</gazebo>"))


def test_a_link_with_two_parents_is_refused_by_both_joints_or_opened(bars):
    path = bars(f'<joint name="pin" type="continuous">\n{ENDS}</joint>')
    says = r":6: joint 'pin' has the child 'rocker' of joint 'swing' on line 5: .*--ignore-loops"
    with pytest.raises(RaffError, match=says):
        readers.read(path)
    with pytest.warns(RaffWarning, match=r"every joint moves independently: joint 'pin' \(line 6\)"):
        text, _ = readers.read(path, ignore_loops=True)
    assert "'pin'" not in text
    assert text.count("<joint") == 3


def test_of_xacro_it_is_said_what_it_is(bars):
    with pytest.raises(RaffError, match=r"declares a loop.*load the output of `xacro"):
        readers.read(bars('<xacro:leg_loop xmlns:xacro="http://ros.org/wiki/xacro"/>'))


def test_urdf2raff_refuses_too_and_opens_on_demand(bars, tmp_path, capsys):
    from raff2urdf.urdf2raff.cli import main

    path = bars(DIALECTS["URDF+"][0])
    out = tmp_path / "bars.raff"
    assert main([str(path), "-o", str(out)]) == 1
    assert "declares a loop" in capsys.readouterr().err
    assert not out.exists()
    assert main([str(path), "-o", str(out), "--ignore-loops"]) == 0
    assert "warning: " in capsys.readouterr().err
    assert raff2urdf.load(out).robot().loops == ()


# --- raff2urdf's own URDFs ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("elements", [False, True])
def test_a_urdf_of_ours_without_its_constraints_is_refused(elements, root, tmp_path):
    raff2urdf.convert(root / "robots" / "five_bar.raff", tmp_path, constraint_elements=elements)
    urdf = tmp_path / "five_bar.urdf"
    assert len(readers.read(urdf)[1]["loops"]) == 1
    (tmp_path / "five_bar.constraints.json").unlink()
    with pytest.raises(RaffError, match=r"five_bar\.urdf:4: according to this comment, the loops are in five_bar"):
        readers.read(urdf)
    urdf.write_text(re.sub("  <!-- raff2urdf constraints: .*-->\n", "", urdf.read_text()))
    if elements:
        with pytest.raises(RaffError, match=r"<constraint> 'link5-tool' .* declares a loop"):
            readers.read(urdf)
    else:
        assert readers.read(urdf)[1] is None  # nothing in it tells of a loop


def test_a_urdf_of_ours_without_loops_has_no_note(root, tmp_path):
    raff2urdf.convert(root / "robots" / "arm7.raff", tmp_path)
    assert "raff2urdf constraints" not in (tmp_path / "arm7.urdf").read_text()
