"""The constraints file of a URDF, `<name>.constraints.json`: everything about a robot for which URDF has no element.

What a URDF has elements for, such as limits, is in the URDF alone."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from raff2urdf.arrays import ArrayLike
from raff2urdf.constraints_check import UrdfSummary, contradictions, problems, shown
from raff2urdf.coupling import coupling_entry
from raff2urdf.errors import RaffError
from raff2urdf.loops.mobility import Analysis, declared_actuated, loop_kinds
from raff2urdf.raff.compound import expanded, spherical_joints
from raff2urdf.raff.document import Document, JointType, RaffRobot
from raff2urdf.readers.json_lines import line_of, repeated_key
from raff2urdf.readers.xml_file import read_text
from raff2urdf.tree import BASE_JOINT, coupling_of, home, joint_dynamics

FORMAT, VERSION = "raff2urdf constraints", 2

HASH = "urdf_sha256"
"""Key of the hash of the URDF's links and joints, see `raff2urdf.readers.urdf.hash_of`."""

MARK = "generated"
"""Key of the mark of a file that may be made again, see `raff2urdf.files.GENERATED`."""

Constraints = dict[str, Any]

IDENTITY = np.eye(4)


def constraints(
    document: Document, robot: RaffRobot, analysis: Analysis | None, loops: Mapping[str, str] | None = None
) -> Constraints:
    """Return the contents of the file for one robot of a document.

    Args:
        document: that holds the robot.
        robot: the robot.
        analysis: of its loops. Without it, what it determines is None: `mobility`, `loop_rows`, `loop_rank`, and
            `actuated` where the file leaves that open.
        loops: kinds (rigid, prismatic, revolute, ball) that replace the file's, by the loop's name; as in the analysis.

    Raises:
        RaffError: `loops` names a loop or a kind that does not exist.
    """
    links, kinds = expanded(robot).links, loop_kinds(robot, loops)
    balls = [{"name": name, "joints": joints} for name, joints in spherical_joints(robot).items()]
    actuated = declared_actuated(robot)
    mobility = rows = rank = None
    moved: Mapping[int, tuple[ArrayLike, ArrayLike]] = {}
    if analysis is not None:
        kinds, moved = dict(enumerate(analysis.kinds)), analysis.moved
        mobility, rows, rank = analysis.mobility, analysis.rows, analysis.rank
        actuated = {joint: joint in analysis.actuated for joint in actuated}
    joints = [
        {
            "name": link.joint,
            "type": link.type.name.lower(),
            "home": home(document, link),
            **({"armature": armature} if (armature := joint_dynamics(document, link).armature) else {}),
            "actuated": actuated[link.joint],
        }
        for link in links
        if link.type is not JointType.FIXED
    ]
    closures = [
        loop_entry(name, kinds[i].name.lower(), *ends, moved.get(i, (IDENTITY, IDENTITY)))
        for i, (name, ends) in enumerate(zip(robot.loop_names, _ends(robot), strict=True))
    ]
    equations = [coupling_of(document, robot, i) for i in range(len(robot.couplings))]
    couplings = [coupling_entry(coupling.name, coupling.terms, coupling.constant) for coupling in equations]
    used = {number for constraint in robot.sensor_constraints for number in constraint.sensors}
    return {
        "format": FORMAT,
        "version": VERSION,
        "name": document.name,
        "robot": robot.name,
        "nodes": [node.node for node in robot.nodes.values()],
        "floating": BASE_JOINT if robot.movable else None,
        **({} if document.gravity is None else {"gravity": list(document.gravity)}),
        "joints": joints,
        **({"balls": balls} if balls else {}),
        "loops": closures,
        **({"couplings": couplings} if couplings else {}),
        "mobility": mobility,
        "loop_rows": rows,
        "loop_rank": rank,
        "sensors": [
            {"number": s.number, "port": s.port, "translation": s.translation, "rotation": s.rotation}
            | ({} if s.axes is None else {"axes": s.axes})
            for s in document.sensors
            if s.number in used
        ],
        "sensor_constraints": [
            {"node": robot.nodes[constraint.node].node, "sensors": list(constraint.sensors)}
            for constraint in robot.sensor_constraints
        ],
    }


