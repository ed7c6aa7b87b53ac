"""The syntax of RAFF: its tokens, and for each kind of block a table of the statements that it may hold.

RAFF, the Robot Arm File Format (Flueckiger, Piguet, Baur: "Generic robotic kinematic generator for virtual environment
interfaces", figures 5 and 6, and section 3.1). A file is `RAFF <name>`, and then statements in any order. A statement
is a word and the tokens that follow it, perhaps a block of further statements:

    robot r1 { base { } link 1 { parameters { theta 30 d 400 } type 2 pred 0 limits { -85 80 } } }
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

from raff2urdf.axes import parse_axes
from raff2urdf.errors import RaffError, SourceLocation, did_you_mean
from raff2urdf.raff.document import (
    UNITS_PER_METRE,
    CompoundKind,
    DriveKind,
    JointType,
    LoopKind,
    RaffBase,
    RaffCoupling,
    RaffDrive,
    RaffFrame,
    RaffInertial,
    RaffLink,
    RaffLoop,
    RaffParameters,
    RaffRobot,
    RaffSensor,
    RaffVariable,
    SensorConstraint,
)
from raff2urdf.raff.tokens import Token

# --- tokens -------------------------------------------------------------------------------------------------------


# --- values -------------------------------------------------------------------------------------------------------


Report = Callable[[str, SourceLocation], None]
"""Takes a problem and its location."""


@dataclass(slots=True)
class Block:
    """A block of statements.

    Attributes:
        kind: the word before its brace; empty for the file.
        label: the block, for errors: "link 2".
        line: of its opening brace.
        values: of its statements; a list for statements that may be repeated.
        locations: of the statements.
    """

    kind: str
    label: str
    line: int
    values: dict[str, Any] = field(default_factory=dict)
    locations: dict[str, SourceLocation] = field(default_factory=dict)

    def add(self, report: Report, statement: Statement, word: Token, value: Any, location: SourceLocation) -> None:
        """Add the value of a statement; of statements that may not be repeated, the first counts."""
        name = statement.name or word.text
        if statement.repeats:
            self.values.setdefault(name, []).append(value)
        elif name in self.values:
            first = self.locations[name].line
            report(f"'{word.text}' is given twice in {self.label}, first on line {first}: remove one of them", location)
        else:
            self.values[name], self.locations[name] = value, location

    @property
    def node(self) -> dict[str, Any]:
        """The values of a node: its variables, and the names of all its graphic files, each together."""
        values = dict(self.values)
        if "filenames" in values:
            values["filenames"] = tuple(name for names in values["filenames"] for name in names)
        if "variables" in values:
            values["variables"] = tuple(values["variables"])
        return values


LARGEST_WHOLE = 10**15 - 1
"""Larger numbers, and those that are counted on from them, may not be distinct as doubles."""


def finite(report: Report, token: Token) -> float:
    """Return the number of a token."""
    value = float(token.text)
    if not math.isfinite(value):
        report(f"'{token.text}' is too large for a number: the largest is 1.8e308", token.location)
        return 0.0
    return value


def whole(report: Report, token: Token, least: int = 0) -> int:
    """Return the whole number of a token, from `least` on."""
    value = finite(report, token)
    if value != int(value) or value < least:
        report(f"'{token.text}' must be a whole number from {least}", token.location)
        return least
    if value > LARGEST_WHOLE:
        report(f"'{token.text}' is too large for a whole number: the largest is {LARGEST_WHOLE}", token.location)
        return least
    return int(value)


@dataclass(frozen=True, slots=True)
class Choice:
    """The value of a whole number that stands for one of several words.

    Attributes:
        what: the number is, for errors.
        words: for which 0, 1, ... stand.
        make: returns the value of a number.
    """

    what: str
    words: Sequence[str]
    make: Callable[[int], Any] = int

    @classmethod
    def of(cls, what: str, kinds: type[IntEnum]) -> Choice:
        """Return the choice of a member of an enumeration."""
        return cls(what, [kind.name.lower() for kind in kinds], kinds)

    def __call__(self, report: Report, token: Token) -> Any:
        """Return the value of a token."""
        value = finite(report, token)
        if value != int(value) or not 0 <= value < len(self.words):
            known = ", ".join(f"{i} {word}" for i, word in enumerate(self.words))
            report(f"{self.what} {token.text} is unknown (known: {known})", token.location)
            value = 0
        return self.make(int(value))


def _compound(report: Report, token: Token) -> CompoundKind:
    kinds = [kind.value for kind in CompoundKind]
    if token.text not in kinds:
        report(f"unknown joint '{token.text}'{did_you_mean(token.text, kinds)}", token.location)
        return CompoundKind.BALL
    return CompoundKind(token.text)


def _inertial(_: Report, block: Block, word: Token) -> RaffInertial:
    return RaffInertial(**block.values, locations={**block.locations, "inertial": word.location})


def _variable(_: Report, block: Block, name: Token) -> RaffVariable:
    return RaffVariable(name.text, **block.values, locations={**block.locations, "name": name.location})


def _units(report: Report, token: Token) -> str:
    if token.text not in UNITS_PER_METRE:
        report(f"unknown unit '{token.text}' (known: {', '.join(UNITS_PER_METRE)})", token.location)
    return token.text


def _axes(report: Report, token: Token) -> str:
    try:
        parse_axes(token.string)
    except RaffError as error:
        for problem in error.problems:
            at = problem.location or SourceLocation(1, 1)
            report(problem.message, replace(at, line=token.line, column=token.column + at.column))
    return token.string


def _strings(_: Report, *tokens: Token) -> tuple[str, ...]:
    return tuple(token.string for token in tokens)


def _robot(_: Report, block: Block, name: Token) -> RaffRobot:
    values = block.values
    constraints = values.pop("constraints", [])
    return RaffRobot(
        name=name.string,
        parts=tuple(values.pop("parts", ())),
        loops=tuple(entry for entry in constraints if isinstance(entry, RaffLoop)),
        couplings=tuple(values.pop("couplings", ())),
        sensor_constraints=tuple(entry for entry in constraints if isinstance(entry, SensorConstraint)),
        locations={"name": name.location} | block.locations,
        **values,
    )


def _numbered(kind: Callable[..., Any], **defaults: Any) -> Callable[..., Any]:
    """Return the value of a block with a number, an object of a kind; defaults are for statements that it lacks."""

    def value(report: Report, block: Block, number: Token) -> Any:
        locations = {**block.locations, "number": number.location}
        return kind(**{**defaults, **block.node, "number": whole(report, number, 1), "locations": locations})

    return value


def _constraint(report: Report, block: Block, keyword: Token) -> RaffLoop | SensorConstraint:
    nodes, values, locations = block.values.get("nodes", []), block.values, block.locations
    at = min([*(at for _, at in nodes), *locations.values()], default=keyword.location)
    if "sensor" in values:
        if len(nodes) != 1 or "type" in values:
            report("a constraint with sensors must name one node, and no type", at)
        sensors = {f"sensor {number}": location for number, location in values["sensor"]}
        node = nodes[0] if nodes else (0, at)
        numbers = tuple(number for number, _ in values["sensor"])
        return SensorConstraint(node[0], numbers, locations={**locations, **sensors, "node": node[1]})
    if len(nodes) != 2:
        report("a constraint must name two nodes (a loop), or one node and the sensors that it may follow", at)
        return RaffLoop(0, 0)
    (first, first_at), (second, second_at) = nodes
    kind = values.get("type", LoopKind.RIGID)
    return RaffLoop(first, second, kind, locations={**locations, "first": first_at, "second": second_at})


def _drive(kind: DriveKind) -> Callable[..., tuple[DriveKind, tuple[float, ...], SourceLocation]]:
    def value(report: Report, *tokens: Token) -> tuple[DriveKind, tuple[float, ...], SourceLocation]:
        return kind, tuple(finite(report, token) for token in tokens), tokens[0].location

    return value


_NEEDS_LINKS = "a coupling must name the link that follows, and then those that drive it: link 5 link 3 ratio -2"
_NEEDS_DRIVE = "drives a coupling: state its 'ratio', 'lead', 'radius' or 'polynomial'"


def _coupling(report: Report, block: Block, keyword: Token) -> RaffCoupling:
    parts, locations = block.values.get("parts", []), dict(block.locations)
    numbers: list[tuple[int, SourceLocation]] = []
    drives: list[RaffDrive] = []
    for part in parts:
        if len(part) == 2:  # a link
            if len(numbers) - len(drives) > 1:
                report(f"link {numbers[-1][0]} {_NEEDS_DRIVE}", numbers[-1][1])
                return RaffCoupling(0, ())
            numbers.append(part)
            locations["follower" if len(numbers) == 1 else f"drive {len(numbers) - 2}"] = part[1]
        elif len(numbers) - len(drives) != 2:
            word = part[0].name.lower()
            report(f"'{word}' belongs after a link that drives; the first link of a coupling follows", part[2])
            return RaffCoupling(0, ())
        else:
            drives.append(RaffDrive(numbers[-1][0], *part[:2]))
    if len(numbers) < 2 or len(drives) != len(numbers) - 1:
        at = numbers[-1] if numbers else (0, keyword.location)
        report(f"link {at[0]} {_NEEDS_DRIVE}" if len(numbers) > 1 else _NEEDS_LINKS, at[1])
        return RaffCoupling(0, ())
    values = {word: block.values[word] for word in ("offset", "name") if word in block.values}
    return RaffCoupling(numbers[0][0], tuple(drives), **values, locations=locations)


# --- statements ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Statement:
    """A word of a block, and what follows it.

    Attributes:
        follows: tokens: NUMBER, STRING, WORD, NAME (WORD or STRING), braces and parentheses; `+` and `*` repeat. A
            brace at the end opens a block of the same name as the word.
        value: returns the value of the tokens, braces and parentheses left out, as `value(report, *tokens)`;
            of a block, `value(report, block, *tokens)`, with the word itself if no other token precedes the brace.
        name: of the value; the word itself if empty.
        repeats: whether the statement may be repeated.
        required: what its word means, if the block must have it.
        unless: name of the value that makes it not required.
    """

    follows: str
    value: Callable[..., Any]
    name: str = ""
    repeats: bool = False
    required: str | None = None
    unless: str = ""


_NUMBER = Statement("NUMBER", finite)
_TEXT = Statement("STRING", lambda _, token: token.string)
_PARAMETERS = Statement("{", lambda _, block, __: RaffParameters(**block.values))
_FILES = Statement("{ STRING* }", _strings, "filenames", repeats=True)
_PRED = Statement("NUMBER", whole, required=": the number of its parent (0: the base)")
_NODE = Statement("NUMBER", lambda report, number: (whole(report, number), number.location), "nodes", repeats=True)
_JOINT_TYPES = " (0 fixed, 1 prismatic, 2 revolute)"
_LIMITS = Statement("{ NUMBER NUMBER }", lambda report, *ends: tuple(finite(report, end) for end in ends))
_VECTOR = Statement("{ NUMBER NUMBER NUMBER }", lambda report, *xyz: tuple(finite(report, x) for x in xyz))
_INERTIAL = Statement("{", _inertial)
_ACTUATED = Statement("NUMBER", Choice("'actuated'", ["passive", "actuated"], bool))
_DEFAULTS: dict[str, Any] = {"parameters": RaffParameters(), "pred": 0}
_DOF = ["none", "one", "two", "three"]

STATEMENTS: dict[str, dict[str, Statement]] = {
    "": {
        "robot": Statement("NAME {", _robot, "robots", repeats=True),
        "sensor": Statement("NUMBER {", _numbered(RaffSensor, port=""), "sensors", repeats=True),
        "units": Statement("WORD", _units),  # mm (default), um, cm or m
        "gravity": _VECTOR,  # x y z in the world, m/s2
    },
    "robot": {
        "path": _TEXT,  # the folder of the graphic files
        "base": Statement("{", lambda _, block, __: RaffBase(**block.node, locations=block.locations)),
        "link": Statement("NUMBER {", _numbered(RaffLink, type=JointType.FIXED, **_DEFAULTS), "parts", repeats=True),
        "frame": Statement("NUMBER {", _numbered(RaffFrame, **_DEFAULTS), "parts", repeats=True),
        "constraint": Statement("{", _constraint, "constraints", repeats=True),
        "coupling": Statement("{", _coupling, "couplings", repeats=True),
    },
    "base": {"parameters": _PARAMETERS, "filename": _FILES, "inertial": _INERTIAL},
    "link": {
        "parameters": _PARAMETERS,
        "type": Statement("NUMBER", Choice.of("joint type", JointType), required=_JOINT_TYPES, unless="compound"),
        "joint": Statement("WORD", _compound, "compound"),  # instead of a type: a joint of several variables
        "variable": Statement("WORD {", _variable, "variables", repeats=True),  # of such a joint
        "pred": _PRED,  # the number of the parent
        "limits": _LIMITS,
        "velocity": _NUMBER,  # velocity limit, degrees or lengths per second
        "effort": _NUMBER,  # limit of the torque or force of its actuator, N m or N
        "armature": _NUMBER,  # inertia of its rotors, kg times lengths squared, or kg
        "damping": _NUMBER,  # its viscous friction: torque (N m) or force (N) at a velocity of 1
        "friction": _NUMBER,  # its Coulomb friction, N m or N
        "actuated": _ACTUATED,
        "name": _TEXT,
        "filename": _FILES,
        "inertial": _INERTIAL,
    },
    "frame": {"parameters": _PARAMETERS, "pred": _PRED, "name": _TEXT, "filename": _FILES, "inertial": _INERTIAL},
    "inertial": {  # in the node's own frame
        "mass": replace(_NUMBER, required=" (kg), nor a 'density' (kg/m3)", unless="density"),
        "centre": _VECTOR,  # x y z, lengths
        "moments": _VECTOR,  # Ixx Iyy Izz about the centre, kg times lengths squared
        "products": _VECTOR,  # Ixy Ixz Iyz
        "density": _NUMBER,  # kg/m3; of the graphics, or with a radius of bars
        "radius": _NUMBER,  # of bars, a length
    },
    "variable": {
        "home": _NUMBER,
        "limits": _LIMITS,
        "velocity": _NUMBER,
        "effort": _NUMBER,
        "armature": _NUMBER,
        "damping": _NUMBER,
        "friction": _NUMBER,
        "actuated": _ACTUATED,
    },
    "parameters": dict.fromkeys(["theta", "r", "d", "alpha", "gamma", "epsilon"], _NUMBER),
    "constraint": {
        "link": _NODE,
        "frame": _NODE,
        "base": Statement("", lambda _, word: (0, word.location), "nodes", repeats=True),
        "type": Statement("NUMBER", Choice.of("loop type", LoopKind)),
        "sensor": Statement(  # sensors that the node may follow; 0: left free
            "( NUMBER+ )", lambda report, *tokens: [(whole(report, token), token.location) for token in tokens]
        ),
    },
    "coupling": {  # the first link follows the others
        "link": Statement("NUMBER", lambda report, number: (whole(report, number, 1), number.location), "parts", True),
        **{
            kind.name.lower(): Statement(
                "( NUMBER+ )" if kind is DriveKind.POLYNOMIAL else "NUMBER", _drive(kind), "parts", repeats=True
            )
            for kind in DriveKind
        },
        "offset": _NUMBER,  # of the joint that follows
        "name": _TEXT,
    },
    "sensor": {
        "port": replace(_TEXT, required=""),
        "translation": Statement("NUMBER", Choice("'translation'", _DOF)),  # number of degrees of freedom
        "rotation": Statement("NUMBER", Choice("'rotation'", _DOF)),
        "axes": Statement("STRING", _axes),  # what commands x y z rx ry rz, such as "x, -z, y, rx, -rz, 0.5*ry"
    },
    **{word: {} for word in ("limits", "filename", "centre", "moments", "products", "gravity")},
}
"""The statements of each kind of block, by their words; the file itself is the block without a name."""
