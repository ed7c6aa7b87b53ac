"""The constraints file of a URDF, `<name>.constraints.json`: everything about a robot for which URDF has no element.

What a URDF has elements for, such as limits, is in the URDF alone."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from raff2urdf.analysis import Analysis, declared_actuated, loop_kinds
from raff2urdf.arrays import ArrayLike
from raff2urdf.axes import UNCHANGED, parse_axes
from raff2urdf.coupling import coupling_entry
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.json_lines import line_of, repeated_key
from raff2urdf.raff.compound import expanded, spherical_joints
from raff2urdf.raff.document import Document, JointType, RaffRobot
from raff2urdf.readers.urdf import LARGEST, MovingJoint
from raff2urdf.readers.xml_file import read_text
from raff2urdf.tree import BASE_JOINT, coupling_of, home, joint_dynamics

FORMAT, VERSION = "raff2urdf constraints", 2

HASH = "urdf_sha256"
"""Key of the hash of the URDF's links and joints, see `raff2urdf.readers.urdf.hash_of`."""

MARK = "generated"
"""Key of the mark of a file that may be made again, see `raff2urdf.files.GENERATED`."""

Constraints = dict[str, Any]

IDENTITY = np.eye(4)


class UrdfSummary(NamedTuple):
    """Links and joints of a URDF, with which its constraints file must agree.

    Attributes:
        links: names of the URDF's links.
        joints: its joints that move, by name.
    """

    links: Sequence[str]
    joints: Mapping[str, MovingJoint]


_Problems = Iterator[tuple[Sequence[str | int], str]]
"""Paths to wrong values, and the errors."""


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
    joints = []
    for link in (link for link in links if link.type is not JointType.FIXED):
        joints.append(
            {
                "name": link.joint,
                "type": link.type.name.lower(),
                "home": home(document, link),
                **({"armature": armature} if (armature := joint_dynamics(document, link).armature) else {}),
                "actuated": actuated[link.joint],
            }
        )
    closures = [
        loop_entry(
            name,
            kinds[i].name.lower(),
            robot.nodes[loop.first].node,
            robot.nodes[loop.second].node,
            moved.get(i, (IDENTITY, IDENTITY)),
        )
        for i, (name, loop) in enumerate(zip(robot.loop_names, robot.loops, strict=True))
    ]
    equations = [coupling_of(document, robot, i) for i in range(len(robot.couplings))]
    couplings = [coupling_entry(one.name, one.terms, one.constant) for one in equations]
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


def for_urdf(values: Constraints, urdf_sha256: str) -> Constraints:
    """Return constraints that name their URDF by its hash, behind the robot's name."""
    found: Constraints = {}
    for key, value in values.items():
        found[key] = value
        if key == "robot":
            found[HASH] = urdf_sha256
    return found


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
        the contents, without the mark, and without limits, which files of version 1 repeat from the URDF.

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
        raise RaffError(f"{name}:{second}: at {_shown(path)}: this key is on line {first} already: remove one of them")
    for at, why in chain(
        _unreadable(values),
        _mismatches(values),
        _unknown_names(values, urdf),
        _contradictions(values),
        _other_joints(values, {} if urdf is None else urdf.joints),
        _wrong_placements(values),
    ):
        raise RaffError(f"{name}:{line_of(text, at)}: at {_shown(at)}: {why}")
    values["joints"] = [
        {key: value for key, value in joint.items() if key not in _IN_URDF} for joint in values["joints"]
    ]
    return {key: value for key, value in values.items() if key != MARK}


_IN_URDF = ("limits", "velocity")
"""Keys of joints in version 1, for which URDF has elements."""


def check_values(values: Constraints, name: str) -> None:
    """Check that constraints, of any format, do not contradict themselves, and that their numbers are not too large.

    Args:
        values: the constraints.
        name: of the file, in errors.

    Raises:
        RaffError: they do.
    """
    for at, why in chain(_contradictions(values), _wrong_placements(values)):
        raise RaffError(f"{name}: at {_shown(at)}: {why}")


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


