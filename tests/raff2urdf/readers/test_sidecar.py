"""A sidecar file that is not read, because of its name or a broken link, is not passed over in silence."""

import json
import re
import shutil
import warnings

import pytest

import cinegen
import raff2urdf
from raff2urdf import readers
from raff2urdf.errors import RaffError, RaffWarning


@pytest.fixture
def five_bar(root, tmp_path):
    """A URDF and its constraints; the note that names them was lost on the way."""
    raff2urdf.convert(root / "robots" / "five_bar.raff", tmp_path)
    urdf = tmp_path / "five_bar.urdf"
    urdf.write_text(re.sub("  <!--.*-->\n", "", urdf.read_text()))
    return tmp_path


def refused(path, message):
    with pytest.raises(RaffError, match=message) as caught:
        readers.read(path)
    assert "--ignore-loops (in Python ignore_loops=True)" in str(caught.value)
    with pytest.warns(RaffWarning, match="left out, as requested"):
        assert readers.read(path, ignore_loops=True)[1] is None


RENAMED = "{} fits this URDF and no other one here: rename it to "

KEPT = "five_bar.constraints.json"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("five_bar.urdf", "r.urdf", RENAMED.format(KEPT) + "r.constraints.json, or leave the loops open"),
        (KEPT, "loops.json", RENAMED.format("loops.json") + "five_bar"),
        (KEPT, "five_bar.urdf.constraints.json", RENAMED.format("five_bar.urdf.constraints.json") + "five_bar"),
        (KEPT, "FIVE_BAR.CONSTRAINTS.json", "FIVE_BAR.CONSTRAINTS.json differs only in case: rename it to five_bar"),
    ],
)
def test_a_file_that_was_renamed(old, new, says, five_bar):
    (five_bar / old).rename(five_bar / new)
    refused(next(five_bar.glob("*.urdf")), f"its loops would be lost: {says}")


@pytest.mark.parametrize("name", [KEPT, "robot.yaml"])
def test_a_link_to_nowhere(name, five_bar):
    (five_bar / KEPT).unlink()
    (five_bar / name).symlink_to("gone.json")
    refused(five_bar / "five_bar.urdf", f"{name} is a link to gone.json, which does not exist: restore that file")


@pytest.mark.parametrize(
    ("name", "wanted"), [("robot.yml", "robot.yaml"), ("Robot.yaml", "robot.yaml"), ("five_bar.yml", "five_bar.yaml")]
)
def test_a_robot_yaml_under_another_name(name, wanted, five_bar):
    (five_bar / KEPT).unlink()
    (five_bar / name).write_text("closed_loop: [[link5, link3]]\ntype: [6d]\n")
    refused(five_bar / "five_bar.urdf", f"{name} is not read under this name: rename it to {wanted}")


def test_a_copy_of_a_urdf_without_its_constraints(five_bar):
    """They name the URDF by its hash, though they belong to another one by their name."""
    shutil.copy(five_bar / "five_bar.urdf", five_bar / "r.urdf")
    message = "five_bar.constraints.json was written for the same links and joints: copy it to r.constraints.json"
    refused(five_bar / "r.urdf", message)
    (five_bar / "five_bar.constraints.json").rename(five_bar / "any.json")
    (five_bar / "five_bar.urdf").unlink()
    refused(five_bar / "r.urdf", message.replace("five_bar.constraints.json", "any.json"))


# --- constraints name their URDF ---------------------------------------------------------------------------------


def edited(folder, old, new):
    urdf = folder / "five_bar.urdf"
    text = urdf.read_text()
    assert old in text
    urdf.write_text(text.replace(old, new, 1))
    return urdf


def test_an_edited_urdf_is_warned_of_until_its_hash_is_there(five_bar):
    path = edited(five_bar, 'length="0.25"', 'length="0.26"')
    assert quiet(path) is not None  # of a shape
    child = '<child link="link1"/>\n    <origin xyz="-0.1'
    path = edited(five_bar, f"{child}5", f"{child}6")
    with pytest.warns(RaffWarning, match="are not those for which five_bar.constraints.json was written") as caught:
        assert len(readers.read(path)[1]["loops"]) == 1
    (entry,) = re.findall(r'"urdf_sha256": "(\w+)"', str(caught[0].message))
    sidecar = five_bar / "five_bar.constraints.json"
    sidecar.write_text(re.sub(r'(?<="urdf_sha256": ")\w+', entry, sidecar.read_text()))
    quiet(path)


@pytest.mark.parametrize(("old", "new"), [
    ('name="joint1" type="revolute"', 'name="joint1" type="continuous"'),
    ('lower="1.0471975511965976"', 'lower="1.1"'),
    ("\n", "\r\n"),
    ("<robot", "<!-- edited --><robot"),
    ('xyz="0.25 0.0 0.0" rpy="0.0 0.0 0.0"', 'rpy="0 -0.0 0" xyz=" 25e-2  0 0"'),
    ("<visual>", '<inertial><mass value="1"/></inertial><visual>'),
])  # fmt: skip
def test_changes_without_effect_on_the_loops_are_no_others(five_bar, old, new):
    quiet(edited(five_bar, old, new))


@pytest.mark.parametrize(("old", "new"), [
    ('<axis xyz="0.0 0.0 1.0"/>', '<axis xyz="0.0 0.0 -1.0"/>'),
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
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return readers.read(path)[1]


def test_constraints_of_another_robot(five_bar, root):
    """They share the names of most links and joints."""
    raff2urdf.convert(root / "robots" / "four_bar.raff", five_bar)
    raff2urdf.convert(root / "robots" / "planar_3r.raff", five_bar)
    (five_bar / "planar_3r.constraints.json").unlink()
    (five_bar / "four_bar.urdf").unlink()
    urdf = five_bar / "planar_3r.urdf"
    urdf.write_text(re.sub("  <!--.*-->\n", "", urdf.read_text()))
    assert quiet(urdf) is None


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"loops": 5}', '{"loops": [], "joints": [], "robot": "linkage"}', "[" * 9999]
)
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
