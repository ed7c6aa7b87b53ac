"""Loops and couplings in a URDF that can't be read: refused at their line, never lost."""

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
LINKS = '<link1 link="coupler"/><link2 link="rocker"/>'
YAML = "closed_loop: [[coupler, rocker]]\ntype: [3d]\nname_mot: [drive]\n"


@pytest.fixture
def bars(tmp_path):
    def write(added: str, name: str = "bars.urdf") -> Path:
        path = tmp_path / name
        path.write_text(f"{HEAD}{added}\n</robot>")
        return path

    return write


READABLE = f'<loop_joint name="pin" type="spherical">{LINKS}</loop_joint>'

UNREAD = {
    "another constraint": (
        f'<weld_constraint name="pin">{ENDS}</weld_constraint>',
        "<weld_constraint> 'pin' ('coupler', 'rocker') declares a loop, which can't be read",
    ),
    "Drake's tendon": (
        '<drake:tendon_constraint xmlns:drake="urn:d"><drake:tendon_constraint_joint name="drive"/>'
        '<drake:tendon_constraint_joint name="swing"/></drake:tendon_constraint>',
        "<drake:tendon_constraint> ('drive', 'swing') declares a coupling",
    ),
    "gear": ('<gear name="g"><joint1 name="drive"/><joint2 name="swing"/></gear>', "<gear> 'g' ('drive', 'swing')"),
    "Gazebo plugin with other words": (
        '<gazebo><plugin name="ClosedLoop" filename="x.so"><a>coupler</a><b>rocker</b></plugin></gazebo>',
        "<plugin> 'ClosedLoop' in <gazebo> ('coupler', 'rocker') declares a loop",
    ),
    "MuJoCo": ('<mujoco><equality><connect body1="coupler" body2="rocker"/></equality></mujoco>', "<equality> ("),
    "raff2urdf": (
        "<!-- raff2urdf constraints: pin-hole.constraints.json (2 loops) -->",
        "according to this comment, the loops are in pin-hole.constraints.json, but they were not read. Restore that",
    ),
}


@pytest.mark.parametrize("dialect", UNREAD)
def test_each_is_refused_at_its_line_with_a_remedy(dialect, bars):
    added, says = UNREAD[dialect]
    path = bars(added)
    with pytest.raises(RaffError) as caught:
        readers.read(path)
    assert str(caught.value).startswith(f"{path}:6: {says}")
    assert "--ignore-loops (in Python ignore_loops=True)" in str(caught.value)
    word = re.search(r'--ignore (\S+) [(]in Python ignore=\["\1"\][)]', str(caught.value))
    assert word or dialect == "raff2urdf"
    if word:
        with pytest.warns(RaffWarning, match=r"left out, as requested: .*\(line 6\)"):
            assert readers.read(path, ignore=[word[1]]).constraints is None
    with pytest.warns(
        RaffWarning, match=r"left out, as requested; every joint moves independently: .*\(line [67]\)"
    ) as seen:
        assert readers.read(path, ignore_loops=True).constraints is None
    assert len(seen) == 1


@pytest.mark.parametrize("dialect", ["another constraint", "Gazebo plugin with other words", "MuJoCo"])
def test_each_loads_where_a_sidecar_file_closes_the_loop(dialect, bars, tmp_path):
    (tmp_path / "robot.yaml").write_text(YAML)
    found = readers.read(bars(UNREAD[dialect][0]))
    assert [loop["name"] for loop in found.constraints["loops"]] == ["coupler-rocker"]
    assert found.dialects == ("robot.yaml",)


@pytest.mark.parametrize("dialect", ["another constraint", "MuJoCo"])
def test_a_loop_that_an_element_declares_does_not_stand_for_one_that_cannot_be_read(dialect, bars, tmp_path):
    (tmp_path / "robot.yaml").write_text(YAML)  # the loop of the element that is read
    with pytest.raises(RaffError, match="declares a loop, which can't be read"):
        readers.read(bars(f"{UNREAD[dialect][0]}{READABLE}"))


def test_a_sidecar_file_does_not_close_couplings(bars, tmp_path):
    (tmp_path / "robot.yaml").write_text(YAML)
    with pytest.raises(RaffError, match="declares a coupling"):
        readers.read(bars(UNREAD["gear"][0]))


def test_a_sidecar_file_must_close_as_many_loops_as_are_declared(bars, tmp_path):
    (tmp_path / "robot.yaml").write_text(YAML)
    loop = UNREAD["another constraint"][0]
    readers.read(bars(f"{loop}{UNREAD['MuJoCo'][0]}"))  # twice the same
    with pytest.raises(RaffError, match=r"Also not read: <weld_constraint> 'pin' \(line 6\). Declare the loops in"):
        readers.read(bars(2 * loop))
    with pytest.raises(RaffError, match=r"according to this comment, the loops are in pin-hole"):  # two loops
        readers.read(bars(UNREAD["raff2urdf"][0]))
    (tmp_path / "robot.yaml").write_text("name_mot: [drive]\n")
    with pytest.raises(RaffError, match="<weld_constraint> 'pin'"):
        readers.read(bars(loop))


@pytest.mark.parametrize("added", [
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
])  # fmt: skip
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


def test_a_second_parent_is_removed_from_the_tree(bars):
    path = bars(f'<joint name="pin" type="continuous">\n{ENDS}</joint>')
    with pytest.warns(RaffWarning, match=r"every joint moves independently: joint 'pin' \(line 6\)"):
        opened = readers.read(path, ignore_loops=True)
    for text in (opened.urdf, readers.read(path).urdf):
        assert '"pin"' not in text
        assert text.count("<joint") == 3


# --- raff2urdf's own URDFs ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("elements", [False, True])
def test_a_urdf_of_ours_without_its_constraints_is_refused(elements, root, tmp_path):
    raff2urdf.convert(root / "robots" / "five_bar.raff", tmp_path, dialect="constraint" if elements else "json")
    urdf = tmp_path / "five_bar.urdf"
    assert len(readers.read(urdf)[1]["loops"]) == 1
    (tmp_path / "five_bar.constraints.json").unlink()
    if elements:
        assert len(readers.read(urdf)[1]["loops"]) == 1
        return
    with pytest.raises(RaffError, match=r"five_bar\.urdf:4: according to this comment, the loops are in five_bar"):
        readers.read(urdf)
    urdf.write_text(re.sub("  <!-- raff2urdf constraints: .*-->\n", "", urdf.read_text()))
    assert readers.read(urdf)[1] is None  # nothing in it tells of a loop


def test_a_urdf_of_ours_without_loops_names_its_constraints_too(root, tmp_path):
    """They have its home and its sensors."""
    raff2urdf.convert(root / "robots" / "arm7.raff", tmp_path)
    urdf = tmp_path / "arm7.urdf"
    assert "<!-- raff2urdf constraints: arm7.constraints.json (0 loops) -->" in urdf.read_text()
    (tmp_path / "arm7.constraints.json").unlink()
    with pytest.warns(raff2urdf.RaffWarning, match=r"arm7\.urdf:4: this comment names arm7\.constraints\.json"):
        assert readers.read(urdf)[1] is None
