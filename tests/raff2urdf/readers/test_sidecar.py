"""A sidecar file that is not read, because of its name or a broken link, is not passed over in silence."""

from __future__ import annotations

import json
import re
import shutil
import warnings

import pytest

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


def refused(path, says):
    with pytest.raises(RaffError, match=says) as caught:
        readers.read(path)
    assert "--ignore-loops (in Python ignore_loops=True)" in str(caught.value)
    with pytest.warns(RaffWarning, match="left out, as requested"):
        assert readers.read(path, ignore_loops=True)[1] is None


def test_a_urdf_that_was_renamed(five_bar):
    (five_bar / "five_bar.urdf").rename(five_bar / "r.urdf")
    refused(
        five_bar / "r.urdf",
        r"r\.urdf: its loops would be lost: five_bar\.constraints\.json fits this URDF and no other one here: "
        r"rename it to r\.constraints\.json, or leave the loops open",
    )


@pytest.mark.parametrize(
    "name", ["loops.json", "five_bar.json", "five_bar.urdf.constraints.json", "five_bar_constraints.json"]
)
def test_constraints_that_were_renamed(name, five_bar):
    (five_bar / "five_bar.constraints.json").rename(five_bar / name)
    refused(five_bar / "five_bar.urdf", f"{name} fits this URDF and no other one here: rename it to five_bar")


def test_constraints_in_capitals(five_bar):
    (five_bar / "five_bar.constraints.json").rename(five_bar / "FIVE_BAR.CONSTRAINTS.json")
    refused(five_bar / "five_bar.urdf", "FIVE_BAR.CONSTRAINTS.json differs only in case: rename it to five_bar")


@pytest.mark.parametrize("name", ["five_bar.constraints.json", "robot.yaml"])
def test_a_link_to_nowhere(name, five_bar):
    (five_bar / "five_bar.constraints.json").unlink()
    (five_bar / name).symlink_to("gone.json")
    refused(five_bar / "five_bar.urdf", f"{name} is a link to gone.json, which does not exist: restore that file")


@pytest.mark.parametrize(
    ("name", "wanted"),
    [("robot.yml", "robot.yaml"), ("Robot.yaml", "robot.yaml"), ("five_bar.yml", "five_bar.yaml")],
)
def test_a_robot_yaml_under_another_name(name, wanted, five_bar):
    (five_bar / "five_bar.constraints.json").unlink()
    (five_bar / name).write_text("closed_loop: [[link5, link3]]\ntype: [6d]\n")
    refused(five_bar / "five_bar.urdf", f"{name} is not read under this name: rename it to {wanted}")


def test_a_urdf_to_which_a_tool_has_added_links_still_fits(five_bar):
    path = five_bar / "five_bar.urdf"
    added = (
        '<link name="camera"/><joint name="c" type="fixed"><parent link="base"/><child link="camera"/></joint></robot>'
    )
    path.rename(five_bar / "r.urdf").write_text(path.with_name("r.urdf").read_text().replace("</robot>", added))
    refused(five_bar / "r.urdf", "five_bar.constraints.json fits")


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
    assert quiet(five_bar / "planar_3r.urdf") is None


def test_constraints_that_belong_to_another_urdf(five_bar):
    shutil.copy(five_bar / "five_bar.urdf", five_bar / "r.urdf")
    assert quiet(five_bar / "r.urdf") is None


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
