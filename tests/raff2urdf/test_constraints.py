"""What a URDF can't say stands in `<name>.constraints.json`, as the published schema describes it."""

import copy
import json
import math
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings
from mechanisms import KNOWN
from strategies import documents

from raff2urdf import RaffError, constraints, constraints_check, loads
from raff2urdf.loops.mobility import analyse
from raff2urdf.raff.document import Document, RaffRobot

SCHEMA = json.loads(files("raff2urdf").joinpath("constraints.schema.json").read_text(encoding="utf-8"))


def made(document: Document, robot: RaffRobot | None = None) -> constraints.Constraints:
    robot = robot or document.robot()
    return constraints.constraints(document, robot, analyse(document, robot))


ARM_WITH_SENSORS = """
RAFF MiniDelta
units cm
sensor 1 { port "/dev/ttyd2" translation 3 rotation 2 axes "x -z" }
sensor 7 { port "COM1" }
sensor 9 { port "unused" }
robot r1 {
  link 1 { parameters { theta 30 } type 2 pred 0 limits { -85 80 } velocity 90 actuated 1 }
  link 2 { parameters { d 21.1 theta -20 } type 2 pred 1 name "coupler" }
  link 3 { parameters { r 5 alpha 90 } type 1 pred 0 limits { 0 30 } velocity 3 }
  link 4 { type 0 pred 3 }
  frame 5 { parameters { d 30 } pred 2 }
  constraint { link 2 link 3 type 3 }
  constraint { link 2 sensor ( 0 7 1 ) }
  constraint { base sensor ( 7 ) }
}
"""


@pytest.fixture(scope="module")
def values() -> constraints.Constraints:
    return made(loads(ARM_WITH_SENSORS))


# --- what is written ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["serial arm of 7", "slider-crank, cut at the slide", "planar 3-RRR", "6-UPS"])
def test_what_is_written_of_known_mechanisms_is_what_the_schema_describes(name: str) -> None:
    jsonschema.validate(json.loads(constraints.dumps(made(loads(KNOWN[name][0])))), SCHEMA)


@given(documents(moderate=True, loops=False, least_robots=1))
@settings(max_examples=60)
def test_what_is_written_of_any_robot_is_what_the_schema_describes_and_reads_back(document: Document) -> None:
    for robot in document.robots:
        values = made(document, robot)
        text = constraints.dumps(values)
        jsonschema.validate(json.loads(text), SCHEMA)
        assert constraints.loads(text) == values


def test_everything_that_the_file_says_is_there(values: constraints.Constraints) -> None:
    assert (values["format"], values["version"]) == ("raff2urdf constraints", 2)
    assert (values["name"], values["robot"]) == ("MiniDelta", "r1")
    assert values["nodes"] == ["base", "link1", "coupler", "link3", "link4", "frame5"]
    assert values["floating"] == "joint0"
    assert values["joints"] == [
        {"name": "joint1", "type": "revolute", "home": math.radians(30), "actuated": True},
        {"name": "joint2", "type": "revolute", "home": math.radians(-20), "actuated": False},
        {"name": "joint3", "type": "prismatic", "home": 0.05, "actuated": False},
    ]
    unmoved = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    first, second = ({"node": node, "placement": unmoved} for node in ("coupler", "link3"))
    assert values["loops"] == [{"name": "coupler-link3", "kind": "ball", "first": first, "second": second}]
    assert (values["mobility"], values["loop_rows"], values["loop_rank"]) == (3 + 6 - 2, 3, 2)
    assert values["sensors"] == [
        {"number": 1, "port": "/dev/ttyd2", "translation": 3, "rotation": 2, "axes": "x -z"},
        {"number": 7, "port": "COM1", "translation": 3, "rotation": 3},
    ]
    assert values["sensor_constraints"] == [{"node": "coupler", "sensors": [0, 7, 1]}, {"node": "base", "sensors": [7]}]


# --- what is refused ---------------------------------------------------------------------------------------------


