"""Loops and couplings in a URDF that can't be read: refused at their line, never lost."""

import json
import re
import shutil
import warnings
from pathlib import Path

import pytest
from urdf_text import BARS

import cinegen
import raff2urdf
from raff2urdf import readers
from raff2urdf.errors import RaffError, RaffWarning

ENDS = '<parent link="coupler"/><child link="rocker"/>'
LINKS = '<link1 link="coupler"/><link2 link="rocker"/>'
YAML = "closed_loop: [[coupler, rocker]]\ntype: [3d]\nname_mot: [drive]\n"


@pytest.fixture
def bars(text_file):
    return lambda added: text_file("bars.urdf", f"{BARS}{added}\n</robot>")


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
    with pytest.raises(RaffError, match=f"^{re.escape(f'{path}:6: {says}')}") as caught:
        readers.read(path)
    assert "--ignore-loops (in Python ignore_loops=True)" in str(caught.value)
    word = re.search(r'--ignore (\S+) [(]in Python ignore=\["\1"\][)]', str(caught.value))
    assert word or dialect == "raff2urdf"
    if word:
        with pytest.warns(RaffWarning, match=r"left out, as requested: .*\(line 6\)"):
            assert readers.read(path, ignore=[word[1]]).constraints is None
    with pytest.warns(RaffWarning, match=r"requested; every joint moves independently: .*\(line [67]\)") as seen:
        assert readers.read(path, ignore_loops=True).constraints is None
    assert len(seen) == 1
    with pytest.warns(RaffWarning, match="<text>: left out, as requested"):
        assert readers.read(Path("<text>"), ignore_loops=True, text=path.read_text()).constraints is None


@pytest.mark.parametrize("dialect", ["another constraint", "Gazebo plugin with other words", "MuJoCo"])
def test_each_loads_where_a_sidecar_file_closes_the_loop(dialect, bars, tmp_path):
    """It closes neither couplings, nor the loop of an element that is read."""
    (tmp_path / "robot.yaml").write_text(YAML)
    description = readers.read(bars(UNREAD[dialect][0]))
    assert [loop["name"] for loop in description.constraints["loops"]] == ["coupler-rocker"]
    assert description.dialects == ("robot.yaml",)
    with pytest.raises(RaffError, match="declares a loop, which can't be read"):
        readers.read(bars(f"{UNREAD[dialect][0]}{READABLE}"))
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


# --- sidecar ----------------------------------------------------------------------------------------------------------
# A sidecar file that is not read, because of its name or a broken link, is not passed over in silence.


@pytest.fixture
def five_bar(root, tmp_path, text_file):
    """A URDF and its constraints; the note that names them was lost on the way."""
    (made,) = raff2urdf.convert(root / "robots" / "five_bar.raff", tmp_path)
    text_file("five_bar.urdf", re.sub("  <!--.*-->\n", "", made.urdf.read_text()))
    return tmp_path


def refused(path, message):
    with pytest.raises(RaffError, match=message) as caught:
        readers.read(path)
    assert "--ignore-loops (in Python ignore_loops=True)" in str(caught.value)
    with pytest.warns(RaffWarning, match="left out, as requested"):
        assert readers.read(path, ignore_loops=True)[1] is None


RENAMED = "{} fits this URDF and no other one here: rename it to "
COPIED = "{} was written for the same links and joints: copy it to r.constraints.json"
KEPT = "five_bar.constraints.json"
YML = "{0} is not read under this name: rename it to {1}"
GONE = "{} is a link to gone.json, which does not exist: restore that file"


def renamed(old, new):
    return lambda folder: (folder / old).rename(folder / new)


def instead(name, text=None):
    """Another file instead of the constraints; without a text a link to nowhere."""

    def change(folder):
        (folder / KEPT).unlink()
        (folder / name).symlink_to("gone.json") if text is None else (folder / name).write_text(text)

    return change


LOOP = "closed_loop: [[link5, link3]]\ntype: [6d]\n"


