"""Loops that are opened on purpose, in every format and command; numbers that a constraints file states."""

from __future__ import annotations

import io
import json
import shutil
import sys
from pathlib import Path

import pytest

import cinegen
import raff2urdf
from cinegen.cli import main

URDF_PLUS = Path(__file__).parent / "data" / "urdf_plus"

# Bennett's linkage with one length wrong: no rigid closure is possible.
BENT = """
robot bent {
  base { }
  link 1 { parameters { theta 40 } type 2 pred 0 }
  link 2 { parameters { theta 60 d 200 alpha 30 } type 2 pred 1 }
  link 3 { parameters { theta 70 d 301 alpha 50 } type 2 pred 2 }
  link 4 { parameters { theta 50 d 200 alpha 30 } type 2 pred 3 actuated 0 }
  frame 5 { parameters { d 303 alpha 58 } pred 4 name "end" }
  constraint { base frame 5 }
}
"""


@pytest.mark.parametrize(("name", "mobility"), [("four_bar", 3), ("six_bar", 5), ("mini_cheetah", 30)])
def test_robots_in_urdf_plus_are_opened(name, mobility):
    with pytest.warns(
        raff2urdf.RaffWarning, match=f"{name}.urdf: left out, as requested; every joint moves independently: <"
    ):
        mechanism = cinegen.load(URDF_PLUS / f"{name}.urdf", ignore_loops=True)
    assert (mechanism.mobility, mechanism.loops, mechanism.couplings) == (mobility, (), ())
    assert mechanism.actuated == mechanism.joints


def test_a_robot_in_urdf_plus_loads_with_a_sidecar_file(tmp_path):
    shutil.copy(URDF_PLUS / "four_bar.urdf", tmp_path)
    placed = [[[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] for x in (1.0, 0.5)]
    with pytest.warns(raff2urdf.RaffWarning, match="left out"):
        names = cinegen.load(tmp_path / "four_bar.urdf", ignore_loops=True)
    (tmp_path / "four_bar.constraints.json").write_text(
        json.dumps(
            {
                "format": "raff2urdf constraints",
                "version": 1,
                "robot": "four_bar",
                "nodes": names.nodes,
                "joints": [{"name": joint, "home": 0.5} for joint in names.joints],
                "loops": [
                    {
                        "name": "loop1",
                        "kind": "revolute",
                        "first": {"node": "link2", "placement": placed[0]},
                        "second": {"node": "link3", "placement": placed[1]},
                    }
                ],
                "mobility": 1,
            }
        )
    )
    with pytest.warns(raff2urdf.RaffWarning, match="does not name its URDF, so that a change of either is not"):
        assert cinegen.load(tmp_path / "four_bar.urdf").mobility == 1


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


def test_a_second_list_of_loops_does_not_open_the_robot(root, tmp_path):
    raff2urdf.convert(root / "robots" / "five_bar.raff", tmp_path)
    path = tmp_path / "five_bar.constraints.json"
    path.write_text(path.read_text().replace('"mobility"', '"loops": [],\n "mobility"'))
    with pytest.raises(cinegen.CinegenError, match=r"at \$\.loops: this key is on line \d+ already"):
        cinegen.load(tmp_path / "five_bar.urdf")


def test_constraints_without_the_loops_that_the_urdf_tells_of_are_refused(root, tmp_path):
    raff2urdf.convert(root / "robots" / "five_bar.raff", tmp_path)
    path = tmp_path / "five_bar.constraints.json"
    opened = {"loops": [], "mobility": 5, "loop_rows": 0, "loop_rank": 0}
    path.write_text(json.dumps({**json.loads(path.read_text()), **opened}))
    with pytest.raises(
        cinegen.CinegenError, match=r"according to this comment, the loops are in five_bar\.constraints"
    ):
        cinegen.load(tmp_path / "five_bar.urdf")


def test_a_joint_type_that_is_not_the_urdfs_is_refused(root, tmp_path):
    raff2urdf.convert(root / "robots" / "five_bar.raff", tmp_path)
    path = tmp_path / "five_bar.constraints.json"
    path.write_text(path.read_text().replace('"revolute"', '"prismatic"', 1))
    with pytest.raises(
        cinegen.CinegenError, match=r"at \$\.joints\[0\]\.type: .* prismatic here and revolute in the URDF"
    ):
        cinegen.load(tmp_path / "five_bar.urdf")


# --- all loops open, in every format -----------------------------------------------------------------------------


@pytest.mark.parametrize("format", ["raff", "urdf", "sdf", "mjcf"])
def test_loops_are_opened_in_every_format(format, root, tmp_path):
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


def test_a_robot_that_cannot_be_closed_is_opened(raff):
    with pytest.raises(cinegen.ClosureError):
        raff(BENT)
    with pytest.warns(cinegen.CinegenWarning, match="left out, as requested"):
        mechanism = raff(BENT, ignore_loops=True)
    assert mechanism.mobility == len(mechanism.actuated) == 4


def test_a_robot_without_loops_is_loaded_without_a_word(root, recwarn):
    assert cinegen.load(root / "robots" / "arm7.raff", ignore_loops=True).mobility == 7
    assert not recwarn


def test_loops_are_either_closed_otherwise_or_opened(root):
    with pytest.raises(cinegen.CinegenError, match="a kind is given for loop 'link5-tool', but all are to be ignored"):
        cinegen.load(root / "robots" / "five_bar.raff", loops={"link5-tool": "ball"}, ignore_loops=True)


# --- commands ----------------------------------------------------------------------------------------------------

SCENE = """robot = "four_bar.urdf"
node = "link2"
safety = 0.01
goal = { point = [1.5, 0, 0] }
"""

COMMANDS = {
    "info": ["info", "four_bar.urdf"],
    "modes": ["modes", "four_bar.urdf"],
    "singular": ["singular", "four_bar.urdf"],
    "map": ["map", "four_bar.urdf"],
    "drive": ["drive", "four_bar.urdf", "--snapshot", "page.html"],
    "drive --scene": ["drive", "--scene", "scene.toml", "--snapshot", "page.html"],
    "plan": ["plan", "scene.toml"],
    "close": ["close", "four_bar.urdf"],
    "sensors": ["sensors", "four_bar.urdf"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_refuses_and_opens_on_demand(command, tmp_path, monkeypatch, capsys):
    text = (URDF_PLUS / "four_bar.urdf").read_text().replace("<loop ", "<closure ").replace("</loop>", "</closure>")
    (tmp_path / "four_bar.urdf").write_text(text)
    (tmp_path / "scene.toml").write_text(SCENE)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO()))
    assert main(COMMANDS[command]) == 1
    refused = capsys.readouterr().err
    assert "four_bar.urdf:82: <closure> 'loop1' ('link2', 'link3') declares a loop" in refused
    for option in (["--ignore-loops"], ["--ignore", "closure"]):
        main([*COMMANDS[command], *option])
        opened = capsys.readouterr().err
        assert "four_bar.urdf: left out, as requested" in opened
        assert ": <closure> 'loop1' (line 82)" in opened
        assert "Traceback" not in opened
        assert "declares a loop" not in opened
