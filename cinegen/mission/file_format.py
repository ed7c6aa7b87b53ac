"""The file format of a mission, lines of JSON: this module is the schema.

The first line describes the robots and obstacles, see `MissionHeader`; with it they can be built again. Each other line
is a moment, see `Moment`. A pose is x y z (m) and a quaternion x y z w. `docs/protocols.py` generates the tables of
`docs/reference/protocol.md` from the classes here.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, Literal

import msgspec
import pinocchio as pin
from msgspec import UNSET, Struct, UnsetType

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.ik.tasks.described import AnyDescription
from cinegen.mission.drawn_obstacle import DrawnObstacle
from cinegen.model.fingerprint import fingerprint
from cinegen.model.mechanism import Mechanism
from cinegen.typed_json import DoF, decoder, encode, every_problem
from raff2urdf.escape import one_line

VERSION: Literal[3] = 3

KEPT = ("tasks", "described")
"""Fields of a sample that are those of the moment before where they are left out."""


class MissionError(CinegenError):
    """A mission can't be recorded, read or exported. The message contains the line or the time."""


class RecordedTask(Struct, frozen=True, forbid_unknown_fields=True):
    """A task at a moment.

    Attributes:
        node: node that it moves.
        source: what commands it: "pointer", "pin", "sensor" or "plan".
        offset: frame that is constrained, in the node's frame (m).
        target: of that frame, in the world of all robots (m); None if it was not valid.
        translation: number of constrained translations.
        rotation: number of constrained rotations.
        weight: of its equations.
        priority: 0 is served first.
    """

    node: str
    source: str
    offset: pin.SE3
    target: pin.SE3 | None
    translation: DoF = 3
    rotation: DoF = 3
    weight: float = 1.0
    priority: int = 0


class RobotSample(Struct, frozen=True, forbid_unknown_fields=True):
    """A robot at a moment.

    Attributes:
        q: (nq,) configuration, rad and m. The file has the same doubles.
        status: name of the tick's status.
        tasks: tasks of the robot; UNSET (left out in the file): those of the moment before.
        described: its tasks of other kinds than frames, in the world of all robots; UNSET: those of the moment before.
    """

    q: Array
    status: str
    tasks: tuple[RecordedTask, ...] | UnsetType = UNSET
    described: tuple[AnyDescription, ...] | UnsetType = UNSET


class BasePose(Struct, frozen=True, forbid_unknown_fields=True):
    """Pose of a robot's own world.

    Attributes:
        robot: robot that carries it; None: nothing, it is fixed.
        node: node of that robot.
        placement: in the frame of the node, or in the world of all robots (m).
    """

    robot: str | None = None
    node: str | None = None
    placement: pin.SE3 = msgspec.field(default_factory=pin.SE3.Identity)


class RecordedRobot(Struct, frozen=True, forbid_unknown_fields=True):
    """A robot in the first line.

    Attributes:
        robot: its own name.
        hash: SHA-256 of `urdf` and `constraints`.
        joints: joints that move.
        index: index of each of them in q, from 0.
        actuated: actuated joints.
        nq: length of q.
        urdf: URDF that the robot is built from.
        constraints: sidecar of the URDF, or null.
        folder: folder of meshes that the URDF names relatively, or null; only needed to draw them. It is
            read if it is near the recording, or in `RAFF2URDF_MESH_PATH`.
        source: what errors call the URDF.
        base: base pose.
    """

    robot: str
    hash: str
    joints: tuple[str, ...]
    index: tuple[int, ...]
    actuated: tuple[str, ...]
    nq: int
    urdf: str
    constraints: dict[str, Any] | None
    folder: str | None
    source: str
    base: BasePose


