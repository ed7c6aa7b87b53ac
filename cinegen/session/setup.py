"""`Setup`: the robots of a session, their base poses, its sensors, and the nodes that may follow them.

A `Setup` is a value: it can be sent to the process in which the session runs.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import numpy as np
import pinocchio as pin
from msgspec import Struct

from cinegen.arrays import Array
from cinegen.collision import Scene
from cinegen.devices.kinds import exposure, overrides, refusal, scheme, split_axes, split_token, why_missing
from cinegen.errors import CinegenError, CinegenWarning, UnknownNameError
from cinegen.ik.joints import checked_names, names_of
from cinegen.mission import BasePose, Recording
from cinegen.mission.drawn_obstacle import DrawnObstacle, DrawnShape
from cinegen.model import Mechanism
from cinegen.model.plausible import FAR, reach
from cinegen.session.regular_start import regular_start
from raff2urdf.axes import UNCHANGED
from raff2urdf.quantities import ANGLE, LENGTH, QuantityError, parse_list, shown

RATE = 1000.0
"""Ticks per second."""

GAMEPAD = "gamepad"
"""Name of the browser's gamepad among the sensors; each node that may follow a sensor may follow it."""

_ROOM = 0.3  # characteristic lengths, around robots that are placed side by side

PATH = "path"
"""Name of the script that moves a robot until a user drags it."""


class SetupError(CinegenError):
    """Robots or sensors can't be combined as requested."""


@dataclass(frozen=True)
class Device:
    """A sensor of a session.

    Attributes:
        name: name in the session: its number in the file, or a word.
        url: address, see `cinegen.devices.open_sensor`.
        translation: number of translations that it commands, 0 to 3.
        rotation: number of rotations.
        robot: robot that a script is made for; None: any.
        node: node that a script is made for.
        token: token that programs must send first; empty: none.
        axes: axes that command the node's, see `cinegen.devices.TwistMapping`.
    """

    name: str
    url: str
    translation: int = 3
    rotation: int = 3
    robot: str | None = None
    node: str | None = None
    token: str = field(default="", repr=False)
    axes: str = UNCHANGED

    @property
    def has_axes(self) -> bool:
        """False if it sends targets only, which have no axes to map."""
        return scheme(self.url) not in ("path", "seam")


class SensorSwitch(Struct, frozen=True):
    """A node that may follow sensors.

    Attributes:
        robot: robot of the node.
        node: node that follows.
        choices: ids of the sensors; None: no sensor.
        first: initial choice.
    """

    robot: str
    node: str
    choices: tuple[str | None, ...]
    first: str | None = None


@dataclass(frozen=True)
class Avoidance:
    """A robot that avoids obstacles.

    Attributes:
        robot: name of the robot.
        scene: its initial configuration, and its obstacles, which are the session's in the same order; the robot's
            world is the scene's.
    """

    robot: str
    scene: Scene


@dataclass(frozen=True)
class DrawnAttached:
    """An object that a robot holds, as it is drawn.

    Attributes:
        robot: name of the robot.
        node: node that holds it.
        name: name of the object.
        shapes: its shapes; their placements are in the frame of the node.
    """

    robot: str
    node: str
    name: str
    shapes: tuple[DrawnShape, ...]


@dataclass(frozen=True)
class MapOverlay:
    """A map that is drawn with its robot.

    Attributes:
        path: path of the map.
        robot: robot in whose world the map is.
        node: node whose poses it covers.
        quantity: quantity that colours its cells initially; None: its first.
    """

    path: str
    robot: str
    node: str
    quantity: str | None = None


