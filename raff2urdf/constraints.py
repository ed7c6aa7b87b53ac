"""Everything a URDF can't say about a robot, as the values of `<name>.constraints.json`, and their reader."""

from __future__ import annotations

import json
import math
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from raff2urdf.analysis import Analysis
from raff2urdf.document import Document, JointType, LoopKind, Robot
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.tree import home
from raff2urdf.urdf import BASE_JOINT, limits, velocity

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


def loads(text: str, name: str = "<constraints>") -> Constraints:
    """Reads and checks what `dumps` writes.

    Raises:
        RaffError: no JSON, or not what the schema wants; says where.
    """
    import jsonschema

    try:
        values = json.loads(text, parse_constant=_no_constant, parse_float=_finite)
    except (ValueError, RecursionError) as error:
        raise RaffError(f"{name}: this is no JSON: {error}") from None
    worst = jsonschema.exceptions.best_match(_validator().iter_errors(values))
    if worst is not None:
        raise RaffError(f"{name}: at {worst.json_path}: {worst.message[:300]}")
    ends = [(f"loop '{loop['name']}'", loop[end]["node"]) for loop in values["loops"] for end in ("first", "second")]
    ends += [("a sensor constraint", entry["node"]) for entry in values.get("sensor_constraints", [])]
    for what, node in ends:
        if node not in values["nodes"]:
            raise RaffError(f"{name}: {what} names '{node}', which is no node{did_you_mean(node, values['nodes'])}")
    return dict(values)


def load(path: Path) -> Constraints:
    """Reads and checks a `<name>.constraints.json`.

    Raises:
        RaffError: unreadable, no JSON, or not what the schema wants.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RaffError(f"{path}: can't be read: {error}") from None
    return loads(text, str(path))


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
    raise ValueError(f"{word} is not a number")
