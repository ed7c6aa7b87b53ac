"""A mission as lines of JSON: what the first line says of the robots, and each other of their motion.

The first line, here in several, holds all that is needed to build the robots again:

    {"cinegen": "mission", "version": 2, "created": "2025-01-31T12:00:00+00:00", "robots": {"delta4": {
        "robot": "r1", "hash": "...", "joints": ["joint1", ...], "index": [0, ...], "actuated": ["joint1", ...],
        "nq": 15, "urdf": "<robot ...", "constraints": {...}, "folder": null, "source": "URDF",
        "stands_on": null, "placement": [0, 0, 0, 0, 0, 0, 1]}}}

Each other line is a moment; `t` is in seconds since the first of them:

    {"t": 0.01, "robots": {"delta4": {"q": [...], "tasks": [{"node": "platform", "who": "hand", "offset": [7 numbers],
        "target": [7 numbers], "translation": 3, "rotation": 0, "weight": 1.0}], "status": "FOLLOWING"}}}

q is in rad and m, and reads back to the same doubles. A placement is x y z (m) and a quaternion x y z w. Where tasks
are left out they are as in the line before, and so is a robot that is left out.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, NamedTuple, NoReturn

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.devices import json_line
from cinegen.errors import CinegenError
from cinegen.model.fingerprint import fingerprint
from cinegen.model.mechanism import Mechanism

Array = NDArray[np.float64]

KIND, VERSION = "mission", 2

_NOT_A_ROTATION = 1e-6  # how far a quaternion's length may be from 1


class MissionError(CinegenError):
    """A mission that can't be recorded, read or exported; says why, and where or when."""


class LineError(MissionError):
    """A line that makes no sense; says why."""


class RecordedTask(NamedTuple):
    """A task as it was.

    Attributes:
        node: that was pulled.
        who: pulled it, such as "hand".
        offset: frame fixed on the node that was constrained, in the node's frame (m).
        target: where that should be, in the world in which all robots stand (m); None for what can't be followed.
        translation: how many translations it held, 0 to 3.
        rotation: how many rotations.
        weight: of its equations.
    """

    node: str
    who: str
    offset: pin.SE3
    target: pin.SE3 | None
    translation: int = 3
    rotation: int = 3
    weight: float = 1.0


class Motion(NamedTuple):
    """A robot at a moment.

    Attributes:
        q: (nq,) where all joints are, rad and m.
        tasks: what holds it.
        status: name of the tick's status.
    """

    q: Array
    tasks: Sequence[RecordedTask] = ()
    status: str = "IDLE"


class Place(NamedTuple):
    """Where a robot stands.

    Attributes:
        stands_on: the robot and its node that it stands on; None: the world.
        placement: of its own world, as seen from there (m); the same unless given.
    """

    stands_on: tuple[str, str] | None = None
    placement: pin.SE3 | None = None


class Entry(NamedTuple):
    """What the first line says of a robot.

    Attributes:
        robot: its own name.
        joints: names of all that move.
        actuated: names of those with a motor.
        nq: numbers of a configuration.
        hash: of what it is built from, see `cinegen.model.fingerprint`.
        urdf: text of its tree.
        constraints: what that can't say.
        folder: where its meshes are looked for.
        source: what errors call the URDF.
        place: where it stands.
    """

    robot: str
    joints: tuple[str, ...]
    actuated: tuple[str, ...]
    nq: int
    hash: str
    urdf: str
    constraints: Mapping[str, Any] | None
    folder: str | None
    source: str
    place: Place


# --- written -----------------------------------------------------------------------------------------------------


def header(mechanisms: Mapping[str, Mechanism], places: Mapping[str, Place]) -> bytes:
    """The first line.

    Raises:
        MissionError: a place is of a robot that is not there, or stands on none.
    """
    for name, place in places.items():
        if name not in mechanisms:
            raise MissionError(f"no robot '{name}' is recorded")
        if place.stands_on is not None:
            other, node = place.stands_on
            if other not in mechanisms or node not in mechanisms[other].nodes:
                raise MissionError(f"robot '{name}' stands on '{node}' of '{other}', which is not recorded")
    robots = {name: _entry(mechanism, places.get(name, Place())) for name, mechanism in mechanisms.items()}
    created = datetime.now(UTC).isoformat(timespec="seconds")
    return _bytes({"cinegen": KIND, "version": VERSION, "created": created, "robots": robots})


def _entry(mechanism: Mechanism, place: Place) -> dict[str, Any]:
    source = mechanism.source
    return {
        "robot": mechanism.name,
        "hash": fingerprint(source.urdf, source.constraints),
        "joints": mechanism.joints,
        "index": [mechanism.q_index(joint) for joint in mechanism.joints],
        "actuated": mechanism.actuated,
        "nq": mechanism.model.nq,
        "urdf": source.urdf,
        "constraints": source.constraints,
        "folder": None if source.folder is None else os.path.abspath(source.folder),
        "source": source.name,
        "stands_on": place.stands_on,
        "placement": _numbers_of(place.placement or pin.SE3.Identity()),
    }


def written(motion: Motion) -> dict[str, Any]:
    """A robot's part of a line, with all its tasks.

    Raises:
        ValueError: it holds what is no number.
    """
    tasks = [
        {
            "node": str(task.node),
            "who": str(task.who),
            "offset": _numbers_of(task.offset),
            "target": _finite_numbers_of(task.target),
            "translation": int(task.translation),
            "rotation": int(task.rotation),
            "weight": float(task.weight),
        }
        for task in motion.tasks
    ]
    q = [float(value) for value in motion.q]
    if not all(map(math.isfinite, q)):
        raise ValueError("q holds numbers that are not finite")
    return {"q": q, "tasks": tasks, "status": str(motion.status)}