@dataclass(frozen=True)
class Setup:
    """Setup of a session.

    Attributes:
        robots: robots by name.
        starts: (nq,) configurations of robots at the start, by name; home unless given.
        obstacles: obstacles by name; no robot has the same.
        bases: base poses of the robots that are not in the world's origin.
        devices: sensors.
        switches: nodes that may follow them.
        rate: ticks per second.
        record: file in which the session is recorded from its start.
        overwrite: whether that file may exist; it is replaced then.
        replay: recording that is replayed; nothing can be driven then.
        playback_speed: 1 is real time.
        stops: times of the recording (s) to jump to, each with a name; it is paused at the first.
        avoidance: robot that avoids obstacles.
        map: map that is drawn with one of the robots.
        priority: real-time priority (SCHED_FIFO) of the session, 1 to 99; 0: ordinary scheduling.
        attached: objects that robots hold.
        caption: text that the page shows over a replay.
        locked: names of joints that are locked at the start, by robot.
    """

    robots: Mapping[str, Mechanism]
    bases: Mapping[str, BasePose] = field(default_factory=dict)
    devices: tuple[Device, ...] = ()
    switches: tuple[SensorSwitch, ...] = ()
    rate: float = RATE
    record: str | None = None
    replay: str | None = None
    playback_speed: float = 1.0
    stops: tuple[tuple[float, str], ...] = ()
    avoidance: Avoidance | None = None
    map: MapOverlay | None = None
    priority: int = 0
    obstacles: Mapping[str, DrawnObstacle] = field(default_factory=dict)
    starts: Mapping[str, Array] = field(default_factory=dict)
    overwrite: bool = False
    attached: tuple[DrawnAttached, ...] = ()
    caption: str = ""
    locked: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.robots:
            raise SetupError("a session needs a robot")
        for name in self.obstacles:
            if name in self.robots:
                raise SetupError(f"both a robot and an obstacle are called '{name}': rename one")
        self.order()
        if not 1.0 <= self.rate <= 1e5:
            raise SetupError(f"a session's rate must be 1 to 100,000 ticks per second, not {self.rate}")

    def start(self, robot: str) -> Array:
        """Return the configuration (nq,) of a robot at the start."""
        return self.starts.get(robot, self.robots[robot].q_home)

    def with_locked(self, joints: Iterable[str]) -> Setup:
        """Return the same setup with joints that are locked at the start: each a joint's name, or ROBOT.JOINT.

        Raises:
            UnknownNameError: no robot has such a joint.
            CinegenError: several robots have it, or a base does not float.
        """
        found = dict(self.locked)
        for text in joints:
            robot, _, joint = text.rpartition(".") if text.rpartition(".")[0] in self.robots else ("", "", text)
            robots = [robot] if robot else list(self.robots)
            known = [one for one in robots if joint in (*names_of(self.robots[one]), "base")]
            if not known:
                names = tuple(name for one in robots for name in names_of(self.robots[one]))
                raise UnknownNameError("joint", joint, names)
            if len(known) > 1:
                raise SetupError(f"several robots have a joint '{joint}': name one, such as {known[0]}.{joint}")
            names = checked_names(self.robots[known[0]], [joint])
            found[known[0]] = tuple(dict.fromkeys((*found.get(known[0], ()), *names)))
        return replace(self, locked=found)

    def base(self, robot: str) -> BasePose:
        """Return the base pose of a robot."""
        return self.bases.get(robot, BasePose())

    def order(self) -> tuple[str, ...]:
        """Return the robots, each after the one that carries it.

        Raises:
            SetupError: robots carry each other in a cycle.
            UnknownNameError: there is no such robot or node.
        """
        for robot in self.bases:
            if robot not in self.robots:
                raise UnknownNameError("robot", robot, tuple(self.robots))
        carriers: dict[str, set[str]] = {}
        for name in self.robots:
            base = self.base(name)
            carriers[name] = set() if base.robot is None else {base.robot}
            if base.robot is not None:
                if base.robot not in self.robots:
                    raise UnknownNameError("robot", base.robot, tuple(self.robots))
                self.robots[base.robot].frame_id(str(base.node))
        try:
            return tuple(TopologicalSorter(carriers).static_order())
        except CycleError as error:
            raise SetupError(f"{', '.join(sorted(set(error.args[1])))} carry each other") from None


def parse_base_pose(text: str) -> tuple[str, BasePose]:
    """Parse the base pose of a robot: `NAME=ROBOT.NODE`, `NAME=x,y,z`, `NAME=x,y,z,roll,pitch,yaw` (m, degrees), or
    `NAME=ROBOT.NODE@x,y,z...` for a placement in the frame of a node.

    Raises:
        SetupError: the text has another form.
    """
    name, equals, place = text.partition("=")
    on, at, numbers = place.partition("@")
    if not at and "," in on:
        on, numbers = "", on
    robot, _, node = on.rpartition(".")
    given = numbers.split(",") if numbers or at else []
    if not (name and equals) or len(given) not in (0, 3, 6) or not (on or given) or (on and not (robot and node)):
        raise SetupError(
            f"--base {text}: write NAME=ROBOT.NODE, NAME=x,y,z[,roll,pitch,yaw] (m and degrees) or "
            "NAME=ROBOT.NODE@x,y,z..., for example --base wrist=delta4.platform"
        )
    placement = pin.SE3.Identity()
    if given:
        try:
            point, angles = parse_list(given[:3], LENGTH), parse_list(given[3:], ANGLE) or [0.0, 0.0, 0.0]
        except QuantityError as error:
            raise SetupError(f"--base {text}: {error}") from None
        placement = pin.SE3(pin.rpy.rpyToMatrix(np.array(angles)), np.array(point))
    return name, BasePose(robot or None, node or None, placement)


