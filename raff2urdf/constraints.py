"""Everything a URDF can't say about a robot, as the values of `<name>.constraints.json`, and their reader."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from raff2urdf.analysis import Analysis
from raff2urdf.document import Document, JointType, LoopKind, Robot
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.json_lines import line_of
from raff2urdf.readers.urdf import LARGEST
from raff2urdf.readers.xml_file import read_text
from raff2urdf.tree import BASE_JOINT, home, limits, velocity

FORMAT, VERSION = "raff2urdf constraints", 1

Constraints = dict[str, Any]

IDENTITY = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]


def constraints(document: Document, robot: Robot, analysis: Analysis) -> Constraints:
    """What the schema describes, for one robot of a document."""
    joints = []
    for link in robot.links:
        if link.type is not JointType.FIXED:
            low, high = limits(document, link)
            speed = velocity(document, link)
            joints.append(
                {
                    "name": link.joint,
                    "type": link.type.name.lower(),
                    "home": home(document, link),
                    "limits": None if math.isinf(low) else [low, high],
                    "velocity": None if math.isinf(speed) else speed,
                    "actuated": link.joint in analysis.actuated,
                }
            )
    loops = [
        {
            "name": name,
            "kind": kind.name.lower(),
            "first": {"node": robot.nodes[loop.first].node, "placement": IDENTITY},
            "second": {"node": robot.nodes[loop.second].node, "placement": IDENTITY},
        }
        for name, loop, kind in zip(robot.loop_names, robot.loops, analysis.kinds, strict=True)
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
        "loops": loops,
        "mobility": analysis.mobility,
        "loop_rows": analysis.rows,
        "loop_rank": analysis.rank,
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


def loads(text: str, name: str = "<constraints>", known: Known | None = None) -> Constraints:
    """Reads and checks what `dumps` writes.

    Args:
        text: of the file.
        name: what errors call it.
        known: links and joints that it may name; any unless said.

    Raises:
        RaffError: no JSON, or not what the schema wants; names what there is not. With the line.
    """
    import jsonschema

    try:
        values = json.loads(text, parse_constant=_no_constant, parse_float=_finite)
    except json.JSONDecodeError as error:
        raise RaffError(f"{name}:{error.lineno}: this is no JSON: {error.msg}") from None
    except _NoNumberError as error:
        line = text.count("\n", 0, text.find(str(error))) + 1
        raise RaffError(f"{name}:{line}: this is no JSON: {error} is not a number") from None
    except (ValueError, RecursionError) as error:
        raise RaffError(f"{name}:1: this is no JSON: {error}") from None
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


def load(path: Path, known: Known | None = None) -> Constraints:
    """Reads and checks a `<name>.constraints.json`; see `loads`.

    Raises:
        RaffError: unreadable, no JSON, not what the schema wants, or names what there is not.
    """
    return loads(read_text(path), str(path), known)


def loop_kind(entry: Constraints) -> LoopKind:
    """The kind of one entry of `loops`."""
    return LoopKind[entry["kind"].upper()]


@cache
def _validator() -> Any:
    import jsonschema

    schema = files("raff2urdf").joinpath("constraints.schema.json").read_text(encoding="utf-8")
    return jsonschema.Draft202012Validator(json.loads(schema))


def _finite(word: str) -> float:
    value = float(word)
    return value if math.isfinite(value) else _no_constant(word)


def _no_constant(word: str) -> float:
    raise _NoNumberError(word)


class _NoNumberError(ValueError):
    """A word that JSON does not know, or a number beyond all doubles."""
