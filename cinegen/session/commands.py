"""What people and programs may ask of a session: each a value, read from JSON and checked before it is obeyed.

A message is one JSON object with one of the names in `KINDS`, at most `LONGEST` characters:

    {"take": {"robot": "delta4", "node": "link5", "point": [x, y, z]}}   the point as seen from the node, m
    {"lead": [x, y, z]}                                                  where that should be in the world, m

`docs/cockpit.md` lists them all.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, NoReturn

from cinegen.session.errors import CommandError
from cinegen.session.setup import Setup

LONGEST = 2000
"""Characters of a message."""

FURTHEST = 1e6
"""m or rad: nothing is further away."""

FRAMES = ("world", "base", "tool", "view")
"""Frames of command: in whose axes a sensor's deflection moves what it holds."""

Point = tuple[float, float, float]
Numbers = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Take:
    """The hand takes a node: a point of it (m, as seen from it), or the node itself, with its turns or without."""

    robot: str
    node: str
    point: Point | None
    turn: bool


@dataclass(frozen=True, slots=True)
class Lead:
    """Where what the hand holds should be, in the world: a point (m), or a pose (m and a quaternion x y z w)."""

    to: Numbers


@dataclass(frozen=True, slots=True)
class LetGo:
    """The hand lets go; what it held stays pinned where it should be, or is free."""

    pin: bool


@dataclass(frozen=True, slots=True)
class Pin:
    """A node is held where it is."""

    robot: str
    node: str


@dataclass(frozen=True, slots=True)
class Release:
    """A task ends."""

    task: int


@dataclass(frozen=True, slots=True)
class Weigh:
    """A task's weight."""

    task: int
    weight: float


@dataclass(frozen=True, slots=True)
class Holds:
    """How many translations and rotations a task holds, 0 to 3."""

    task: int
    translation: int
    rotation: int


@dataclass(frozen=True, slots=True)
class MoveJoint:
    """A motor goes to a value, rad or m; all that no task could hold follows."""

    robot: str
    joint: str
    value: float


@dataclass(frozen=True, slots=True)
class EndJoint:
    """Whoever moved motors has let go of them."""


@dataclass(frozen=True, slots=True)
class Home:
    """A robot goes home; all if None."""

    robot: str | None


@dataclass(frozen=True, slots=True)
class Visit:
    """A robot goes to a configuration (nq,), loops closed, its node straight ahead."""

    robot: str
    node: str
    q: Numbers


@dataclass(frozen=True, slots=True)
class Undo:
    """The last gesture is undone."""


@dataclass(frozen=True, slots=True)
class Redo:
    """What was undone last is done again."""


@dataclass(frozen=True, slots=True)
class Pause:
    """Everything stands still, or goes on."""

    on: bool


@dataclass(frozen=True, slots=True)
class Choose:
    """A sensor holds a node; None: it is free."""

    robot: str
    node: str
    sensor: str | None


@dataclass(frozen=True, slots=True)
class Frame:
    """The frame of command: one of `FRAMES`."""

    name: str


@dataclass(frozen=True, slots=True)
class View:
    """How the view is turned in the world: a quaternion x y z w of axes to the right, up and towards the viewer."""

    quaternion: Numbers


@dataclass(frozen=True, slots=True)
class Set:
    """A setting: gain (1/s), damping (a singular value), speed (m/s) or turning (rad/s)."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class Record:
    """A recording begins, or ends."""

    on: bool


@dataclass(frozen=True, slots=True)
class Gamepad:
    """What a browser's gamepad says."""

    twist: Numbers
    buttons: frozenset[int]


@dataclass(frozen=True, slots=True)
class Play:
    """The replay goes on, or stops."""

    on: bool


@dataclass(frozen=True, slots=True)
class Seek:
    """The replay goes to a time, s."""

    time: float


@dataclass(frozen=True, slots=True)
class Tempo:
    """How fast the replay runs; 1 is as it was."""

    factor: float


Command = (
    Take | Lead | LetGo | Pin | Release | Weigh | Holds | MoveJoint | EndJoint | Home | Visit | Undo | Redo | Pause
    | Choose | Frame | View | Set | Record | Gamepad | Play | Seek | Tempo
)  # fmt: skip

SETTINGS: Mapping[str, tuple[float, float]] = {
    "gain": (1.0, 1000.0),
    "damping": (1e-3, 0.3),
    "speed": (0.0, 100.0),
    "turning": (0.0, 100.0),
}
"""What may be set, and from where to where."""


