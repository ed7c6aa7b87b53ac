"""The state of a session, as values that are sent from its process to others."""

from __future__ import annotations

import pinocchio as pin
from msgspec import Struct

from cinegen.arrays import Array
from cinegen.ik.tasks.described import AnyDescription
from cinegen.sensor import SensorState
from cinegen.session.message_types import CommandFrame
from cinegen.typed_json import DoF, Vector3, Vector6


class TaskInfo(Struct, frozen=True, kw_only=True):
    """A task, without its poses.

    Attributes:
        id: number of the task in the session.
        node: node that it moves.
        source: what commands it: pointer, pin or sensor.
        label: name for people.
        error: remaining error, m and rad.
        translation: number of constrained translations.
        rotation: number of constrained rotations.
        weight: of its equations.
        priority: 0 is served first.
    """

    id: int
    node: str
    source: str
    label: str
    error: tuple[float, float]
    translation: DoF
    rotation: DoF
    weight: float
    priority: int


class TaskState(TaskInfo, frozen=True, kw_only=True):
    """A task of a robot.

    Attributes:
        scripted: whether a script commands it, whose path is known.
        offset: frame that is constrained, in the node's frame (m).
        target: of that frame, in the robot's own world (m).
    """

    scripted: bool
    offset: pin.SE3
    target: pin.SE3


class DescribedState(Struct, frozen=True, kw_only=True):
    """A task of a kind.

    Attributes:
        id: number of the task in the session.
        description: its kind and parameters, with points and directions in the session's world.
        error: remaining error, or by how much it is out of its range; m and rad.
        reached: whether that is 0, up to rounding.
    """

    id: int
    description: AnyDescription
    error: tuple[float, float]
    reached: bool


class RobotStatus(Struct, frozen=True):
    """Status of a robot.

    Attributes:
        name: name of a `cinegen.Status`; TOUCHING or PUSHED among obstacles; JOINTS, HOME, MOVE_TO, UNDO or REDO during
            such a motion; in the page, UNCONTROLLED near a type 2 singularity, and DAMPED.
        label: a few words for people, with names and amounts.
        description: a sentence for people.
    """

    name: str
    label: str
    description: str


class Obstruction(Struct, frozen=True):
    """An obstacle, or another link, that stops a robot.

    Attributes:
        label: names of the two bodies.
        points: their nearest points in the session's world, m: on the robot, and on what stops it.
    """

    label: str
    points: tuple[Vector3, Vector3]


class CarriedMass(Struct, frozen=True):
    """The payload of a robot: a point mass at the origin of a node.

    Attributes:
        node: node that carries it.
        mass: kg.
    """

    node: str
    mass: float


class RobotState(Struct, frozen=True):
    """A robot.

    Attributes:
        q: (nq,) configuration with closed loops, rad and m.
        base: base pose in the session's world (m).
        tasks: its tasks.
        status: of the last tick.
        saturated: joints whose limit restricts the motion.
        closure: largest loop residual, rad or characteristic lengths.
        obstruction: what stops it among obstacles; None where nothing does.
        carried: its payload; None for a robot whose links have no masses.
        torques: (actuated,) torques (N m) and forces (N) of the actuated joints that hold it at rest with its payload;
            NaN where none do. None for a robot whose links have no masses.
        locked: names of the joints that are locked.
        described: its tasks of other kinds than frames.
    """

    q: Array
    base: pin.SE3
    tasks: tuple[TaskState, ...]
    status: RobotStatus
    saturated: tuple[str, ...]
    closure: float
    obstruction: Obstruction | None = None
    carried: CarriedMass | None = None
    torques: Array | None = None
    locked: tuple[str, ...] = ()
    described: tuple[DescribedState, ...] = ()


class ObstacleState(Struct, frozen=True):
    """An obstacle.

    Attributes:
        pose: in the session's world (m).
        tasks: its tasks; their targets are in the session's world.
        status: of the last tick.
    """

    pose: pin.SE3
    tasks: tuple[TaskState, ...]
    status: RobotStatus