def base_poses(robots: Mapping[str, Mechanism], files: Mapping[str, str], bases: Iterable[str]) -> dict[str, BasePose]:
    """Return the base poses of robots that are not in the world's origin.

    Args:
        robots: robots by name.
        files: file of each; robots of several files are placed side by side.
        bases: texts as `parse_base_pose` reads them.

    Raises:
        SetupError: a text is none, or means a pose out of reach that would be near in mm.
    """
    given = dict(map(parse_base_pose, bases))
    most = FAR * sum(map(reach, robots.values()))
    for name, base in given.items():
        far = float(np.abs(base.placement.translation).max())
        if most < far <= 1000.0 * most:
            raise SetupError(
                f"--base {name}: {shown(far, LENGTH)} is far beyond the reach of all robots: did you mean {far:g} mm?"
            )
    return _side_by_side(robots, files) | given


def arrange(
    robots: Mapping[str, Mechanism],
    files: Mapping[str, str] | None = None,
    sensors: Sequence[str] = (),
    follow: str | None = None,
    node: str | None = None,
    bases: Iterable[str] = (),
    rate: float = RATE,
    record: str | None = None,
) -> Setup:
    """Return the setup of robots with the sensors that their files name, and others.

    Args:
        robots: robots by name.
        files: file of each robot; all from one unless given. Sensors are numbered by file, and robots of several files
            are placed side by side.
        sensors: texts such as `1=/dev/ttyUSB0`, another port for the files' sensor 1; or `NODE=URL`, `ROBOT.NODE=URL`,
            a sensor that a node follows. `#axes=x,-z,y` may follow the URL, or replace it for a file's sensor.
        follow: shape of the path that each robot's end, or `node`, follows until a user drags the robot.
        node: node that follows it.
        bases: texts as `parse_base_pose` reads them.
        rate: ticks per second.
        record: file in which the session is recorded.

    Raises:
        SetupError: the sensors or base poses are not valid for these robots.
        UnknownNameError: there is no such node or robot.
    """
    files = files or dict.fromkeys(robots, "")
    numbered, others = _split(sensors)
    several = len(set(files.values())) > 1
    devices: dict[str, Device] = {}
    switches: list[SensorSwitch] = []
    used: set[int] = set()
    for name, mechanism in robots.items():
        choices_of: dict[str, list[str | None]] = {}
        first: dict[str, str | None] = {}
        for follower, numbers in mechanism.sensor_constraints:
            for number in numbers:
                if number == 0:
                    choices_of.setdefault(follower, []).append(None)
                    continue
                label = f"{files[name]} {number}" if several else str(number)
                entry = mechanism.sensors.get(number)
                if entry is None:
                    continue
                used.add(number)
                own_url, axes = split_axes(numbered.get(number, ""))
                url = own_url or entry["port"]
                reason = "" if own_url else refusal(url)
                if reason:
                    raise SetupError(
                        f"{name}: the file's sensor {number}, {url!r}, {reason}. If that is wanted, give --sensor "
                        f"{number}={url}; else name another one, such as --sensor {number}=tcp://127.0.0.1:7070"
                    )
                dof = entry["translation"], entry["rotation"]
                devices.setdefault(label, _device(label, url, number, *dof, axes=axes or entry["axes"]))
                choices_of.setdefault(follower, []).append(label)
                if number in numbered:
                    first[follower] = label
        for text, url in others:
            of, _, own = text.rpartition(".") if text not in mechanism.nodes else ("", "", text)
            if of not in ("", name) or own not in mechanism.nodes:
                continue
            label = _free(own, devices)
            own_url, axes = split_axes(url)
            devices[label] = _device(label, own_url, None, 3, 3, name, own, axes or UNCHANGED)
            choices_of.setdefault(own, [None]).append(label)
            first[own] = label
        if follow is not None:
            follower = node or mechanism.end
            mechanism.frame_id(follower)
            label = f"{PATH} {name}" if len(robots) > 1 else PATH
            devices[label] = _device(label, f"path:{follow}", None, 3, 3, name, follower)
            choices_of.setdefault(follower, [None]).append(label)
            if choices_of[follower][0] is None:  # otherwise the file says what it follows
                first.setdefault(follower, label)
        choices_of.setdefault(mechanism.end, [None])
        for follower, choices in choices_of.items():
            found = tuple(dict.fromkeys([*choices, GAMEPAD]))
            switches.append(SensorSwitch(name, follower, found, first.get(follower, choices[0])))
    _all_used(robots, numbered, used, others)
    devices[GAMEPAD] = Device(GAMEPAD, "gamepad:")
    placed = base_poses(robots, files, bases)
    starts = {name: regular_start(mechanism) for name, mechanism in robots.items()} if follow is not None else {}
    return Setup(dict(robots), placed, tuple(devices.values()), tuple(switches), rate, record, starts=starts)