@dataclass(frozen=True)
class Vocabulary:
    """The names that commands may use.

    Attributes:
        nodes: of each robot.
        motors: of each robot.
        choices: sensors by robot and node; None stands for none of them.
    """

    nodes: Mapping[str, Collection[str]]
    motors: Mapping[str, Collection[str]] = field(default_factory=dict)
    choices: Mapping[tuple[str, str], Collection[str | None]] = field(default_factory=dict)

    @classmethod
    def of(cls, setup: Setup) -> Vocabulary:
        """That of a session."""
        return cls(
            {name: frozenset(mechanism.nodes) for name, mechanism in setup.robots.items()},
            {name: frozenset(mechanism.actuated) for name, mechanism in setup.robots.items()},
            {(switch.robot, switch.node): frozenset(switch.choices) for switch in setup.switches},
        )


def read(message: str | bytes) -> dict[str, Any]:
    """A message as an object with one name.

    Raises:
        CommandError: it is none.
    """
    if not isinstance(message, str):
        raise CommandError("a message is text")
    if len(message) > LONGEST:
        raise CommandError(f"a message has {LONGEST} characters at most")
    try:
        said = json.loads(message, parse_constant=_no_number)
    except (ValueError, RecursionError):
        raise CommandError("a message is JSON") from None
    if not isinstance(said, dict) or len(said) != 1:
        raise CommandError("a message is an object with one name")
    return said


def parse(said: Mapping[str, Any], known: Vocabulary) -> Command:
    """The command that an object says.

    Raises:
        CommandError: it says none, or one that makes no sense here.
    """
    ((kind, value),) = said.items()
    reader = KINDS.get(kind)
    if reader is None:
        raise CommandError(f"nothing is called '{kind[:40]}'")
    return reader(value, known)


# --- what each says ----------------------------------------------------------------------------------------------


def _take(value: Any, known: Vocabulary) -> Take:
    entry = _object(value, {"robot", "node", "point", "turn"})
    robot, node = _node(entry, known)
    if "point" in entry:
        x, y, z = _numbers(entry["point"], 3, "a point")
        return Take(robot, node, (x, y, z), False)
    return Take(robot, node, None, _flag(entry.get("turn"), "turn"))


def _lead(value: Any, known: Vocabulary) -> Lead:
    if isinstance(value, list) and len(value) == 7:
        return Lead((*_numbers(value[:3], 3, "a point"), *_quaternion(value[3:])))
    return Lead(_numbers(value, 3, "where to lead"))


def _let_go(value: Any, known: Vocabulary) -> LetGo:
    if value is not True and value != "pin":
        raise CommandError("'let go' is true, or 'pin'")
    return LetGo(value == "pin")


def _pin(value: Any, known: Vocabulary) -> Pin:
    return Pin(*_node(_object(value, {"robot", "node"}), known))


def _release(value: Any, known: Vocabulary) -> Release:
    return Release(_count(value, "a task"))


def _weigh(value: Any, known: Vocabulary) -> Weigh:
    task, weight = _pair(value, 2)
    return Weigh(_count(task, "a task"), _within(weight, 0.01, 100.0, "a weight"))


def _holds(value: Any, known: Vocabulary) -> Holds:
    task, translation, rotation = _pair(value, 3)
    counts = [_count(count, "a number of freedoms") for count in (translation, rotation)]
    if max(counts) > 3:
        raise CommandError("a task holds 0 to 3 translations and rotations")
    return Holds(_count(task, "a task"), *counts)


def _joint(value: Any, known: Vocabulary) -> MoveJoint | EndJoint:
    if value is None:
        return EndJoint()
    entry = _object(value, {"robot", "joint", "value"})
    robot, joint = entry.get("robot"), entry.get("joint")
    if not isinstance(robot, str) or robot not in known.motors:
        raise CommandError("there is no such robot")
    if not isinstance(joint, str) or joint not in known.motors[robot]:
        raise CommandError("there is no such motor")
    return MoveJoint(robot, joint, _within(entry.get("value"), -FURTHEST, FURTHEST, "a joint's value"))


def _home(value: Any, known: Vocabulary) -> Home:
    if value is not None and (not isinstance(value, str) or value not in known.nodes):
        raise CommandError("there is no such robot")
    return Home(value)


def _visit(value: Any, known: Vocabulary) -> Visit:
    entry = _object(value, {"robot", "node", "q"})
    robot, node = _node(entry, known)
    q = entry.get("q")
    return Visit(robot, node, _numbers(q, len(q) if isinstance(q, list) else 1, "a configuration"))


