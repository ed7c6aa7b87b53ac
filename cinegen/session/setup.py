"""What a session is made of: robots, where they stand, sensors, and which node each sensor may hold.

A `Setup` is a value: it can be sent to the process that the session runs in.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

from cinegen.collision.scene import Scene
from cinegen.devices.kinds import listens_for_others, overrides, why_missing
from cinegen.errors import CinegenError, CinegenWarning, UnknownNameError
from cinegen.mission import Recording
from cinegen.model import Mechanism

RATE = 1000.0
"""Ticks a second."""

GAMEPAD = "gamepad"
"""The name of the browser's gamepad among the sensors; it may hold any node that another sensor may hold."""

_ROOM = 0.3  # characteristic lengths, around robots that are set side by side

PATH = "path"
"""The name of the script that moves a robot until a person takes it."""


class SetupError(CinegenError):
    """Robots or sensors that can't be put together as asked; says why."""


@dataclass(frozen=True)
class Stand:
    """Where a robot stands.

    Attributes:
        robot: on a node of this one; None: in the world.
        node: of that robot.
        placement: of the robot's world there.
    """

    robot: str | None = None
    node: str | None = None
    placement: pin.SE3 = field(default_factory=pin.SE3.Identity)


@dataclass(frozen=True)
class Device:
    """A sensor of a session.

    Attributes:
        name: of the sensor in this session: its number in the file, or a word.
        url: where it is.
        translation: how many translations it commands, 0 to 3.
        rotation: how many rotations.
        robot: that a script is fitted to; None for what moves any.
        node: that it is fitted to.
    """

    name: str
    url: str
    translation: int = 3
    rotation: int = 3
    robot: str | None = None
    node: str | None = None


@dataclass(frozen=True)
class Switch:
    """A node that one of several sensors may hold, or none.

    Attributes:
        robot: whose.
        node: which.
        choices: names of sensors; None: left free.
        first: the choice at the beginning.
    """

    robot: str
    node: str
    choices: tuple[str | None, ...]
    first: str | None = None


@dataclass(frozen=True)
class Surroundings:
    """What a robot keeps clear of.

    Attributes:
        robot: which.
        scene: what stands around it, and where it begins; the robot's world is the scene's.
        obstacles: the session's name of each of the scene's obstacles, in its order.
    """

    robot: str
    scene: Scene
    obstacles: tuple[str, ...]


@dataclass(frozen=True)
class MapBeside:
    """A map that is shown beside the robot that it is of.

    Attributes:
        path: of the map.
        robot: in whose world the map is.
        node: whose poses it is of.
        quantity: that its cells are coloured by at first; None: its first.
    """

    path: str
    robot: str
    node: str
    quantity: str | None = None


@dataclass(frozen=True)
class Setup:
    """What a session is made of.

    Attributes:
        robots: by their name in the session; obstacles too.
        stands: of those that don't stand in the world's origin.
        devices: the sensors.
        switches: what these may hold.
        rate: ticks a second.
        record: the file that the session is recorded in from its beginning.
        replay: a recording that is shown instead of being driven.
        tempo: how many times as fast as it was.
        stops: moments of the recording (s) that one can go to, each with its name; it is held at the first.
        surroundings: what one of the robots keeps clear of.
        map: that is shown beside one of them.
        priority: of the real-time class SCHED_FIFO that the session asks for, 1 to 99; 0: ordinary scheduling.
    """

    robots: Mapping[str, Mechanism]
    stands: Mapping[str, Stand] = field(default_factory=dict)
    devices: tuple[Device, ...] = ()
    switches: tuple[Switch, ...] = ()
    rate: float = RATE
    record: str | None = None
    replay: str | None = None
    tempo: float = 1.0
    stops: tuple[tuple[float, str], ...] = ()
    surroundings: Surroundings | None = None
    map: MapBeside | None = None
    priority: int = 0

    def __post_init__(self) -> None:
        if not self.robots:
            raise SetupError("a session has one robot at least")
        self.order()
        if not 1.0 <= self.rate <= 1e5:
            raise SetupError(f"a session's rate is 1 to 100,000 ticks a second, not {self.rate}")

    def stand(self, robot: str) -> Stand:
        """Where a robot stands."""
        return self.stands.get(robot, Stand())

    def order(self) -> tuple[str, ...]:
        """The robots, each behind the one that it stands on.

        Raises:
            SetupError: robots that stand on each other in a circle.
            UnknownNameError: a robot or a node that there is not.
        """
        placed: list[str] = []
        for robot in self.stands:
            if robot not in self.robots:
                raise UnknownNameError("robot", robot, tuple(self.robots))
        waiting = list(self.robots)
        while waiting:
            ready = [name for name in waiting if self.stand(name).robot in (None, *placed)]
            for name in waiting:
                on, node = self.stand(name).robot, self.stand(name).node
                if on is not None:
                    if on not in self.robots:
                        raise UnknownNameError("robot", on, tuple(self.robots))
                    self.robots[on].frame_id(str(node))
            if not ready:
                raise SetupError(f"{', '.join(waiting)} stand on each other in a circle")
            placed += ready
            waiting = [name for name in waiting if name not in ready]
        return tuple(placed)


