"""`Setup`: the robots of a session, their base poses, its sensors, and the nodes that may follow them.

A `Setup` is a value: it can be sent to the process in which the session runs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from msgspec import Struct

from cinegen.arrays import Array
from cinegen.collision import Scene
from cinegen.devices.kinds import scheme
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.ik.joint_settings import checked_names, names_of
from cinegen.mission import BasePose, Recording
from cinegen.mission.drawn_obstacle import DrawnObstacle, DrawnShape
from cinegen.model import Mechanism
from raff2urdf.axes import UNCHANGED

RATE = 1000.0
"""Ticks per second."""

PATH = "path"
"""Name of the script that moves a robot until a user drags it."""

GAMEPAD = "gamepad"
"""Name of the browser's gamepad among the sensors; each node that may follow a sensor may follow it."""


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
        locked = dict(self.locked)
        for text in joints:
            robot, _, joint = text.rpartition(".") if text.rpartition(".")[0] in self.robots else ("", "", text)
            robots = [robot] if robot else list(self.robots)
            known = [name for name in robots if joint in (*names_of(self.robots[name]), "base")]
            if not known:
                names = tuple(name for robot in robots for name in names_of(self.robots[robot]))
                raise UnknownNameError("joint", joint, names)
            if len(known) > 1:
                raise SetupError(f"several robots have a joint '{joint}': name one, such as {known[0]}.{joint}")
            names = checked_names(self.robots[known[0]], [joint])
            locked[known[0]] = tuple(dict.fromkeys((*locked.get(known[0], ()), *names)))
        return replace(self, locked=locked)

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