def replay_setup(path: str | Path, speed: float = 1.0, stops: Sequence[tuple[float, str]] = ()) -> Setup:
    """Return the setup of a session that replays a recording.

    Args:
        path: path of the recording.
        speed: playback speed; 1 is real time.
        stops: times (s) to jump to, each with a name.

    Raises:
        MissionError: it can't be read, or its robots can't be built.
        SetupError: the speed is out of range.
    """
    if not 0.01 <= speed <= 100.0:
        raise SetupError(f"the playback speed must be 0.01 to 100, not {speed}")
    recording = Recording.load(path)
    robots = {name: recording.mechanism(name) for name in recording.q}
    return Setup(
        robots,
        recording.bases,
        replay=str(path),
        playback_speed=speed,
        stops=tuple(stops),
        obstacles=recording.obstacles,
    )


def _side_by_side(robots: Mapping[str, Mechanism], files: Mapping[str, str]) -> dict[str, BasePose]:
    """Return base poses that move the robots of each file along x, to the right of those before, if they overlap."""
    bases: dict[str, BasePose] = {}
    edge = -np.inf
    for file in dict.fromkeys(files[name] for name in robots):
        own = [name for name in robots if files[name] == file]
        places = [robots[name].placement(robots[name].q_home, node) for name in own for node in robots[name].nodes]
        room = _ROOM * max(robots[name].length for name in own)
        left, right = (pick(float(place.translation[0]) for place in places) for pick in (min, max))
        shift = max(0.0, edge + room - left) if edge > -np.inf else 0.0
        if shift > 0.0:
            bases |= {name: BasePose(placement=pin.SE3(np.eye(3), np.array([shift, 0.0, 0.0]))) for name in own}
        edge = right + shift + room
    return bases


def _split(texts: Sequence[str]) -> tuple[dict[int, str], list[tuple[str, str]]]:
    """Return the URLs that replace those of the files' sensors, by number, and nodes with URLs of their own."""
    numbered = overrides(text for text in texts if text.partition("=")[0].isdecimal())
    others = []
    for text in texts:
        node, _, url = text.partition("=")
        if not node or not (url if node.isdecimal() else split_axes(url)[0]):
            raise SetupError(
                f"--sensor {text}: write NUMBER=URL for a sensor of the file, or NODE=URL for one that a node follows, "
                "for example --sensor 1=/dev/ttyUSB0"
            )
        if not node.isdecimal():
            others.append((node, url))
    return numbered, others


def _device(
    name: str, url: str, number: int | None, translation: int, rotation: int, robot: str | None = None, node: str = "",
    axes: str = UNCHANGED,
) -> Device:  # fmt: skip
    """Return a sensor, with a warning if its port does not exist, or if other machines reach it."""
    own, token = split_token(url)
    for warning in filter(None, (why_missing(url, number), exposure(url, number))):
        warnings.warn(warning, CinegenWarning, stacklevel=3)
    device = Device(name, own, translation, rotation, robot, node or None, token, axes)
    if axes != UNCHANGED and not device.has_axes:
        raise SetupError(f"sensor {name}, '{own}', sends targets, which have no axes to change: remove axes '{axes}'")
    return device


def _free(label: str, taken: Mapping[str, object]) -> str:
    while label in taken:
        label += "'"
    return label


def _all_used(
    robots: Mapping[str, Mechanism], numbered: Mapping[int, str], used: set[int], others: Sequence[tuple[str, str]]
) -> None:
    """Refuse options that have no effect."""
    for number in numbered:
        if number not in used:
            known = ", ".join(map(str, sorted(used))) or "none"
            raise SetupError(
                f"--sensor {number}=...: no node of these files may follow a sensor {number} (sensors there: {known}); "
                "NODE=URL lets any node follow a sensor"
            )
    for text, _ in others:
        robot, _, node = text.rpartition(".")
        nodes = {node for mechanism in robots.values() for node in mechanism.nodes}
        if text not in nodes and not (robot in robots and node in robots[robot].nodes):
            if robot in robots:
                raise UnknownNameError("node", node, robots[robot].nodes)
            raise UnknownNameError("node", text, tuple(sorted(nodes)))