class MissionHeader(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The first line.

    Attributes:
        cinegen: kind of the file.
        version: of the format.
        created: time, in ISO 8601.
        robots: robots by name.
        obstacles: obstacles by name.
    """

    cinegen: Literal["mission"]
    version: Literal[3]
    created: str
    robots: dict[str, RecordedRobot]
    obstacles: dict[str, DrawnObstacle] = {}


class Moment(Struct, frozen=True, forbid_unknown_fields=True):
    """Any other line.

    Attributes:
        t: time since the first moment, s.
        robots: robots by name; one that is left out is as in the moment before.
        obstacles: poses of obstacles in the world (m), by name; one that is left out is as in the moment before.
    """

    t: float
    robots: dict[str, RobotSample]
    obstacles: dict[str, pin.SE3] = {}


class _FileKind(Struct):
    cinegen: str = ""
    version: int = 0


_FILE_KIND = decoder(_FileKind, _FileKind)
_HEADER = decoder(MissionHeader, MissionHeader)
_MOMENT = decoder(Moment, Moment)
_NOT_DECODED = (msgspec.MsgspecError, RecursionError, UnicodeError)


def encode_header(
    mechanisms: Mapping[str, Mechanism], bases: Mapping[str, BasePose], obstacles: Mapping[str, DrawnObstacle]
) -> bytes:
    """Encode the first line.

    Raises:
        MissionError: a base pose is of a robot that is not recorded, or on one; or an obstacle has a robot's name.
    """
    for name in obstacles:
        if name in mechanisms:
            raise MissionError(f"both a robot and an obstacle are called '{name}': rename one")
    for name, base in bases.items():
        if name not in mechanisms:
            raise MissionError(f"no robot '{name}' is recorded")
        if base.robot is not None and (base.robot not in mechanisms or base.node not in mechanisms[base.robot].nodes):
            raise MissionError(f"the base of '{name}' is '{base.node}' of '{base.robot}', which is not recorded")
    robots = {name: _described(mechanism, bases.get(name, BasePose())) for name, mechanism in mechanisms.items()}
    created = datetime.now(UTC).isoformat(timespec="seconds")
    return encode(MissionHeader("mission", VERSION, created, robots, dict(obstacles))) + b"\n"


def _described(mechanism: Mechanism, base: BasePose) -> RecordedRobot:
    source = mechanism.source
    return RecordedRobot(
        mechanism.name,
        fingerprint(source.urdf, source.constraints),
        mechanism.joints,
        tuple(mechanism.q_index(joint) for joint in mechanism.joints),
        mechanism.actuated,
        mechanism.model.nq,
        source.urdf,
        None if source.constraints is None else dict(source.constraints),
        None if source.folder is None else os.path.abspath(source.folder),
        source.name,
        base,
    )


def is_mission(first: bytes) -> bool:
    """Return whether a file with this first line is a mission, of any version."""
    try:
        return _FILE_KIND.decode(first).cinegen == "mission"
    except _NOT_DECODED:
        return False


def decode_header(first: bytes) -> MissionHeader:
    """Decode the first line.

    Raises:
        MissionError: it is no mission, of another version, or doesn't match the schema.
    """
    try:
        kind = _FILE_KIND.decode(first)
    except _NOT_DECODED:
        kind = _FileKind()
    if kind.cinegen != "mission":
        readings = " It is a recording of sensor readings." if kind.cinegen == "readings" else ""
        raise MissionError(f"not a mission: record one with `cinegen drive --record FILE.jsonl`{readings}")
    if kind.version != VERSION:
        raise MissionError(f"a mission of version {kind.version}; only version {VERSION} can be read")
    try:
        header = _HEADER.decode(first)
    except _NOT_DECODED as error:
        problems = every_problem(first, _HEADER, error).split("\n")
        raise MissionError("\n".join(f"line 1: {problem}" for problem in problems)) from None
    if not header.robots:
        raise MissionError("line 1: Expected at least one robot - at `$.robots`")
    robots = {one_line(name): _shown(robot) for name, robot in header.robots.items()}
    obstacles = {one_line(name): obstacle for name, obstacle in header.obstacles.items()}
    if len(robots) + len(obstacles) < len(header.robots) + len(header.obstacles):
        raise MissionError("line 1: two names differ only in characters that can't be printed - at `$.robots`")
    return msgspec.structs.replace(header, robots=robots, obstacles=obstacles)


def _shown(robot: RecordedRobot) -> RecordedRobot:
    """Return a robot whose texts for users can be printed."""
    base = (
        robot.base
        if robot.base.robot is None
        else msgspec.structs.replace(robot.base, robot=one_line(robot.base.robot))
    )
    return msgspec.structs.replace(robot, robot=one_line(robot.robot), source=one_line(robot.source), base=base)


def decode_moment(data: bytes, header: MissionHeader, before: Moment | None = None) -> Moment:
    """Decode a moment of the robots and obstacles of a first line. What it leaves out is as in the moment before.

    Raises:
        MissionError: it doesn't match the schema, is of other robots or obstacles, or is not after the moment before.
    """
    try:
        moment = _MOMENT.decode(data)
    except _NOT_DECODED as error:
        raise MissionError(every_problem(data, _MOMENT, error)) from None
    robots, wrong = {} if before is None else dict(before.robots), list[str]()
    for written, sample in moment.robots.items():
        name = one_line(written)
        if name not in header.robots:
            wrong.append(f"robot '{name:.40}' is not in the first line - at `$.robots`")
            continue
        if len(sample.q) != header.robots[name].nq:
            wrong.append(f"Expected `array` of length {header.robots[name].nq} - at `$.robots.{name}.q`")
        same = {kind: getattr(robots[name], kind) for kind in KEPT if getattr(sample, kind) is UNSET and name in robots}
        robots[name] = msgspec.structs.replace(sample, **same) if same else sample
    moved = {one_line(name): pose for name, pose in moment.obstacles.items()}
    wrong += [
        f"obstacle '{name:.40}' is not in the first line - at `$.obstacles`"
        for name in moved
        if name not in header.obstacles
    ]
    if before is None:
        obstacles = {name: obstacle.placement for name, obstacle in header.obstacles.items()}
    else:
        obstacles = before.obstacles
        if moment.t <= before.t:
            wrong.append("Expected a time after that of the line before - at `$.t`")
    if wrong:
        raise MissionError("\n".join(wrong))
    return Moment(moment.t, robots, obstacles | moved)
