"""`cinegen.load` takes the text of a RAFF file, URDF, SDF or MJCF: the mechanism is that of the file."""

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

import cinegen
from cinegen.errors import LoadError
from raff2urdf import RaffError, RaffWarning, readers

RAFF = """RAFF bars
robot bars {
  link 1 { type 2 pred 0 parameters { theta 60 } }
  link 2 { type 2 pred 1 parameters { theta -60 d 300 } }
  link 3 { type 2 pred 0 parameters { theta 60 d 400 } }
  frame 4 { pred 2 parameters { d 400 } filename { "box.stl" } }
  frame 5 { pred 3 parameters { d 300 } }
  constraint { frame 4 frame 5 type 3 }
}
"""
URDF = """
 <robot name="arm"><link name="a"/><link name="b"><collision><geometry><mesh filename="box.stl"/></geometry>
  </collision></link><joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="2" velocity="3" effort="4"/></joint></robot>"""
SDF = """<?xml version="1.0"?><sdf version="1.9"><model name="arm"><link name="a"/><link name="b"/>
  <joint name="j" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint>
  </model></sdf>"""
MJCF = """<mujoco model="arm"><asset><mesh name="box" file="box.stl"/></asset><worldbody><body name="a">
  <joint name="j"/><geom type="mesh" mesh="box"/></body><include file="part.xml"/></worldbody></mujoco>"""

NOTED = URDF.replace("<link", "<!-- raff2urdf constraints: arm.constraints.json (1 loop) --><link", 1)
PART = """<mujoco><body name="p"><joint name="k"/><geom size="1"/></body></mujoco>"""
TEXTS = {".raff": RAFF, ".urdf": URDF, ".sdf": SDF, ".xml": MJCF}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with a mesh and a part of an MJCF."""
    work = tmp_path / "work"
    work.mkdir()
    trimesh.creation.box((0.1, 0.2, 0.3)).export(work / "box.stl")
    (work / "part.xml").write_text(PART)
    monkeypatch.chdir(work)
    return work


@pytest.mark.parametrize("ending", TEXTS)
def test_the_mechanism_is_that_of_the_file(folder, monkeypatch, ending):
    (folder / f"arm{ending}").write_text(TEXTS[ending])
    file, text = cinegen.load(folder / f"arm{ending}"), cinegen.load(TEXTS[ending])
    monkeypatch.chdir("/")
    assert (text.name, text.nodes, text.joints, text.mobility) == (file.name, file.nodes, file.joints, file.mobility)
    np.testing.assert_array_equal(text.q_home, file.q_home)
    for own, other in zip(text.model.inertias, file.model.inertias, strict=True):
        np.testing.assert_array_equal(own.toDynamicParameters(), other.toDynamicParameters())
    if ending != ".sdf":
        boxes = [[Path(one.meshPath).name for one in robot.collision.geometryObjects] for robot in (text, file)]
        assert boxes[0] == boxes[1]
        assert any("box" in name for name in boxes[0])


def test_a_path_is_a_path_and_a_name_a_name(folder):
    assert cinegen.load("delta4").mobility == 3
    (folder / "arm.urdf").write_text(URDF)
    assert cinegen.load("arm.urdf").joints == ("j",)
    for wrong in (Path(URDF), Path(RAFF), "RAFF t robot r { }"):
        with pytest.raises(RaffError, match=r"can't be read|there is no such file"):
            cinegen.load(wrong)


def test_a_file_that_a_text_names_is_missing(folder):
    arm = cinegen.load(URDF.replace("box", "bax"))
    missing = f"there is no file {folder}/bax.stl: a text names files from the folder that"
    with pytest.warns(cinegen.CinegenWarning, match=missing):
        _ = arm.collision
    with pytest.raises(LoadError, match=r"<text>:2: MuJoCo can't read it: .* 'parts.xml': did you mean '.*part.xml'"):
        cinegen.load(MJCF.replace("part", "parts"))
    (folder.parent.parent / "outside.xml").write_text(PART)
    with pytest.raises(LoadError, match=r"<text>:2: the file '\.\./\.\./outside.xml' leads out"):
        cinegen.load(MJCF.replace("part", "../../outside"))


@pytest.mark.parametrize(("text", "why"), [
    ("<robot", "<text>:1: invalid XML"),
    ("<html/>", "<text>:1: its first element is <html>: this is not a robot"),
    ("RAFF t\nrobot r { lunk }", "<text>:2:11: unknown word 'lunk' in robot r: did you mean 'link'"),
    ("name\nof a file", "<text>:1:1: a RAFF file begins with 'RAFF <name>', not with 'name'"),
])  # fmt: skip
def test_a_wrong_text_is_an_error_with_its_line_and_a_remedy(text, why):
    with pytest.raises((LoadError, RaffError), match=re.escape(why)):
        cinegen.load(text)


def test_loops_of_a_file_that_a_text_lacks_are_left_open_on_request():
    with pytest.warns(RaffWarning, match="<text>: left out, as requested"):
        assert cinegen.load(NOTED, ignore_loops=True).mobility == 1


def test_actuated_joints_of_a_text_are_given_as_the_advice_proposes(folder):
    passive = RAFF.replace("theta 60 } }", "theta 60 } actuated 1 }", 1).replace("constraint", "// constraint")
    arms = cinegen.load(passive)
    assert arms.uncontrolled == ("joint2", "joint3")
    assert "let joint2, joint3 be actuated too; load(..., actuated=[...]) declares that" in arms.source.notes[0]
    assert cinegen.load(passive, actuated=["joint1", "joint2", "joint3"]).uncontrolled == ()


def test_a_urdf_is_read_from_a_text_with_its_own_loops():
    found = readers.read(Path("arm of a program"), text=URDF)
    assert found.urdf == URDF
    with pytest.raises(RaffError, match="arm of a program:1: "):
        readers.read(Path("arm of a program"), text="<robot")