def stand_of(text: str) -> tuple[str, Stand]:
    """Where a robot stands, from a text: `NAME=ROBOT.NODE`, `NAME=x,y,z`, `NAME=x,y,z,roll,pitch,yaw` (m, degrees), or
    `NAME=ROBOT.NODE@x,y,z...` for a place seen from a node.

    Raises:
        SetupError: it is not written so.
    """
    name, equals, place = text.partition("=")
    on, at, numbers = place.partition("@")
    if not at and _numbers(on) is not None:
        on, numbers = "", on
    robot, _, node = on.rpartition(".")
    values = _numbers(numbers) if numbers or at else ()
    if not (name and equals) or values is None or not (on or values) or (on and not (robot and node)):
        raise SetupError(
            f"--base {text}: write NAME=ROBOT.NODE, NAME=x,y,z[,roll,pitch,yaw] (m, degrees) or "
            "NAME=ROBOT.NODE@x,y,z..., for example --base wrist=delta4.platform"
        )
    placement = pin.SE3.Identity()
    if values:
        turn = np.radians([*values[3:], 0.0, 0.0, 0.0][:3])
        placement = pin.SE3(pin.rpy.rpyToMatrix(turn), np.array(values[:3]))
    return name, Stand(robot or None, node or None, placement)


def _numbers(text: str) -> tuple[float, ...] | None:
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        return None
    return values if len(values) in (3, 6) and np.isfinite(values).all() else None


def arrange(
    robots: Mapping[str, Mechanism],
    files: Mapping[str, str] | None = None,
    sensors: Sequence[str] = (),
    follow: str | None = None,
    node: str | None = None,
    stands: Iterable[str] = (),
    rate: float = RATE,
    record: str | None = None,
) -> Setup:
    """A session's robots with the sensors that their files name, and others.

    Args:
        robots: by their name in the session.
        files: of each robot the file it is from: sensors are numbered by file, and robots of several files are set side
            by side; all from one unless given.
        sensors: texts such as `1=/dev/ttyUSB0`: another port for the files' sensor 1; or `NODE=URL`,
            `ROBOT.NODE=URL`: a sensor that holds a node which the file ties to none.
        follow: the shape of the path that each robot's end, or `node`, follows until a person takes the robot.
        node: that follows it.
        stands: texts as `stand_of` reads them.
        rate: ticks a second.
        record: a file to record in.

    Raises:
        SetupError: what is asked makes no sense.
        UnknownNameError: a node or robot that there is not.
    """
    files = files or dict.fromkeys(robots, "")
    numbered, others = _told_apart(sensors)
    several = len(set(files.values())) > 1
    devices: dict[str, Device] = {}
    switches: list[Switch] = []
    used: set[int] = set()
    for name, mechanism in robots.items():
        choices_of: dict[str, list[str | None]] = {}
        first: dict[str, str | None] = {}
        for held, numbers in mechanism.sensor_constraints:
            for number in numbers:
                if number == 0:
                    choices_of.setdefault(held, []).append(None)
                    continue
                label = f"{files[name]} {number}" if several else str(number)
                entry = mechanism.sensors.get(number)
                if entry is None:
                    continue
                used.add(number)
                url = numbered.get(number, entry["port"])
                if number not in numbered and listens_for_others(url):
                    raise SetupError(
                        f"{name}: the file's sensor {number}, '{url}', would let other machines drive the robot. "
                        f"If that is wanted, give --sensor {number}={url}; else --sensor {number}=tcp://127.0.0.1:7070"
                    )
                devices.setdefault(label, _device(label, url, number, entry["translation"], entry["rotation"]))
                choices_of.setdefault(held, []).append(label)
                if number in numbered:
                    first[held] = label
        for text, url in others:
            of, _, own = text.rpartition(".") if text not in mechanism.nodes else ("", "", text)
            if of not in ("", name) or own not in mechanism.nodes:
                continue
            label = _free(own, devices)
            devices[label] = _device(label, url, None, 3, 3, name, own)
            choices_of.setdefault(own, [None]).append(label)
            first[own] = label
        if follow is not None:
            led = node or mechanism.end
            mechanism.frame_id(led)
            label = f"{PATH} {name}" if len(robots) > 1 else PATH
            devices[label] = _device(label, f"path:{follow}", None, 3, 3, name, led)
            choices_of.setdefault(led, [None]).append(label)
            if choices_of[led][0] is None:  # else the file says who holds it
                first.setdefault(led, label)
        choices_of.setdefault(mechanism.end, [None])
        for held, choices in choices_of.items():
            found = tuple(dict.fromkeys([*choices, GAMEPAD]))
            switches.append(Switch(name, held, found, first.get(held, choices[0])))
    _all_used(robots, numbered, used, others)
    devices[GAMEPAD] = Device(GAMEPAD, "gamepad:")
    placed = _side_by_side(robots, files)
    for text in stands:
        name, stand = stand_of(text)
        placed[name] = stand
    return Setup(dict(robots), placed, tuple(devices.values()), tuple(switches), rate, record)