def _ends(robot: RaffRobot) -> list[tuple[str, str]]:
    """Return the names of the nodes that each loop joins."""
    return [(robot.nodes[loop.first].node, robot.nodes[loop.second].node) for loop in robot.loops]


def for_urdf(values: Constraints, urdf_sha256: str) -> Constraints:
    """Return constraints that name their URDF by its hash, behind the robot's name."""
    complete: Constraints = {}
    for key, value in values.items():
        complete[key] = value
        if key == "robot":
            complete[HASH] = urdf_sha256
    return complete


def loop_entry(
    name: str, kind: str, first: str, second: str, placements: Sequence[ArrayLike] = (IDENTITY, IDENTITY)
) -> dict[str, Any]:
    """Return an entry of a loop between two nodes, whose ends have these placements (4, 4) on them."""

    def end(node: str, placement: ArrayLike) -> dict[str, Any]:
        return {"node": node, "placement": np.asarray(placement).tolist()}

    return {"name": name, "kind": kind, "first": end(first, placements[0]), "second": end(second, placements[1])}


def dumps(values: Constraints) -> str:
    """Return the values as JSON text; every number reads back to the same double."""
    return json.dumps(values, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def loads(text: str, name: str = "<constraints>", urdf: UrdfSummary | None = None) -> Constraints:
    """Read and check the text of a constraints file.

    Args:
        text: of the file.
        name: of the file, in errors.
        urdf: with which the file must agree; any names are accepted if None.

    Returns:
        the contents, without the mark.

    Raises:
        RaffError: invalid JSON, or values that do not match the schema, name something unknown, or contradict each
            other or the URDF. With the line.
    """
    try:
        values = json.loads(text, parse_int=_integer)
    except json.JSONDecodeError as error:
        raise RaffError(f"{name}:{error.lineno}: invalid JSON: {error.msg}") from None
    except (ValueError, RecursionError) as error:
        raise RaffError(f"{name}:1: invalid JSON: {error}") from None
    repeated = repeated_key(text)
    if repeated is not None:
        path, (first, second) = repeated
        raise RaffError(f"{name}:{second}: at {shown(path)}: this key is on line {first} already: remove one of them")
    for at, why in problems(values, urdf):
        raise RaffError(f"{name}:{line_of(text, at)}: at {shown(at)}: {why}")
    return {key: value for key, value in values.items() if key != MARK}


def check_values(values: Constraints, name: str) -> None:
    """Check that constraints, of any format, do not contradict themselves, and that their numbers are not too large.

    Args:
        values: the constraints.
        name: of the file, in errors.

    Raises:
        RaffError: they do.
    """
    for at, why in contradictions(values):
        raise RaffError(f"{name}: at {shown(at)}: {why}")


def load(path: Path, urdf: UrdfSummary | None = None) -> Constraints:
    """Read and check a constraints file; see `loads`.

    Raises:
        RaffError: as `loads`, or the file can't be read.
    """
    return loads(read_text(path), str(path), urdf)


def without_loops(values: Constraints) -> Constraints:
    """Return the constraints of the tree that remains without loops and couplings: every joint is actuated."""
    dropped = ("balls", "couplings", "mobility", "loop_rows", "loop_rank")
    kept = {key: value for key, value in values.items() if key not in dropped}
    if "joints" in values:
        kept["joints"] = [{key: joint[key] for key in joint if key != "actuated"} for joint in values["joints"]]
    return {**kept, "loops": []}


def _integer(word: str) -> int | float:
    """Return an integer; infinity if it is beyond all doubles."""
    value = float(word)
    return int(word) if math.isfinite(value) else value