def _shown(path: Sequence[str | int]) -> str:
    """Return a path in JSONPath notation: $.joints[0].name."""
    return "$" + "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)


def _unreadable(values: Any) -> _Problems:
    """Yield numbers that are not finite and texts that can't be encoded."""
    pending: list[tuple[list[str | int], Any]] = [([], values)]
    while pending:
        path, value = pending.pop()
        if isinstance(value, dict | list):
            members = list(value.items() if isinstance(value, dict) else enumerate(value))
            pending += [([*path, key], member) for key, member in reversed(members)]
        elif isinstance(value, float) and not math.isfinite(value):
            yield path, "this is not a finite number: the largest is 1.8e308"
        elif isinstance(value, str) and any("\ud800" <= letter <= "\udfff" for letter in value):
            yield path, "this text holds half a character (a lone surrogate): remove it"
        elif isinstance(value, str) and not value.isprintable() and path[:1] not in (["name"], ["sensors"]):
            yield path, "this text holds a character that can't be printed, such as a line break: remove it"


@cache
def _validator() -> Any:
    import jsonschema

    schema = files("raff2urdf").joinpath("constraints.schema.json").read_text(encoding="utf-8")
    return jsonschema.Draft202012Validator(json.loads(schema))


def _mismatches(values: Any) -> _Problems:
    """Yield the worst mismatch with the schema."""
    import jsonschema

    worst = jsonschema.exceptions.best_match(_validator().iter_errors(values))
    if worst is not None:
        yield list(worst.absolute_path), worst.message[:300]


def _unknown_names(values: Constraints, urdf: UrdfSummary | None) -> _Problems:
    nodes: Sequence[str] = values["nodes"]
    moving = [joint["name"] for joint in values["joints"]]
    for path, who, name in _named(values):
        known, what = (nodes, "node") if path[-1] == "node" else (moving, "joint that moves")
        if name not in known:
            yield path, f"{who} '{name}', which is not a {what}{did_you_mean(name, known)}"
    if urdf is None:
        return
    links, joints = urdf
    for i, node in enumerate(nodes):
        if node not in links:
            yield ["nodes", i], f"the URDF has no link '{node}'{did_you_mean(node, links)}"
    for i, name in enumerate(moving):
        if name not in joints:
            yield ["joints", i, "name"], f"the URDF has no joint '{name}'{did_you_mean(name, list(joints))}"
    for name in joints:
        if name not in moving:
            yield ["joints"], f"joint '{name}' of the URDF is missing: add an entry for it"


def _named(values: Constraints) -> Iterator[tuple[list[str | int], str, str]]:
    """Yield where nodes and joints are named, by what, and their names."""
    for i, loop in enumerate(values["loops"]):
        for end in ("first", "second"):
            yield ["loops", i, end, "node"], f"loop '{loop['name']}' ends at", loop[end]["node"]
    for i, ball in enumerate(values.get("balls", [])):
        for j, name in enumerate(ball["joints"]):
            yield ["balls", i, "joints", j], f"ball joint '{ball['name']}' names", name
    for i, coupling in enumerate(values.get("couplings", [])):
        for j, term in enumerate(coupling["terms"]):
            yield ["couplings", i, "terms", j, "joint"], f"coupling '{coupling['name']}' names", term["joint"]
    for i, entry in enumerate(values.get("sensor_constraints", [])):
        yield ["sensor_constraints", i, "node"], "a sensor constraint names", entry["node"]


def _other_joints(values: Constraints, joints: Mapping[str, MovingJoint]) -> _Problems:
    """Yield types and limits of joints that are not those of the URDF."""
    for i, entry in enumerate(values["joints"]):
        own = joints.get(entry["name"])
        if own is None:
            continue
        if entry.get("type", own.type) != own.type:
            why = f"its type is {entry['type']} here and {own.type} in the URDF: correct one of them"
            yield ["joints", i, "type"], f"joint '{entry['name']}': {why}"
        for key, there in (("limits", own.limits), ("velocity", own.velocity)):
            pair = [[] if value is None else np.atleast_1d(value).tolist() for value in (entry.get(key, there), there)]
            if len(pair[0]) != len(pair[1]) or not np.allclose(pair[0], pair[1], 1e-12, 0.0):
                shown = [", ".join(map(str, value)) or "none" for value in pair]
                what = f"{key.removesuffix('s')} {shown[0]} of joint '{entry['name']}' is {shown[1]} in the URDF"
                yield ["joints", i, key], f"{what}, where limits belong: remove this key"


