"""Everything a URDF can't say about a robot, as the values of `<name>.constraints.json`, and their reader."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from raff2urdf.analysis import Analysis, declared_actuated, loop_kinds
from raff2urdf.document import Document, JointType, LoopKind, RaffRobot
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.json_lines import line_of, repeated_key
from raff2urdf.readers.urdf import LARGEST
from raff2urdf.readers.xml_file import read_text
from raff2urdf.tree import BASE_JOINT, home, limits, velocity

FORMAT, VERSION = "raff2urdf constraints", 1

Constraints = dict[str, Any]

Steps = list[str | int]
"""Keys and indices that lead to a value."""

IDENTITY = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]


def constraints(
    document: Document, robot: RaffRobot, analysis: Analysis | None, loops: Mapping[str, str] | None = None
) -> Constraints:
    """Return what the schema describes, for one robot of a document.

    Args:
        document: that holds the robot.
        robot: the robot.
        analysis: of its loops. Without it, what it determines is None: `mobility`, `loop_rows`, `loop_rank`, and
            `actuated` where the file leaves that open.
        loops: kinds (rigid, prismatic, revolute, ball) that replace the file's, by the loop's name; as in the analysis.

    Raises:
        RaffError: `loops` names a loop or a kind that does not exist.
    """
    kinds = loop_kinds(robot, loops)
    actuated = declared_actuated(robot)
    mobility = rows = rank = None
    if analysis is not None:
        mobility, rows, rank = analysis.mobility, analysis.rows, analysis.rank
        actuated = {joint: joint in analysis.actuated for joint in actuated}
    joints = []
    for link in (link for link in robot.links if link.type is not JointType.FIXED):
        low, high = limits(document, link)
        speed = velocity(document, link)
        joints.append(
            {
                "name": link.joint,
                "type": link.type.name.lower(),
                "home": home(document, link),
                "limits": None if math.isinf(low) else [low, high],
                "velocity": None if math.isinf(speed) else speed,
                "actuated": actuated[link.joint],
            }
        )
    closures = [
        {
            "name": name,
            "kind": kinds[i].name.lower(),
            "first": {"node": robot.nodes[loop.first].node, "placement": IDENTITY},
            "second": {"node": robot.nodes[loop.second].node, "placement": IDENTITY},
        }
        for i, (name, loop) in enumerate(zip(robot.loop_names, robot.loops, strict=True))
    ]
    used = {number for constraint in robot.sensor_constraints for number in constraint.sensors}
    return {
        "format": FORMAT,
        "version": VERSION,
        "name": document.name,
        "robot": robot.name,
        "nodes": [part.node for part in robot.nodes.values()],
        "floating": BASE_JOINT if robot.movable else None,
        "joints": joints,
        "loops": closures,
        "mobility": mobility,
        "loop_rows": rows,
        "loop_rank": rank,
        "sensors": [
            {"number": s.number, "port": s.port, "translation": s.translation, "rotation": s.rotation}
            for s in document.sensors
            if s.number in used
        ],
        "sensor_constraints": [
            {"node": robot.nodes[constraint.node].node, "sensors": list(constraint.sensors)}
            for constraint in robot.sensor_constraints
        ],
    }


def dumps(values: Constraints) -> str:
    """As JSON text; every number reads back to the same double."""
    return json.dumps(values, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def loads(
    text: str, name: str = "<constraints>", known: Known | None = None, types: Mapping[str, str] | None = None
) -> Constraints:
    """Reads and checks what `dumps` writes.

    Args:
        text: of the file.
        name: what errors call it.
        known: links and joints that it may name; any unless said.
        types: of the URDF's joints, revolute or prismatic, by name.

    Raises:
        RaffError: no JSON, or not what the schema wants; names what there is not; contradicts itself or the URDF. With
            the line.
    """
    import jsonschema

    try:
        values = json.loads(text, parse_int=_integer)
    except json.JSONDecodeError as error:
        raise RaffError(f"{name}:{error.lineno}: this is no JSON: {error.msg}") from None
    except (ValueError, RecursionError) as error:
        raise RaffError(f"{name}:1: this is no JSON: {error}") from None
    repeated = repeated_key(text)
    if repeated is not None:
        path, (first, second) = repeated
        raise RaffError(f"{name}:{second}: at {_shown(path)}: this key is on line {first} already: remove one of them")
    for path, why in _unreadable(values):
        raise RaffError(f"{name}:{line_of(text, path)}: at {_shown(path)}: {why}")
    worst = jsonschema.exceptions.best_match(_validator().iter_errors(values))
    if worst is not None:
        where = f"{name}:{line_of(text, worst.absolute_path)}"
        raise RaffError(f"{where}: at {worst.json_path}: {worst.message[:300]}")
    for what, path, names in _named(values, known):
        at: Any = values
        for step in path:
            at = at[step]
        if at not in names:
            near = did_you_mean(at, names)
            raise RaffError(f"{name}:{line_of(text, path)}: {what} '{at}'{near}")
    for path, why in _contradictions(values, types or {}):
        raise RaffError(f"{name}:{line_of(text, path)}: at {_shown(path)}: {why}")
    for i, loop in enumerate(values["loops"]):
        for end in ("first", "second"):
            wrong = _no_placement(loop[end]["placement"])
            if wrong:
                where = f"{name}:{line_of(text, ['loops', i, end, 'placement'])}"
                raise RaffError(f"{where}: loop '{loop['name']}': {wrong}")
    said = {joint["name"] for joint in values["joints"]}
    for joint in known[1] if known is not None else ():
        if joint not in said:
            raise RaffError(f"{name}:{line_of(text, ['joints'])}: joint '{joint}' of the URDF is left out")
    return dict(values)


def opened(values: Constraints) -> Constraints:
    """Return the constraints of the tree that is left with all loops open: every joint is actuated."""
    kept = {key: value for key, value in values.items() if key not in ("mobility", "loop_rows", "loop_rank")}
    if "joints" in values:
        kept["joints"] = [{key: joint[key] for key in joint if key != "actuated"} for joint in values["joints"]]
    return {**kept, "loops": []}


Known = tuple[Sequence[str], Sequence[str]]
"""Names of a URDF's links, and of its joints."""


