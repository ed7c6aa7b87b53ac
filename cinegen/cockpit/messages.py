"""Messages between the server and the page: this module and `cinegen.session.commands` are the schema.

`docs/protocols.py` generates the tables of `docs/reference/protocol.md` and the types in `static/base/messages.d.ts`
from them. A pose is x y z (m) and a quaternion x y z w. Numbers that are not finite are null.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import UNSET, Meta, Struct, UnsetType

from cinegen.model.description import CouplingDescription, JointDescription, LoopDescription
from cinegen.session.commands import Command
from cinegen.session.message_types import CommandFrame, Name, Position, TypedMessage
from cinegen.session.report import RobotReport
from cinegen.session.setup import SensorSwitch
from cinegen.session.state import DescribedState, Obstruction, PlaybackStatus, RobotStatus, SessionInfo, TaskInfo
from cinegen.typed_json import Vector7

PROTOCOL = 6


UserColour = Annotated[int, Meta(ge=0, le=7)]


class Ack(TypedMessage, frozen=True):
    """Acknowledge a state: the next is sent only then.

    Attributes:
        frame: number of the state.
    """

    frame: int


class RequestControl(TypedMessage, frozen=True):
    """Take control from the client that has it, or give it back.

    Attributes:
        on: whether to take control.
    """

    on: bool


class RequestReactions(TypedMessage, frozen=True):
    """Ask for the reactions in joints and loops, or no longer. Reports have them as long as some client asks.

    Attributes:
        on: whether to send them.
    """

    on: bool


class RequestRate(TypedMessage, frozen=True):
    """Ask for a rate of states, as a headset needs. All clients get the highest rate that one of them asks for.

    Attributes:
        rate: states per second (Hz); null: 60.
    """

    rate: Annotated[float, Meta(ge=60.0, le=120.0)] | None = None


class SetUser(TypedMessage, frozen=True):
    """Set the name and colour under which other users see this one.

    Attributes:
        name: name for people.
        colour: number of a colour, 0 to 7.
    """

    name: Name
    colour: UserColour


class SetCursor(TypedMessage, frozen=True):
    """Set the part at which the pointer is, for other users.

    Attributes:
        robot: robot or obstacle; null: the pointer is at no part.
        node: node of it; null only if the robot is.
        point: point at which the pointer is, in the node's frame (m).
        dragging: whether the part is dragged.
    """

    robot: str | None = None
    node: str | None = None
    point: Position = (0.0, 0.0, 0.0)
    dragging: bool = False


ClientMessage = Ack | RequestControl | RequestReactions | RequestRate | SetUser | SetCursor | Command
CLIENT_MESSAGES: msgspec.json.Decoder[ClientMessage] = msgspec.json.Decoder(ClientMessage)


class NodeDescription(Struct, frozen=True):
    """A node of a robot.

    Attributes:
        name: name of the node.
        parent: its parent; null for the base.
        joint: joint that moves it relative to its parent; null if it is fixed there.
        kind: base, link or frame.
        placement: pose in its parent, or in the robot's base pose if it has none; null if a joint moves it.
        axis: axis of that joint in the node's frame; null without one.
    """

    name: str
    parent: str | None
    joint: str | None
    kind: Literal["base", "link", "frame"]
    placement: Vector7 | None = None
    axis: tuple[float, float, float] | None = None


class ForcesDescription(Struct, frozen=True):
    """Data about the forces in a robot.

    Attributes:
        missing: reason why there are no torques and reactions: links without mass, for example; empty if there are.
        largest_payload: largest mass (kg) that the page offers: that of the robot's moving links, rounded up to 1, 2 or
            5 times a power of ten.
        excluded: robots that it carries, whose weight is not counted.
    """

    missing: str
    largest_payload: float
    excluded: tuple[str, ...]


class RobotDescription(Struct, frozen=True):
    """A robot.

    Attributes:
        name: name in the session.
        robot: its own name.
        length: characteristic length (m).
        mobility: number of degrees of freedom.
        end: its end.
        base: robot and node that carry it, or null.
        nodes: its nodes.
        joints: its joints.
        loops: its loops.
        couplings: equations between its joints.
        forces: data about the forces in it.
        root: joint of its floating base, which can be locked, or null.
        lost: a sentence about its meshes that can't be found; empty without one.
    """

    name: str
    robot: str
    length: float
    mobility: int
    end: str
    base: tuple[str, str] | None
    nodes: tuple[NodeDescription, ...]
    joints: tuple[JointDescription, ...]
    loops: tuple[LoopDescription, ...]
    couplings: tuple[CouplingDescription, ...]
    forces: ForcesDescription
    root: str | None = None
    lost: str = ""


class ObstacleDescription(Struct, frozen=True):
    """An obstacle; in commands and tasks, it is a robot whose only node has its name.

    Attributes:
        name: name in the session.
        length: size of marks on it (m): the characteristic length of the largest robot.
        mobility: number of degrees of freedom; 0 if it can't be moved.
    """

    name: str
    length: float
    mobility: int


class SensorDescription(Struct, frozen=True):
    """A sensor.

    Attributes:
        id: name in the session.
        url: its address.
        kind: description for people.
    """

    id: str
    url: str
    kind: str | None


class HelloMessage(TypedMessage, frozen=True):
    """The first message to a client.

    Attributes:
        protocol: version of the protocol.
        client: number of the client.
        title: title of the page.
        robots: robots.
        obstacles: obstacles.
        sensors: sensors.
        switches: nodes that may follow sensors.
        frames: command frames.
        playback: recording that is replayed, or null.
        stops: times of it (s) to jump to, each with a name.
        map: robot with which a map is drawn, or null.
        caption: text over a replay; may be empty.
        view_only: whether the client only views: its commands are refused.
        view_token: token of addresses that only view, for clients that may drive; null without tokens.
    """

    protocol: int
    client: int
    title: str
    robots: tuple[RobotDescription, ...]
    obstacles: tuple[ObstacleDescription, ...]
    sensors: tuple[SensorDescription, ...]
    switches: tuple[SensorSwitch, ...]
    frames: tuple[CommandFrame, ...]
    playback: PlaybackStatus | None
    stops: tuple[tuple[float, str], ...]
    map: str | None
    caption: str = ""
    view_only: bool = False
    view_token: str | None = None


class TaskMessage(TaskInfo, frozen=True, kw_only=True):
    """A task, also with the fields of a `TaskInfo`.

    Attributes:
        robot: its robot or obstacle.
        position: of the constrained frame, in the world (m).
        target: of that frame, in the world.
    """

    robot: str
    position: list[float]
    target: Vector7


class DescribedMessage(DescribedState, frozen=True, kw_only=True):
    """A task of a kind, also with the fields of a `DescribedState`.

    Attributes:
        robot: its robot.
    """

    robot: str


class NodeSensor(Struct, frozen=True):
    """The sensor that a node follows.

    Attributes:
        robot: robot of the node.
        node: node that follows.
        sensor: id of the sensor; null: no sensor.
    """

    robot: str
    node: str
    sensor: str | None


class TickRate(Struct, frozen=True):
    """Timing of the session's ticks.

    Attributes:
        ticks: ticks in the last second.
        missed: deadlines in the last second at which there was no tick.
        missed_in_all: the same since the session began.
        late: delay (ms) that 99 % of all ticks since then don't exceed.
        at_rest: whether nothing moves, so that few ticks are needed.
    """

    ticks: float
    missed: int
    missed_in_all: int
    late: float
    at_rest: bool


class ReportMessage(SessionInfo, frozen=True, kw_only=True):
    """A report, about ten times per second, also with the fields of a `SessionInfo`.

    Attributes:
        robots: robots by name.
        switches: sensor that each node follows.
        rate: timing of the ticks.
        clients: number of clients.
        compilation: fraction of the kernels that are compiled, 0 to 1; only while solvers are interpreted, else null.
    """

    robots: dict[str, RobotReport]
    switches: tuple[NodeSensor, ...]
    rate: TickRate
    clients: int
    compilation: float | None = None


class UserInfo(Struct, frozen=True):
    """A user: a client that has set a name.

    Attributes:
        client: number of the client.
        name: name for people.
        colour: number of a colour, 0 to 7.
        robot: robot or obstacle at which the pointer is; null: at none.
        node: node of it; null only if the robot is.
        point: point at which the pointer is, in the node's frame (m).
        dragging: whether the part is dragged.
    """

    client: int
    name: str
    colour: UserColour
    robot: str | None = None
    node: str | None = None
    point: Position = (0.0, 0.0, 0.0)
    dragging: bool = False


class StateMessage(TypedMessage, frozen=True):
    """The newest state, at most 60 times per second, or as `request_rate` asks; sent only when the one before was
    acknowledged. A session at rest has four per second.

    Attributes:
        time: time since the session began, s.
        poses: poses of each robot, seven numbers each: its base pose in the world, then each of its nodes relative to
            that, in the order of the description.
        obstacles: pose of each obstacle in the world.
        tasks: tasks of all robots and obstacles.
        statuses: status of each robot and obstacle.
        obstructions: what stops robots among obstacles, by robot; only of those that something stops.
        torques: torques (N m) and forces (N) of the actuated joints that hold each robot at rest with its payload, in
            the order of the description, by robot; null where none do. Only of robots whose links have masses.
        frame: number of the state.
        controller: number of the client that has control, or null.
        report: in some of the states.
        users: all users; only when they, or their pointers, have changed, at most ten times per second.
        described: tasks of all robots of other kinds than frames.
    """

    time: float
    poses: dict[str, list[float]]
    obstacles: dict[str, Vector7]
    tasks: tuple[TaskMessage, ...]
    statuses: dict[str, RobotStatus]
    obstructions: dict[str, Obstruction]
    torques: dict[str, list[float | None]]
    frame: int = 0
    controller: int | None = None
    report: ReportMessage | UnsetType = UNSET
    users: tuple[UserInfo, ...] | UnsetType = UNSET
    described: tuple[DescribedMessage, ...] = ()


class NoticeMessage(TypedMessage, frozen=True):
    """A message for people.

    Attributes:
        text: a sentence.
        level: info or warning.
    """

    text: str
    level: Literal["info", "warning"]


class ProblemMessage(TypedMessage, frozen=True):
    """State what is wrong with the robots' files, which were saved; the robots as they were read before stay.

    Attributes:
        text: every error with its file, line and column where they are known; empty if nothing is wrong any more.
    """

    text: str


ServerMessage = HelloMessage | StateMessage | NoticeMessage | ProblemMessage
