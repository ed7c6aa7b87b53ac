"""Commands that the page and programs send to a session, as typed messages: this module is the schema.

A command is a JSON object with a `type`, at most `LONGEST` characters long:

    {"type": "start_drag", "robot": "delta4", "node": "link5", "point": [0, 0, 0.1]}
    {"type": "move_drag", "position": [0, 0, -1.8]}

Unknown fields, missing fields, values of another type and values out of range are refused with a message that names the
field. The table in `docs/reference/protocol.md` is generated from the classes here by `docs/protocols.py`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from typing import Annotated, Any, Literal, TypeVar

import msgspec
from msgspec import Meta, Struct

from cinegen.errors import CinegenError
from cinegen.ik.described import AnyDescription, unknown_name
from cinegen.ik.joints import names_of
from cinegen.model import Mechanism
from cinegen.session.setup import Setup
from cinegen.typed_json import Button, DoF, Vector4, Vector6
from raff2urdf.axes import parse_axes
from raff2urdf.errors import RaffError

LONGEST = 2000
"""Characters of a message."""

Coordinate = Annotated[float, Meta(ge=-1e6, le=1e6)]
Position = tuple[Coordinate, Coordinate, Coordinate]
Quaternion = Vector4
Weight = Annotated[float, Meta(ge=0.01, le=100.0)]
Priority = Annotated[int, Meta(ge=0, le=9)]
Pointer = Annotated[int, Meta(ge=0, le=9)]
TaskId = Annotated[int, Meta(ge=0, lt=1 << 53)]
WaypointId = TaskId

Name = Annotated[
    str, Meta(min_length=1, max_length=40, pattern=r"^[^\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]*$")
]
"""A name that people choose: no control characters, none that reverse the direction of text."""

CommandFrame = Literal["world", "base", "tool", "view"]
"""Frame in whose axes a sensor's deflection moves a node."""

_Message = TypeVar("_Message")


class CommandError(CinegenError):
    """A command is malformed or refers to something that does not exist. The sender is disconnected."""


