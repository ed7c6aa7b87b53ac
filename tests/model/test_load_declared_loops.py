"""Loops that are opened on purpose, in every format and command; numbers that a constraints file states."""

import io
import json
import sys

import pytest

import cinegen
import raff2urdf
from cinegen.cli import main

# Four bars in the plane, drawn stretched out.
PLUS = """<robot name="four_bar">
  <link name="base"/> <link name="link1"/> <link name="link2"/> <link name="link3"/>
  <joint name="joint1" type="continuous"><parent link="base"/><child link="link1"/><axis xyz="0 0 1"/></joint>
  <joint name="joint2" type="continuous" independent="false"><parent link="link1"/><child link="link2"/>
    <origin xyz="0.3 0 0"/><axis xyz="0 0 1"/></joint>
  <joint name="joint3" type="continuous" independent="false"><parent link="base"/><child link="link3"/>
    <origin xyz="0.9 0 0"/><axis xyz="0 0 1"/></joint>
  <loop name="loop1" type="revolute"><predecessor link="link2"><origin xyz="1 0 0"/></predecessor>
    <successor link="link3"><origin xyz="0.4 0 0"/></successor><axis xyz="0 0 1"/></loop>
</robot>
"""


# --- numbers that a constraints file states ----------------------------------------------------------------------


@pytest.mark.parametrize(("key", "right"), [("mobility", 2), ("loop_rank", 3), ("loop_rows", 6)])
def test_what_the_constraints_state_is_compared_with_what_is_computed(key, right, root, tmp_path):
    raff2urdf.convert(root / "robots" / "five_bar.raff", tmp_path)
    path, urdf = tmp_path / "five_bar.constraints.json", tmp_path / "five_bar.urdf"
    assert json.loads(path.read_text())[key] == right
    assert cinegen.load(urdf).mobility == 2
    path.write_text(path.read_text().replace(f'"{key}": {right}', f'"{key}": 5'))
    line = next(i for i, line in enumerate(path.read_text().splitlines(), 1) if key in line)
    says = rf"five_bar\.constraints\.json:{line}: at \$\.{key}: 5 is stated, but the URDF with these loops has {right}"
    with pytest.raises(cinegen.CinegenError, match=says):
        cinegen.load(urdf)
    assert cinegen.load(urdf, loops={"link5-tool": "ball"}).mobility == 3  # nothing is stated of this one


def test_constraints_without_the_loops_that_the_urdf_tells_of_are_refused(root, tmp_path):
    raff2urdf.convert(root / "robots" / "five_bar.raff", tmp_path)
    path = tmp_path / "five_bar.constraints.json"
    opened = {"loops": [], "mobility": 5, "loop_rows": 0, "loop_rank": 0}
    path.write_text(json.dumps({**json.loads(path.read_text()), **opened}))
    with pytest.raises(
        cinegen.CinegenError, match=r"according to this comment, the loops are in five_bar\.constraints"
    ):
        cinegen.load(tmp_path / "five_bar.urdf")


# --- all loops open, in every format -----------------------------------------------------------------------------


@pytest.mark.parametrize("format", ["raff", "urdf", "sdf", "mjcf"])
def test_loops_are_opened_in_every_format_all_or_by_name(format, root, tmp_path):
    path = root / "robots" / "five_bar.raff"
    if format != "raff":
        path = raff2urdf.convert(path, tmp_path, format=format)[0].file
    assert cinegen.load(path).mobility == 2
    with pytest.warns(
        UserWarning, match="left out, as requested; every joint moves independently: .*loop 'link5-tool"
    ) as seen:
        mechanism = cinegen.load(path, ignore_loops=True)
    assert len(seen) == 1
    assert (mechanism.mobility, len(mechanism.loops), len(mechanism.joints)) == (5, 0, 5)
    assert mechanism.actuated == mechanism.joints
    name = cinegen.load(path).loops[0].name
    with pytest.warns(UserWarning, match=f"left out, as requested: .*'{name}'"):
        mechanism = cinegen.load(path, ignore=[name])
    assert (len(mechanism.loops), mechanism.mobility) == (0, 5)


def test_a_robot_without_loops_is_loaded_without_a_word(root, recwarn):
    assert cinegen.load(root / "robots" / "arm7.raff", ignore_loops=True).mobility == 7
    assert not recwarn


# --- commands ----------------------------------------------------------------------------------------------------

SCENE = """robot = "four_bar.urdf"
node = "link2"
safety = 0.01
goal = { point = [1.5, 0, 0] }
"""

COMMANDS = {
    "info": ["info", "four_bar.urdf"],
    "map": ["map", "four_bar.urdf"],
    "drive": ["drive", "four_bar.urdf", "--snapshot", "page.html"],
    "drive --scene": ["drive", "--scene", "scene.toml", "--snapshot", "page.html"],
    "plan": ["plan", "scene.toml"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_refuses_and_opens_on_demand(command, tmp_path, monkeypatch, capsys):
    (tmp_path / "four_bar.urdf").write_text(PLUS.replace("<loop ", "<closure ").replace("</loop>", "</closure>"))
    (tmp_path / "scene.toml").write_text(SCENE)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO()))
    assert main(COMMANDS[command]) == 1
    refused = capsys.readouterr().err
    assert "four_bar.urdf:8: <closure> 'loop1' ('link2', 'link3') declares a loop" in refused
    for option in (["--ignore-loops"], ["--ignore", "closure"]):
        main([*COMMANDS[command], *option])
        opened = capsys.readouterr().err
        assert "four_bar.urdf: left out, as requested" in opened
        assert ": <closure> 'loop1' (line 8)" in opened
        assert "Traceback" not in opened
        assert "declares a loop" not in opened