def _named(values: Constraints, known: Known | None) -> Iterator[tuple[str, list[str | int], Sequence[str]]]:
    """Every name that must be known: what to say if it is not, the path to it, and those that are."""
    nodes: Sequence[str] = values["nodes"]
    for i, loop in enumerate(values["loops"]):
        for end in ("first", "second"):
            yield f"loop '{loop['name']}' ends at no node:", ["loops", i, end, "node"], nodes
    for i in range(len(values.get("sensor_constraints", []))):
        yield "a sensor constraint names no node:", ["sensor_constraints", i, "node"], nodes
    if known is not None:
        for i in range(len(nodes)):
            yield "the URDF has no link", ["nodes", i], known[0]
        for i in range(len(values["joints"])):
            yield "the URDF has no joint", ["joints", i, "name"], known[1]


def _unreadable(values: Any) -> Iterator[tuple[Steps, str]]:
    """Yield the path to each number that is not finite and each text that can't be encoded, and the error."""
    left: list[tuple[Steps, Any]] = [([], values)]
    while left:
        path, value = left.pop()
        if isinstance(value, dict | list):
            members = list(value.items() if isinstance(value, dict) else enumerate(value))
            left += [([*path, key], member) for key, member in reversed(members)]
        elif isinstance(value, float) and not math.isfinite(value):
            yield path, "this is not a finite number (none beyond 1.8e308)"
        elif isinstance(value, str) and any("\ud800" <= letter <= "\udfff" for letter in value):
            yield path, "this text holds half a character (a lone surrogate)"


def _contradictions(values: Constraints, types: Mapping[str, str]) -> Iterator[tuple[Steps, str]]:
    """Yield the path to each value that contradicts another, or the URDF, and the error."""
    for key, word in (("joints", "name"), ("loops", "name"), ("sensors", "number")):
        first: dict[str, int] = {}
        for i, entry in enumerate(values.get(key, [])):
            j = first.setdefault(entry[word], i)
            if j != i:
                yield [key, i, word], f"'{entry[word]}' is listed twice, in {_shown([key, j])} too: remove one of them"
    for i, joint in enumerate(values["joints"]):
        if not abs(joint["home"]) <= LARGEST:
            yield ["joints", i, "home"], f"joint '{joint['name']}': its home {joint['home']:g} is beyond {LARGEST:g}"
        low, high = joint.get("limits") or (0.0, 0.0)
        if low > high:
            said = f"its lower limit of {low:g} is above its upper one of {high:g}"
            yield ["joints", i, "limits"], f"joint '{joint['name']}': {said}"
        actual = types.get(joint["name"], joint.get("type"))
        if joint.get("type", actual) != actual:
            said = f"its type is {joint['type']} here and {actual} in the URDF: correct one of them"
            yield ["joints", i, "type"], f"joint '{joint['name']}': {said}"
    for i, loop in enumerate(values["loops"]):
        node = loop["first"]["node"]
        if node == loop["second"]["node"]:
            yield ["loops", i, "second", "node"], f"loop '{loop['name']}' joins '{node}' with itself"


def _shown(path: Steps) -> str:
    """Return a path as JSONPath writes it: $.joints[0].name."""
    return "$" + "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)


def _no_placement(rows: list[list[float]]) -> str:
    """Why a matrix places nothing; empty where it does."""
    matrix = np.array(rows, dtype=float)
    if matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        return "the last row of a placement is 0 0 0 1"
    if not np.abs(matrix).max() <= LARGEST:
        return f"its placement has a number beyond {LARGEST:g}"
    turn = matrix[:3, :3]
    straight = np.abs(turn).max() <= 2.0 and np.abs(turn @ turn.T - np.eye(3)).max() <= 1e-6
    return "" if straight and np.linalg.det(turn) > 0.0 else "its placement must begin with a rotation, (3, 3)"


def load(path: Path, known: Known | None = None, types: Mapping[str, str] | None = None) -> Constraints:
    """Reads and checks a `<name>.constraints.json`; see `loads`.

    Raises:
        RaffError: unreadable, no JSON, not what the schema wants, or names what there is not.
    """
    return loads(read_text(path), str(path), known, types)


def loop_kind(entry: Constraints) -> LoopKind:
    """The kind of one entry of `loops`."""
    return LoopKind[entry["kind"].upper()]


@cache
def _validator() -> Any:
    import jsonschema

    schema = files("raff2urdf").joinpath("constraints.schema.json").read_text(encoding="utf-8")
    return jsonschema.Draft202012Validator(json.loads(schema))


def _integer(word: str) -> int | float:
    """Return an integer, or an infinity where it is beyond all doubles."""
    value = float(word)
    return int(word) if math.isfinite(value) else value
