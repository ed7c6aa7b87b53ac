"""Commands that the page and programs send to a session, as typed messages: this module is the schema.

A command is a JSON object with a `type`, at most `LONGEST` characters long:

    {"type": "start_drag", "robot": "delta4", "node": "link5", "point": [0, 0, 0.1]}
    {"type": "move_drag", "position": [0, 0, -1.8]}

Unknown fields, missing fields, values of another type and values out of range are refused with a message that names the
field. The table in `docs/reference/protocol.md` is generated from the classes here by `docs/protocols.py`.
"""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from cinegen.ik.tasks.described import AnyDescription
from cinegen.session.message_types import (
    CommandFrame,
    Coordinate,
    Name,
    Pointer,
    Position,
    Priority,
    Quaternion,
    TaskId,
    TypedMessage,
    WaypointId,
    Weight,
    normalize,
    set_field,
)
from cinegen.typed_json import Button, DoF, Vector6
from raff2urdf.axes import parse_axes
from raff2urdf.errors import RaffError


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
            normalize(self, self.quaternion)


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
        normalize(self, self.quaternion)


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
        set_field(self, "twist", tuple(min(1.0, max(-1.0, value)) for value in self.twist))


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