def _contradictions(values: Constraints) -> _Problems:
    """Yield values that contradict another one."""
    for key in ("joints", "balls", "loops", "couplings", "sensors"):
        word = "number" if key == "sensors" else "name"
        first: dict[str, int] = {}
        for i, entry in enumerate(values.get(key, [])):
            j = first.setdefault(entry[word], i)
            if j != i:
                yield [key, i, word], f"'{entry[word]}' is listed twice, also in {_shown([key, j])}: remove one of them"
    for i, sensor in enumerate(values.get("sensors", [])):
        try:
            parse_axes(sensor.get("axes", UNCHANGED))
        except RaffError as error:
            yield ["sensors", i, "axes"], str(error)
    listed = {0, *(sensor["number"] for sensor in values.get("sensors", []))}
    for i, entry in enumerate(values.get("sensor_constraints", [])):
        for j, number in enumerate(entry["sensors"]):
            if number not in listed:
                yield ["sensor_constraints", i, "sensors", j], f"sensor {number} is not listed in sensors: add it there"
    for i, joint in enumerate(values["joints"]):
        name = f"joint '{joint['name']}'"
        if not abs(joint.get("home", 0.0)) <= LARGEST:
            yield (
                ["joints", i, "home"],
                f"the home of {name} is {joint['home']:g}, beyond {LARGEST:g}: check its unit (rad, m)",
            )
    names = {loop["name"]: i for i, loop in enumerate(values["loops"])}
    for i, coupling in enumerate(values.get("couplings", [])):
        if coupling["name"] in names:
            there = _shown(["loops", names[coupling["name"]]])
            yield ["couplings", i, "name"], f"'{coupling['name']}' is also the name of {there}: rename one of them"
        if not abs(coupling["constant"]) <= LARGEST:
            why = f"coupling '{coupling['name']}': its constant is beyond {LARGEST:g}: check its unit (rad, m)"
            yield ["couplings", i, "constant"], why
        met: dict[str, int] = {}
        for j, term in enumerate(coupling["terms"]):
            if met.setdefault(term["joint"], j) != j:
                why = f"coupling '{coupling['name']}' lists '{term['joint']}' twice: join the two terms"
                yield ["couplings", i, "terms", j, "joint"], why
            if not 1.0 / LARGEST <= max(map(abs, term["coefficients"])) <= LARGEST:
                size = f"below {1.0 / LARGEST:g} or beyond {LARGEST:g}"
                why = f"coupling '{coupling['name']}': the coefficients of '{term['joint']}' are {size}"
                yield ["couplings", i, "terms", j, "coefficients"], why
    for i, loop in enumerate(values["loops"]):
        node = loop["first"]["node"]
        if node == loop["second"]["node"]:
            yield (
                ["loops", i, "second", "node"],
                f"loop '{loop['name']}' joins '{node}' to itself: name two different nodes",
            )


def _wrong_placements(values: Constraints) -> _Problems:
    for i, loop in enumerate(values["loops"]):
        for end in ("first", "second"):
            matrix = np.array(loop[end]["placement"], dtype=float)
            rotation = matrix[:3, :3]
            why = ""
            if matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
                why = "the last row of its placement must be 0 0 0 1"
            elif not np.abs(matrix).max() <= LARGEST:
                why = f"a number of its placement is beyond {LARGEST:g}: check its unit (m)"
            elif (
                np.abs(rotation).max() > 2.0
                or np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6
                or np.linalg.det(rotation) <= 0.0
            ):
                why = "the first three rows and columns of its placement must be a rotation"
            if why:
                yield ["loops", i, end, "placement"], f"loop '{loop['name']}': {why}"