@pytest.mark.parametrize(("change", "says"), [
    (renamed("five_bar.urdf", "r.urdf"), f"{RENAMED.format(KEPT)}r.constraints.json, or leave the loops open"),
    (renamed(KEPT, f"five_bar.urdf.{KEPT}"), f"{RENAMED.format(f'five_bar.urdf.{KEPT}')}five_bar"),
    (instead("robot.yaml"), GONE.format("robot.yaml")),
    (instead("Robot.yaml", LOOP), YML.format("Robot.yaml", "robot.yaml")),
    (instead("five_bar.yml", LOOP), YML.format("five_bar.yml", "five_bar.yaml")),
    # a copy: the constraints name the URDF by its hash, though they belong to another one by their name
    (lambda folder: shutil.copy(folder / "five_bar.urdf", folder / "r.urdf"), COPIED.format(KEPT)),
    (lambda folder: renamed(KEPT, "any.json")(shutil.copy(folder / "five_bar.urdf", folder / "r.urdf").parent),
     COPIED.format("any.json")),
])  # fmt: skip
def test_loops_that_a_file_of_another_name_holds_are_not_lost(change, says, five_bar):
    change(five_bar)
    refused(five_bar / ("r.urdf" if (five_bar / "r.urdf").exists() else "five_bar.urdf"), says)


# --- constraints name their URDF ---------------------------------------------------------------------------------


def edited(folder, old, new):
    text = (folder / "five_bar.urdf").read_text()
    assert old in text
    (folder / "five_bar.urdf").write_text(text.replace(old, new, 1))
    return folder / "five_bar.urdf"


@pytest.mark.parametrize(("old", "new"), [
    ('name="joint1" type="revolute"', 'name="joint1" type="continuous"'),
    ('lower="1.0471975511965976"', 'lower="1.1"'),
    ("\n", "\r\n"),
    ('length="0.25"', 'length="0.26"'),  # of a shape
    ("<robot", "<!-- edited --><robot"),
    ('xyz="0.25 0.0 0.0" rpy="0.0 0.0 0.0"', 'rpy="0 -0.0 0" xyz=" 25e-2  0 0"'),
    ("<visual>", '<inertial><mass value="1"/></inertial><visual>'),
])  # fmt: skip
def test_changes_without_effect_on_the_loops_are_no_others(five_bar, old, new):
    quiet(edited(five_bar, old, new))


@pytest.mark.parametrize(("old", "new"), [
    ('<axis xyz="0.0 0.0 1.0"/>', '<axis xyz="0.0 0.0 -1.0"/>'),
    ('<child link="link1"/>\n    <origin xyz="-0.15', '<child link="link1"/>\n    <origin xyz="-0.16'),
    ('<link name="tool"/>', '<link name="tool"/><link name="camera"/><joint name="c" type="fixed">'
     '<parent link="tool"/><child link="camera"/></joint>'),
])  # fmt: skip
def test_other_changes_are_reported(five_bar, old, new):
    with pytest.warns(RaffWarning, match=r'put "urdf_sha256": "\w{64}" there'):
        readers.read(edited(five_bar, old, new))


def test_a_limit_that_is_edited_in_the_urdf_holds(five_bar):
    path = edited(five_bar, 'lower="1.0471975511965976"', 'lower="1.1"')
    assert cinegen.load(path).limits["joint1"].lower == 1.1


# --- no false alarms ---------------------------------------------------------------------------------------------


def quiet(path):
    with warnings.catch_warnings(action="error"):
        return readers.read(path)[1]


def test_constraints_of_another_robot(five_bar, root):
    """They share the names of most links and joints."""
    for name, lost in (("four_bar", "urdf"), ("planar_3r", "constraints.json")):
        raff2urdf.convert(root / "robots" / f"{name}.raff", five_bar)
        (five_bar / f"{name}.{lost}").unlink()
    urdf = five_bar / "planar_3r.urdf"
    urdf.write_text(re.sub("  <!--.*-->\n", "", urdf.read_text()))
    assert quiet(urdf) is None


NO_CONSTRAINTS = ["", "[]", "{}", '{"loops": 5}', '{"loops": [], "joints": [], "robot": "linkage"}', "[" * 9999]


@pytest.mark.parametrize("text", NO_CONSTRAINTS)
def test_files_that_are_no_constraints(text, five_bar):
    (five_bar / "five_bar.constraints.json").rename(five_bar / "five_bar.constraints.json.bak")
    (five_bar / "constraints.json").write_text(text)
    (five_bar / "five_bar.yaml").write_text("controller: {}\n")
    (five_bar / "loop_closures.yaml").write_text("closures: [{link_a: left, link_b: base}]\n")
    assert quiet(five_bar / "five_bar.urdf") is None


def test_every_robot_of_ours_is_read_in_silence(root):
    for path in sorted((root / "generated").glob("*.urdf")):
        said = json.loads(path.with_suffix(".constraints.json").read_text())
        assert quiet(path)["loops"] == said["loops"], path