def snake_case(name: str) -> str:
    """Return the `type` of a message of a class: "start_drag" of `StartDrag`, "state" of `StateMessage`."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name.removesuffix("Message")).lower()


class TypedMessage(Struct, frozen=True, forbid_unknown_fields=True, tag_field="type", tag=snake_case):
    """A message with a `type`, which accepts no other fields than its own."""


class StartDrag(TypedMessage, frozen=True):
    """Start to drag a node; each pointer drags one at a time.

    Attributes:
        robot: robot or obstacle.
        node: node of it.
        point: point to drag, in the node's frame (m); the node rotates freely about it. Null: the node's origin.
        rotation: whether the drag commands the node's orientation too; for `point` null.
        pointer: pointer that drags: a mouse is 0, the hands of a headset are 0 and 1.
    """

    robot: str
    node: str
    point: Position | None = None
    rotation: bool = False
    pointer: Pointer = 0


class MoveDrag(TypedMessage, frozen=True):
    """Set the target of what is dragged.

    Attributes:
        position: in the world (m).
        quaternion: orientation in the world, x y z w; null: the orientation at the start.
        weight: of the task's equations; null: it stays.
        pointer: pointer that drags.
    """

    position: Position
    quaternion: Quaternion | None = None
    weight: Weight | None = None
    pointer: Pointer = 0

    def __post_init__(self) -> None:
        if self.quaternion is not None:
            _normalize(self, self.quaternion)


class EndDrag(TypedMessage, frozen=True):
    """End the drag.

    Attributes:
        pin: whether a pin keeps the node at the target.
        pointer: pointer whose drag ends; null: all drags end.
    """

    pin: bool = False
    pointer: Pointer | None = None


class Pin(TypedMessage, frozen=True):
    """Add a task that keeps a node at its present pose.

    Attributes:
        robot: robot or obstacle.
        node: node of it.
    """

    robot: str
    node: str


class AddTask(TypedMessage, frozen=True):
    """Add a task of a kind, such as a part that stays upright, or two that stay together.

    Attributes:
        robot: robot.
        description: its kind, with the parameters of that.
    """

    robot: str
    description: AnyDescription


class RemoveTask(TypedMessage, frozen=True):
    """Remove a task: end the drag, remove the pin or the task of a kind, or disconnect the sensor.

    Attributes:
        task: its id.
    """

    task: TaskId


class ChangeTask(TypedMessage, frozen=True):
    """Change a task; what is null stays.

    Attributes:
        task: its id.
        translation: number of translations that it constrains.
        rotation: number of rotations that it constrains.
        weight: of its equations.
        priority: 0 is served first.
        description: what the task of a kind becomes.
    """

    task: TaskId
    translation: DoF | None = None
    rotation: DoF | None = None
    weight: Weight | None = None
    priority: Priority | None = None
    description: AnyDescription | None = None


class MoveJoint(TypedMessage, frozen=True):
    """Move an actuated joint; the others keep their values, passive joints follow.

    Attributes:
        robot: robot.
        joint: actuated joint of it.
        value: position to move to, rad or m.
    """

    robot: str
    joint: str
    value: Coordinate


class LockJoint(TypedMessage, frozen=True):
    """Lock a joint, so that nothing moves it, or unlock it.

    Attributes:
        robot: robot.
        joint: joint of it, a ball joint, or "base", its floating base.
        locked: whether it is locked.
    """

    robot: str
    joint: str
    locked: bool


class EndJointMotion(TypedMessage, frozen=True):
    """End the motion of joints: the slider was released."""


class MoveHome(TypedMessage, frozen=True):
    """Move a robot to where it began.

    Attributes:
        robot: robot or obstacle; null: all robots.
    """

    robot: str | None = None


class MoveTo(TypedMessage, frozen=True):
    """Move a robot to a configuration, a node along a straight line.

    Attributes:
        robot: robot.
        node: node that moves along a straight line.
        q: (nq,) configuration with closed loops, rad and m.
    """

    robot: str
    node: str
    q: tuple[Coordinate, ...]


class SaveWaypoint(TypedMessage, frozen=True):
    """Save the present configurations of all robots as the last waypoint.

    Attributes:
        name: name for people.
    """

    name: Name


class ChangeWaypoint(TypedMessage, frozen=True):
    """Change a waypoint; what is null stays.

    Attributes:
        waypoint: its id.
        name: name for people.
        index: new index in the list, from 0; an index beyond the last one is the last.
    """

    waypoint: WaypointId
    name: Name | None = None
    index: Annotated[int, Meta(ge=0, le=1000)] | None = None


class RemoveWaypoint(TypedMessage, frozen=True):
    """Remove a waypoint.

    Attributes:
        waypoint: its id.
    """

    waypoint: WaypointId


class MoveToWaypoint(TypedMessage, frozen=True):
    """Move all robots to a waypoint: actuated joints are interpolated, passive joints follow.

    Attributes:
        waypoint: its id.
    """

    waypoint: WaypointId


class PlayWaypoints(TypedMessage, frozen=True):
    """Move all robots through all waypoints in their order, or stop that.

    Attributes:
        on: whether to play.
        record: whether the motion from the first waypoint to the last is recorded.
    """

    on: bool
    record: bool = False


class Undo(TypedMessage, frozen=True):
    """Undo the last undo step."""


class Redo(TypedMessage, frozen=True):
    """Redo what was undone last."""


class Pause(TypedMessage, frozen=True):
    """Pause or resume all motion.

    Attributes:
        on: whether to pause.
    """

    on: bool


class SelectSensor(TypedMessage, frozen=True):
    """Let a node follow a sensor.

    Attributes:
        robot: robot of the node.
        node: node that may follow sensors.
        sensor: one of those that it may follow, where null is among them: no sensor.
    """

    robot: str
    node: str
    sensor: str | None


class ChangeSensor(TypedMessage, frozen=True):
    """Change the axes of a sensor.

    Attributes:
        sensor: sensor that sends deflections.
        axes: its axes that command x, y, z, rx, ry and rz of a node, such as `x, -z, y, rx, -rz, 0.5*ry`.
    """

    sensor: str
    axes: str

    def __post_init__(self) -> None:
        try:
            parse_axes(self.axes)
        except RaffError as error:
            raise ValueError(f"{error.problems[0].message} - at `$.axes`") from None


class ChangeSettings(TypedMessage, frozen=True):
    """Change settings; what is null stays.

    Attributes:
        gain: part of an error that is corrected per second, 1/s.
        damping: singular value (dimensionless) below which motion is damped.
        linear_speed: of a sensor at full deflection, m/s.
        angular_speed: of a sensor at full deflection, rad/s.
        frame: command frame of the sensors.
    """

    gain: Annotated[float, Meta(ge=1.0, le=1000.0)] | None = None
    damping: Annotated[float, Meta(ge=1e-3, le=0.3)] | None = None
    linear_speed: Annotated[float, Meta(ge=0.0, le=100.0)] | None = None
    angular_speed: Annotated[float, Meta(ge=0.0, le=100.0)] | None = None
    frame: CommandFrame | None = None


class SetPayload(TypedMessage, frozen=True):
    """Set what a robot carries. It is a point mass, and changes torques and reactions, not the motion.

    Attributes:
        robot: robot whose links have masses.
        node: node of it, whose origin carries the mass.
        mass: kg; 0: nothing.
    """

    robot: str
    node: str
    mass: Annotated[float, Meta(ge=0.0, le=1e6)]


class SetView(TypedMessage, frozen=True):
    """Set the axes of the command frame `view`.

    Attributes:
        quaternion: orientation of the camera in the world, x y z w: x to the right, y up, z towards the viewer.
    """

    quaternion: Quaternion

    def __post_init__(self) -> None:
        _normalize(self, self.quaternion)


class SetRecording(TypedMessage, frozen=True):
    """Start or stop a recording.

    Attributes:
        on: whether to record.
    """

    on: bool


class GamepadInput(TypedMessage, frozen=True):
    """Report the state of a browser's gamepad; at least ten times a second while it is deflected.

    Attributes:
        twist: deflection, three translations and three rotations; each is clipped to -1 to 1.
        buttons: those that are pressed.
    """

    twist: Vector6
    buttons: frozenset[Button] = frozenset()

    def __post_init__(self) -> None:
        _set(self, "twist", tuple(min(1.0, max(-1.0, value)) for value in self.twist))


class ControlPlayback(TypedMessage, frozen=True):
    """Control the playback of a recording; what is null stays.

    Attributes:
        playing: whether it plays.
        time: position to jump to, s.
        speed: playback speed; 1 is real time.
    """

    playing: bool | None = None
    time: Annotated[float, Meta(ge=0.0, le=1e9)] | None = None
    speed: Annotated[float, Meta(ge=0.01, le=100.0)] | None = None


Command = (
    StartDrag | MoveDrag | EndDrag | Pin | AddTask | RemoveTask | ChangeTask | MoveJoint | LockJoint | EndJointMotion
    | MoveHome | MoveTo
    | SaveWaypoint | ChangeWaypoint | RemoveWaypoint | MoveToWaypoint | PlayWaypoints | Undo | Redo | Pause
    | SelectSensor | ChangeSensor | ChangeSettings | SetPayload | SetView | SetRecording | GamepadInput
    | ControlPlayback
)  # fmt: skip


def check_names(command: TypedMessage, setup: Setup) -> None:
    """Check the names in a command to a session. The only node of an obstacle has its name.

    Raises:
        CommandError: one of them does not exist; the message names the field.
    """
    robot = getattr(command, "robot", None)
    if isinstance(command, ChangeSensor) and command.sensor not in [one.name for one in setup.devices if one.has_axes]:
        raise CommandError(f"Unknown sensor {command.sensor!r:.80} - at `$.sensor`")
    if robot is None:
        return
    if isinstance(command, AddTask):
        _check_described(command, setup)
        return
    mechanism, switch = setup.robots.get(robot), (robot, getattr(command, "node", ""))
    known: dict[str, Collection[str | None]] = {
        "robot": (*setup.robots, *setup.obstacles),
        "node": (robot,) if mechanism is None else mechanism.nodes,
        "joint": () if mechanism is None else _joints_of(command, mechanism),
        "sensor": next((one.choices for one in setup.switches if (one.robot, one.node) == switch), ()),
    }
    for name in command.__struct_fields__:
        value = getattr(command, name)
        if name in known and value not in known[name]:
            raise CommandError(f"Unknown {name} {value!r:.80} - at `$.{name}`")


def _check_described(command: AddTask, setup: Setup) -> None:
    mechanism = setup.robots.get(command.robot)
    if mechanism is None:
        raise CommandError(f"Unknown robot {command.robot!r:.80} - at `$.robot`")
    found = unknown_name(command.description, mechanism.nodes, mechanism.joints)
    if found is not None:
        raise CommandError(f"Unknown {found[0]} {found[1]!r:.80} - at `$.description.{found[2]}`")


def _joints_of(command: TypedMessage, mechanism: Mechanism) -> Collection[str]:
    return (*names_of(mechanism), "base") if isinstance(command, LockJoint) else mechanism.actuated


def decode(message: str | bytes, decoder: msgspec.json.Decoder[_Message]) -> _Message:
    """Decode a message from a browser or a program.

    Raises:
        CommandError: it is no text, too long, no JSON, or doesn't match the schema; the message names the field.
    """
    if not isinstance(message, str):
        raise CommandError("a message must be text, not binary")
    if len(message) > LONGEST:
        raise CommandError(f"a message must not be longer than {LONGEST} characters")
    try:
        return decoder.decode(message)
    except (msgspec.MsgspecError, RecursionError, UnicodeError) as error:
        raise CommandError(str(error)) from None


_COMMANDS: msgspec.json.Decoder[Command] = msgspec.json.Decoder(Command)


def decode_command(message: str | bytes, setup: Setup) -> Command:
    """Decode a command and check the names in it.

    Raises:
        CommandError: see `decode` and `check_names`.
    """
    command = decode(message, _COMMANDS)
    check_names(command, setup)
    return command


def _set(message: Struct, name: str, value: Any) -> None:
    """Set a field of a frozen message while it is constructed."""
    msgspec.structs.force_setattr(message, name, value)


def _normalize(message: Struct, quaternion: Quaternion) -> None:
    length = math.hypot(*quaternion)
    if not 0.9 < length < 1.1:
        raise ValueError(f"Expected a quaternion x y z w of length 1, not {length:.3g} - at `$.quaternion`")
    _set(message, "quaternion", tuple(value / length for value in quaternion))
