"""Write a `Document` as RAFF text, such that `parse(dumps(document)) == document`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from raff2urdf.errors import RaffError
from raff2urdf.raff.document import (
    LEAST_SIZE,
    OF_JOINT,
    Document,
    DriveKind,
    LoopKind,
    RaffFrame,
    RaffInertial,
    RaffNode,
    RaffParameters,
    RaffRobot,
    RaffSensor,
    RaffVariable,
)
from raff2urdf.raff.sizes import longest


def dumps(document: Document, head: Sequence[str] = (), notes: Mapping[int, str] | None = None) -> str:
    """Return the document as RAFF text; every number reads back to the same double.

    Args:
        document: what to write.
        head: lines of comment below the first line.
        notes: comments on the first lines of links and frames, by number.

    Raises:
        RaffError: a text in it holds a quotation mark or a line end, for which RAFF has no notation.
    """
    lines = [f"RAFF {_name(document.name)}"]
    if head:
        lines += ["", *(f"// {_comment(line)}" for line in head)]
    if document.units != "mm" or any(0.0 < longest(each)[0] < LEAST_SIZE for each in document.robots):
        lines.append(f"units {document.units}")
    if document.gravity is not None:
        lines.append(f"gravity {_value(document.gravity)}")
    for sensor in document.sensors:
        lines += ["", f"sensor {sensor.number} {{", *_statements(sensor, "  "), "}"]
    for robot in document.robots:
        lines += ["", f"robot {_name(robot.name)} {{", *_robot(robot, notes or {}), "}"]
    return "\n".join(lines) + "\n"


def _robot(robot: RaffRobot, notes: Mapping[int, str]) -> Iterator[str]:
    if robot.path is not None:
        yield f"  path {_text(robot.path)}"
    for node in (robot.base, *robot.parts):
        note = f" // {_comment(notes[node.number])}" if node.number in notes else ""
        yield f"  {_node(robot, node.number)} {{{note}"
        yield from _statements(node, "    ")
        yield "  }"
    for loop in robot.loops:
        kind = f" type {int(loop.kind)}" if loop.kind is not LoopKind.RIGID else ""
        yield f"  constraint {{ {_node(robot, loop.first)} {_node(robot, loop.second)}{kind} }}"
    for coupling in robot.couplings:
        words = [] if coupling.name is None else [f"name {_text(coupling.name)}"]
        words.append(f"link {coupling.follower}")
        for drive in coupling.drives:
            numbers = " ".join(map(number, drive.numbers))
            numbers = f"( {numbers} )" if drive.kind is DriveKind.POLYNOMIAL else numbers
            words.append(f"link {drive.link} {drive.kind.name.lower()} {numbers}")
        words += [f"offset {number(coupling.offset)}"] * (coupling.offset != 0.0)
        yield f"  coupling {{ {' '.join(words)} }}"
    for constraint in robot.sensor_constraints:
        sensors = _list(list(map(str, constraint.sensors)), "    ")
        yield f"  constraint {{ {_node(robot, constraint.node)} sensor ( {sensors} ) }}"


_OF_SENSORS = ("port", "translation", "rotation", "axes")
_OF_INERTIAL = ("mass", "centre", "moments", "products", "density", "radius")
_OF_VARIABLES = ("home", *OF_JOINT)
_OF_NODE = ("name", "parameters", "filenames", "type", "compound", "pred", *OF_JOINT, "variables", "inertial")
_WORDS = (*_OF_NODE, *_OF_SENSORS)


def _statements(block: RaffNode | RaffSensor, indent: str) -> Iterator[str]:
    """Yield the statements of a block; those that have their default values are left out."""
    compound = getattr(block, "compound", None)
    for word in _WORDS:
        value = getattr(block, word, None)
        if word == "compound" and compound is not None:
            yield f"{indent}joint {compound}"
        elif word == "variables":
            for variable in value or ():
                yield f"{indent}variable {variable.name} {_variable(variable)}"
        elif isinstance(value, RaffInertial):
            yield from _inertial(value, indent)
        elif value is not None and value != RaffParameters() and not (word == "type" and compound):
            yield f"{indent}{word.removesuffix('s') if word == 'filenames' else word} {_value(value)}"


def _inertial(inertial: RaffInertial, indent: str) -> Iterator[str]:
    default = RaffInertial()
    values = [
        (word, getattr(inertial, word)) for word in _OF_INERTIAL if getattr(inertial, word) != getattr(default, word)
    ]
    words = [f"{word} {_value(value)}" for word, value in values]
    yield f"{indent}inertial {{ {' '.join(words)} }}" if words else f"{indent}inertial {{ }}"


def _variable(variable: RaffVariable) -> str:
    values = [(word, getattr(variable, word)) for word in _OF_VARIABLES]
    words = [
        f"{word} {_value(value)}" for word, value in values if value is not None and (word, value) != ("home", 0.0)
    ]
    return f"{{ {' '.join(words)} }}" if words else "{ }"


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, int):  # among them kinds of joints, and whether they are actuated
        return str(int(value))
    if isinstance(value, float):
        return number(value)
    if isinstance(value, RaffParameters):
        values = {word: getattr(value, word) for word in RaffParameters.__dataclass_fields__}
        return f"{{ {' '.join(f'{word} {number(x)}' for word, x in values.items() if x != 0.0)} }}"
    words = _list(list(map(_value, value)), "      ")
    return f"{{ {words} }}" if words else "{ }"


def _comment(text: str) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _list(words: list[str], indent: str) -> str:
    """Join words, twenty to a line."""
    return f"\n{indent}".join(" ".join(words[i : i + 20]) for i in range(0, len(words), 20))


def _node(robot: RaffRobot, number: int) -> str:
    if number == 0:
        return "base"
    return f"{'frame' if isinstance(robot.nodes.get(number), RaffFrame) else 'link'} {number}"


def number(value: float) -> str:
    """Return the shortest text that reads back to the same double; whole numbers without a point.

    Raises:
        RaffError: the number is not finite.
    """
    if not math.isfinite(value):
        raise RaffError(f"RAFF has no notation for the number {value}: all numbers must be finite")
    return repr(float(value)).removesuffix(".0")


def _text(text: str) -> str:
    if '"' in text or "\n" in text:
        raise RaffError(f"RAFF has no notation for a quotation mark or a line's end: remove it from {text!r}")
    return f'"{text}"'


_WORD_ENDS = frozenset(' \t\r\f\v{}()"/')


def _name(name: str) -> str:
    """Return a name as a bare word if it can be one, else in quotation marks."""
    word = name and name.isprintable() and not _WORD_ENDS & set(name)
    return name if word and name[0] not in "+-." and not name[0].isdecimal() else _text(name)