def changed(values: constraints.Constraints, path: str, value: Any) -> constraints.Constraints:
    """A copy with another value at "joints/0/home"; an ellipsis takes the key away."""
    copied = copy.deepcopy(values)
    *way, last = [int(step) if step.isdigit() else step for step in path.split("/")]
    at: Any = copied
    for step in way:
        at = at[step]
    if value is ...:
        del at[last]
    else:
        at[last] = value
    return copied


@pytest.mark.parametrize(("path", "value", "place"), [
    ("format", "something else", "$.format"),
    ("version", 3, "$.version"),
    ("mobility", 1.5, "$.mobility"),
    ("mobility", ..., "'mobility'"),
    ("nodes", ["base", "base"], "$.nodes"),
    ("joints/1/home", ..., "$.joints[1]: 'home'"),
    ("joints/0/torque", 5.0, "'torque'"),
    ("loops/0/first/placement", [[1, 0, 0, 0]], "$.loops[0].first.placement"),
    ("loops/0/second/node", "link99", "link99"),
    ("sensor_constraints/0/node", "link99", "link99"),
    ("drawing", "x", "'drawing'"),
    ("couplings", [{"name": "c", "terms": [{"joint": "wheel", "coefficients": [1.0]}], "constant": 0.0}],
     "$.couplings[0].terms[0].joint: coupling 'c' names 'wheel', which is not a joint that moves"),
])  # fmt: skip
def test_a_wrong_value_is_refused_at_its_place(values: constraints.Constraints, path: str, value: Any, place: str):
    assert constraints.loads(json.dumps(values)) == values
    with pytest.raises(RaffError, match=r"^delta4\.constraints\.json:1: .*" + re.escape(place)):
        constraints.loads(json.dumps(changed(values, path, value)), "delta4.constraints.json")


@pytest.mark.parametrize("text", ["", "{", "{\n]", "[]", "null", "5", "RAFF t", 100_000 * "["])
def test_what_is_no_such_file_is_refused_by_name_and_line(text: str) -> None:
    with pytest.raises(RaffError, match=rf"^some\.json:{len(text.splitlines()) or 1}: "):
        constraints.loads(text, "some.json")


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    for name in ("missing.json", "binary.json", "."):
        with pytest.raises(RaffError, match=re.escape(str(tmp_path / name))):
            constraints.load(tmp_path / name)


def test_a_wrong_name_is_told_by_its_line(values: constraints.Constraints) -> None:
    known = constraints_check.UrdfSummary(values["nodes"], {joint["name"]: joint["type"] for joint in values["joints"]})
    assert constraints.loads(constraints.dumps(values), "some.json", known) == values
    changes = [("loops/0/second/node", "nowhere"), ("nodes/1", "elsewhere"), ("joints/1/name", "wheel")]
    changes += [("loops/0/first/placement/0/0", -1.0), ("loops/0/first/placement/3/0", 1.0)]
    changes += [("loops/0/first/placement/0/3", 1e300)]
    for path, value in changes:
        wrong = constraints.dumps(changed(values, path, value))
        with pytest.raises(RaffError) as caught:
            constraints.loads(wrong, "some.json", known)
        within = wrong.splitlines()[int(str(caught.value).split(":")[1]) - 1]
        assert str(value) in within or "placement" in within


# --- what contradicts itself, or the URDF ------------------------------------------------------------------------


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e400", "9" * 400, "-" + "9" * 5000])
@pytest.mark.parametrize("path", ["joints/2/home", "mobility", "loop_rank", "loops/0/first/placement/0/3"])
def test_a_number_beyond_all_doubles_is_refused_at_its_place(values, number: str, path: str) -> None:
    text = constraints.dumps(changed(values, path, "HERE")).replace('"HERE"', number)
    where = "".join(f"[{step}]" if step.isdigit() else f".{step}" for step in path.split("/"))
    line = text[: text.index(number)].count("\n") + 1
    with pytest.raises(RaffError, match=rf"some\.json:{line}: at \${re.escape(where)}: this is not a finite number"):
        constraints.loads(text, "some.json")