def _choose(value: Any, known: Vocabulary) -> Choose:
    entry = _object(value, {"robot", "node", "sensor"})
    robot, node = _node(entry, known)
    sensor = entry.get("sensor")
    if not isinstance(sensor, str | None) or sensor not in known.choices.get((robot, node), ()):
        raise CommandError("no such sensor may hold this node")
    return Choose(robot, node, sensor)


def _frame(value: Any, known: Vocabulary) -> Frame:
    if value not in FRAMES:
        raise CommandError(f"a frame of command is one of {', '.join(FRAMES)}")
    return Frame(value)


def _view(value: Any, known: Vocabulary) -> View:
    return View(_quaternion(value))


def _setting(name: str) -> Callable[[Any, Vocabulary], Set]:
    low, high = SETTINGS[name]
    return lambda value, known: Set(name, _within(value, low, high, name))


def _gamepad(value: Any, known: Vocabulary) -> Gamepad:
    entry = _object(value, {"twist", "buttons"})
    twist = tuple(min(1.0, max(-1.0, number)) for number in _numbers(entry.get("twist"), 6, "a twist"))
    buttons = entry.get("buttons", [])
    if not isinstance(buttons, list) or not all(type(one) is int and 0 <= one < 64 for one in buttons):
        raise CommandError("buttons are whole numbers from 0 to 63")
    return Gamepad(twist, frozenset(buttons))


def _true(command: Command) -> Callable[[Any, Vocabulary], Command]:
    def reader(value: Any, known: Vocabulary) -> Command:
        if value is not True:
            raise CommandError("write true")
        return command

    return reader


KINDS: Mapping[str, Callable[[Any, Vocabulary], Command]] = {
    "take": _take,
    "lead": _lead,
    "let go": _let_go,
    "pin": _pin,
    "release": _release,
    "weight": _weigh,
    "holds": _holds,
    "joint": _joint,
    "home": _home,
    "visit": _visit,
    "undo": _true(Undo()),
    "redo": _true(Redo()),
    "pause": lambda value, known: Pause(_flag(value, "pause")),
    "switch": _choose,
    "frame": _frame,
    "view": _view,
    **{name: _setting(name) for name in SETTINGS},
    "record": lambda value, known: Record(_flag(value, "record")),
    "gamepad": _gamepad,
    "play": lambda value, known: Play(_flag(value, "play")),
    "seek": lambda value, known: Seek(_within(value, 0.0, 1e9, "a time")),
    "tempo": lambda value, known: Tempo(_within(value, 0.01, 100.0, "a tempo")),
}
"""How each command is read, by the name of its object."""


# --- values ------------------------------------------------------------------------------------------------------


def _no_number(text: str) -> NoReturn:
    raise ValueError(text)


def _object(value: Any, names: Collection[str]) -> dict[str, Any]:
    if not isinstance(value, dict) or not value.keys() <= set(names):
        raise CommandError(f"this is an object of {', '.join(sorted(names))}")
    return value


def _node(entry: Mapping[str, Any], known: Vocabulary) -> tuple[str, str]:
    robot, node = entry.get("robot"), entry.get("node")
    if not isinstance(robot, str) or robot not in known.nodes:
        raise CommandError("there is no such robot")
    if not isinstance(node, str) or node not in known.nodes[robot]:
        raise CommandError("there is no such part")
    return robot, node


def _pair(value: Any, count: int) -> list[Any]:
    if not isinstance(value, list) or len(value) != count:
        raise CommandError(f"this is a list of {count}")
    return value


def _flag(value: Any, name: str) -> bool:
    if not isinstance(value, bool):
        raise CommandError(f"{name} is true or false")
    return value


def _count(value: Any, name: str) -> int:
    if type(value) is not int or not 0 <= value < 1 << 53:
        raise CommandError(f"{name} is a whole number")
    return value


def _within(value: Any, low: float, high: float, name: str) -> float:
    if type(value) not in (int, float) or not low <= value <= high:
        raise CommandError(f"{name} is a number from {low:g} to {high:g}")
    return float(value)


def _numbers(value: Any, count: int, name: str) -> Numbers:
    good = isinstance(value, list) and len(value) == count and all(type(x) in (int, float) for x in value)
    if not good or not all(-FURTHEST <= x <= FURTHEST for x in value):
        raise CommandError(f"{name} is {count} numbers, not beyond {FURTHEST:g}")
    return tuple(map(float, value))


def _quaternion(value: Any) -> Numbers:
    numbers = _numbers(value, 4, "a quaternion")
    length = math.sqrt(sum(x * x for x in numbers))
    if not 0.9 < length < 1.1:
        raise CommandError("a quaternion x y z w has length 1")
    return tuple(x / length for x in numbers)