def replayed(path: str | Path, tempo: float = 1.0, stops: Sequence[tuple[float, str]] = ()) -> Setup:
    """A session that shows a recording.

    Args:
        path: of it.
        tempo: how many times as fast as it was.
        stops: moments (s) that one can go to, each with its name.

    Raises:
        MissionError: it can't be read, or its robots can't be built.
        SetupError: a tempo that makes no sense.
    """
    if not 0.01 <= tempo <= 100.0:
        raise SetupError(f"a tempo is 0.01 to 100 times that of the recording, not {tempo}")
    recording = Recording.load(path)
    stands = {}
    for name, base in recording.bases.items():
        stands[name] = Stand(base.robot, base.node, base.placement)
    robots = {name: recording.mechanism(name) for name in recording.q}
    return Setup(robots, stands, replay=str(path), tempo=tempo, stops=tuple(stops))


def _side_by_side(robots: Mapping[str, Mechanism], files: Mapping[str, str]) -> dict[str, Stand]:
    """Robots of one file stand as it says; those of the next file to the right of them, along x, where they would stand
    in each other else."""
    stands: dict[str, Stand] = {}
    edge = -np.inf
    for file in dict.fromkeys(files[name] for name in robots):
        own = [name for name in robots if files[name] == file]
        places = [robots[name].placement(robots[name].q_home, node) for name in own for node in robots[name].nodes]
        room = _ROOM * max(robots[name].length for name in own)
        left, right = (pick(float(place.translation[0]) for place in places) for pick in (min, max))
        shift = max(0.0, edge + room - left) if edge > -np.inf else 0.0
        if shift > 0.0:
            stands |= {name: Stand(placement=pin.SE3(np.eye(3), np.array([shift, 0.0, 0.0]))) for name in own}
        edge = right + shift + room
    return stands


def _told_apart(texts: Sequence[str]) -> tuple[dict[int, str], list[tuple[str, str]]]:
    """What stands for a file's sensor, by number; and what holds a node, by its name."""
    numbered = overrides(text for text in texts if text.partition("=")[0].isdecimal())
    others = []
    for text in texts:
        node, _, url = text.partition("=")
        if not (node and url):
            raise SetupError(
                f"--sensor {text}: write NUMBER=URL for a sensor of the file, or NODE=URL to hold a node, for example "
                "--sensor 1=/dev/ttyUSB0"
            )
        if not node.isdecimal():
            others.append((node, url))
    return numbered, others


def _device(
    name: str, url: str, number: int | None, translation: int, rotation: int, robot: str | None = None, node: str = ""
) -> Device:
    """A sensor; warned of where its port is not there."""
    missing = why_missing(url, number)
    if missing:
        warnings.warn(missing, CinegenWarning, stacklevel=3)
    return Device(name, url, translation, rotation, robot, node or None)


def _free(label: str, taken: Mapping[str, object]) -> str:
    while label in taken:
        label += "'"
    return label


def _all_used(
    robots: Mapping[str, Mechanism], numbered: Mapping[int, str], used: set[int], others: Sequence[tuple[str, str]]
) -> None:
    """Refuses what was asked for and is for nothing."""
    for number in numbered:
        if number not in used:
            known = ", ".join(map(str, sorted(used))) or "none"
            raise SetupError(
                f"--sensor {number}=...: no node of these files may follow a sensor {number} (sensors there: {known}); "
                "NODE=URL lets a sensor hold any node"
            )
    for text, _ in others:
        robot, _, node = text.rpartition(".")
        nodes = {node for mechanism in robots.values() for node in mechanism.nodes}
        if text not in nodes and not (robot in robots and node in robots[robot].nodes):
            if robot in robots:
                raise UnknownNameError("node", node, robots[robot].nodes)
            raise UnknownNameError("node", text, tuple(sorted(nodes)))