class SensorReport(Struct, frozen=True):
    """A sensor.

    Attributes:
        id: name in the session.
        state: closed, opening, live, silent, lost or refused.
        message: a sentence for people.
        packets: number of readings since it was started.
        damaged: number of packets that were not valid.
        twist: deflection, -1 to 1; None if it reports none.
        axes: its axes that command x, y, z, rx, ry and rz; None if it sends targets only.
    """

    id: str
    state: SensorState
    message: str
    packets: int
    damaged: int
    twist: Vector6 | None
    axes: str | None


class Settings(Struct, frozen=True):
    """Settings, as `change_settings` sets them.

    Attributes:
        gain: part of an error that is corrected per second, 1/s.
        damping: singular value (dimensionless) below which motion is damped.
        linear_speed: of a sensor at full deflection, m/s.
        angular_speed: of a sensor at full deflection, rad/s.
        frame: command frame of the sensors.
    """

    gain: float
    damping: float
    linear_speed: float
    angular_speed: float
    frame: CommandFrame


class Notice(Struct, frozen=True):
    """A message for people, which is shown once.

    Attributes:
        number: counted from 1.
        text: a sentence.
        warning: whether something is wrong.
    """

    number: int
    text: str
    warning: bool


class WaypointInfo(Struct, frozen=True):
    """A waypoint: configurations of all robots, saved under a name.

    Attributes:
        id: number of the waypoint in the session.
        name: name for people.
    """

    id: int
    name: str


class RecordingStatus(Struct, frozen=True):
    """A recording that is being made.

    Attributes:
        file: path of the file.
        seconds: duration so far, s.
        error: reason why nothing more can be written; null while it can.
    """

    file: str
    seconds: float
    error: str | None


class PlaybackStatus(Struct, frozen=True):
    """A recording that is replayed.

    Attributes:
        file: path of the file.
        seconds: duration, s.
        time: playback position, s.
        playing: whether it plays.
        speed: playback speed; 1 is real time.
    """

    file: str
    seconds: float
    time: float
    playing: bool
    speed: float


class SessionInfo(Struct, frozen=True, kw_only=True):
    """A session, apart from its robots and obstacles.

    Attributes:
        sensors: all sensors.
        settings: settings of the solvers and sensors.
        undo: number of undo steps.
        redo: number of steps that can be redone.
        paused: whether the session is paused.
        moving: home, move_to, waypoint, undo, redo or joints during such a motion; None: tasks move the robots.
        recording: recording that is being made, or None.
        playback: recording that is replayed, or None.
        compiled: whether solvers run as machine code; False while their kernels are interpreted, see `cinegen compile`.
        waypoints: saved configurations, in the order in which they are played.
        waypoint: id of the waypoint that the robots move to, or None.
    """

    sensors: tuple[SensorReport, ...]
    settings: Settings
    undo: int
    redo: int
    paused: bool
    moving: str | None
    recording: RecordingStatus | None
    playback: PlaybackStatus | None
    compiled: bool = True
    waypoints: tuple[WaypointInfo, ...] = ()
    waypoint: int | None = None


class SessionState(SessionInfo, frozen=True, kw_only=True):
    """A session at a moment.

    Attributes:
        time: time since the session began, s.
        robots: robots by name.
        obstacles: obstacles by name.
        switches: sensor that each node follows, by robot and node; None: no sensor.
        notices: the last few notices.
        answered: number of commands that were carried out.
        at_rest: whether nothing has moved, and no command has come, for a second.
        edition: number of the setup whose robots these are: 0 at first, see `SessionRunner.exchange`.
        refused: number of a setup that the session could not take, and why; None if it took the last one.
    """

    time: float
    robots: dict[str, RobotState]
    obstacles: dict[str, ObstacleState]
    switches: dict[tuple[str, str], str | None]
    notices: tuple[Notice, ...]
    answered: int
    at_rest: bool = False
    edition: int = 0
    refused: tuple[int, str] | None = None