def line(time: float, robots: Mapping[str, Mapping[str, Any]]) -> bytes:
    """A line of parts as `written` makes them.

    Args:
        time: s, since the first line.
        robots: by name.

    Raises:
        ValueError: it holds what is no number.
    """
    return _bytes({"t": time, "robots": robots})


def _bytes(values: Mapping[str, Any]) -> bytes:
    return json.dumps(values, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def _numbers_of(placement: pin.SE3) -> list[float]:
    numbers: list[float] = pin.SE3ToXYZQUAT(placement).tolist()
    return numbers


def _finite_numbers_of(placement: pin.SE3 | None) -> list[float] | None:
    if placement is None:
        return None
    numbers = _numbers_of(placement)
    return numbers if all(map(math.isfinite, numbers)) else None


# --- read --------------------------------------------------------------------------------------------------------


def begins_a_mission(first: bytes) -> bool:
    """Whether a file that begins so is a mission, of any version."""
    values = _object(first)
    return values is not None and values.get("cinegen") == KIND


def parse_header(first: bytes) -> tuple[str, dict[str, Entry]]:
    """When a mission was recorded, and what its first line says of each robot.

    Raises:
        LineError: it is none, or of another version; says why.
    """
    values = _object(first)
    said = values.get("cinegen") if values is not None else None
    if values is None or said != KIND:
        other = " It is one of a sensor's readings." if said == "readings" else ""
        raise LineError(f'no recording of a mission (those begin with {{"cinegen":"mission", ...}}).{other}')
    if values.get("version") != VERSION:
        raise LineError(f"a mission of version {values.get('version')}, only {VERSION} can be read")
    robots = values.get("robots")
    if not isinstance(robots, dict) or not robots:
        raise LineError("its first line names no robots")
    try:
        return str(values.get("created", "")), {name: _read_entry(entry) for name, entry in robots.items()}
    except (KeyError, TypeError, ValueError) as error:
        raise LineError(f"its first line does not describe its robots: {error!r:.100}") from None


def _read_entry(entry: Any) -> Entry:
    stands_on = entry["stands_on"]
    if stands_on is not None:
        robot, node = map(str, stands_on)
        stands_on = (robot, node)
    constraints, folder = entry["constraints"], entry["folder"]
    if not isinstance(entry["urdf"], str) or not isinstance(constraints, dict | None):
        raise ValueError("no texts to build it from")
    return Entry(
        str(entry["robot"]),
        tuple(map(str, entry["joints"])),
        tuple(map(str, entry["actuated"])),
        int(entry["nq"]),
        str(entry["hash"]),
        entry["urdf"],
        constraints,
        None if folder is None else str(folder),
        str(entry["source"]),
        Place(stands_on, _placement(entry["placement"], "placement")),
    )


def parse_line(data: bytes, robots: Mapping[str, int]) -> tuple[float, dict[str, tuple[Motion, bool]]]:
    """The time of a line, and the robots that it names: their motion, and whether it names their tasks.

    Args:
        data: the line.
        robots: how many numbers a configuration of each has.

    Raises:
        LineError: it makes no sense; says why.
    """
    values = _object(data)
    if values is None:
        raise LineError("no JSON object, or it holds what is no number")
    (time,) = _numbers([values.get("t")], 1, "t")
    parts = values.get("robots")
    if not isinstance(parts, dict):
        raise LineError("'robots' must be an object")
    found = {}
    for name, part in parts.items():
        if name not in robots:
            raise LineError(f"robot '{name:.40}' is not one of those in the first line")
        if not isinstance(part, dict):
            raise LineError(f"robot '{name}' must be an object")
        q = np.array(_numbers(part.get("q"), robots[name], "q"))
        status = part.get("status")
        if not isinstance(status, str):
            raise LineError("'status' must be a word")
        tasks = part.get("tasks")
        if tasks is not None and not isinstance(tasks, list):
            raise LineError("'tasks' must be a list")
        found[name] = Motion(q, tuple(map(_pulled, tasks or ())), status), tasks is not None
    return time, found


def _pulled(values: Any) -> RecordedTask:
    if (
        not isinstance(values, dict)
        or not isinstance(values.get("node"), str)
        or not isinstance(values.get("who"), str)
    ):
        raise LineError("a task must be an object that says which 'node' is pulled, and 'who' tasks")
    target = values.get("target")
    translation, rotation = (_count(values.get(name), name) for name in ("translation", "rotation"))
    (weight,) = _numbers([values.get("weight")], 1, "weight")
    offset = _placement(values.get("offset"), "offset")
    aim = None if target is None else _placement(target, "target")
    return RecordedTask(values["node"], values["who"], offset, aim, translation, rotation, weight)


def _count(value: Any, name: str) -> int:
    if type(value) is not int or not 0 <= value <= 3:
        raise LineError(f"'{name}' of a task must be 0 to 3")
    return value


def _placement(values: Any, name: str) -> pin.SE3:
    found = np.array(_numbers(values, 7, name))
    if not abs(float(np.linalg.norm(found[3:])) - 1.0) < _NOT_A_ROTATION:
        raise LineError(f"the quaternion of '{name}' must have the length 1")
    return pin.XYZQUATToSE3(found)


def _numbers(values: Any, count: int, name: str) -> list[float]:
    try:
        return json_line.numbers(values, count, name)
    except json_line.LineError as error:
        raise LineError(str(error)) from None


def _object(data: bytes) -> dict[str, Any] | None:
    try:
        values = json.loads(data, parse_constant=_no_number)
    except (ValueError, RecursionError):
        return None
    return values if isinstance(values, dict) else None


def _no_number(text: str) -> NoReturn:
    raise ValueError(text)
