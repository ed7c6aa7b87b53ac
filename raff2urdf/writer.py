"""`Document` -> RAFF text, such that `parse(write(document)) == document`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from raff2urdf.document import Document, LoopKind, Parameters, RaffFrame, RaffLink, RaffNode, RaffRobot
from raff2urdf.errors import RaffError


def write(document: Document, head: Sequence[str] = (), notes: Mapping[int, str] | None = None) -> str:
    """The document as RAFF text; every number reads back to the same double.

    Args:
        document: what is said.
        head: lines of comment below the first line.
        notes: a comment behind the head of a link or frame, by its number.

    Raises:
        RaffError: a text in it holds a quotation mark or a line's end, which RAFF can't write.
    """
    lines = [f"RAFF {_name(document.name)}"]
    if head:
        lines += ["", *(f"// {_comment(line)}" for line in head)]
    if document.units != "mm":
        lines.append(f"units {document.units}")
    for sensor in document.sensors:
        lines += ["", f"sensor {sensor.number} {{", f"  port {_text(sensor.port)}"]
        lines += [f"  translation {sensor.translation}", f"  rotation {sensor.rotation}", "}"]
    for robot in document.robots:
        lines += ["", f"robot {_name(robot.name)} {{", *_robot(robot, notes or {}), "}"]
    return "\n".join(lines) + "\n"


def _robot(robot: RaffRobot, notes: Mapping[int, str]) -> Iterator[str]:
    if robot.path is not None:
        yield f"  path {_text(robot.path)}"
    yield "  base {"
    yield from _shared(robot.base)
    yield "  }"
    for part in robot.parts:
        note = f" // {_comment(notes[part.number])}" if part.number in notes else ""
        yield f"  {part.keyword} {part.number} {{{note}"
        if part.name is not None:
            yield f"    name {_text(part.name)}"
        yield from _shared(part)
        if isinstance(part, RaffLink):
            yield f"    type {int(part.type)}"
        yield f"    pred {part.pred}"
        if isinstance(part, RaffLink):
            if part.limits is not None:
                yield f"    limits {{ {number(part.limits[0])} {number(part.limits[1])} }}"
            if part.velocity is not None:
                yield f"    velocity {number(part.velocity)}"
            if part.actuated is not None:
                yield f"    actuated {int(part.actuated)}"
        yield "  }"
    for loop in robot.loops:
        kind = f" type {int(loop.kind)}" if loop.kind is not LoopKind.RIGID else ""
        yield f"  constraint {{ {_node(robot, loop.first)} {_node(robot, loop.second)}{kind} }}"
    for constraint in robot.sensor_constraints:
        sensors = _list(list(map(str, constraint.sensors)), "    ")
        yield f"  constraint {{ {_node(robot, constraint.node)} sensor ( {sensors} ) }}"


def _shared(part: RaffNode) -> Iterator[str]:
    """What base, link and frame have in common."""
    if part.parameters != Parameters():
        said = [(word, getattr(part.parameters, word)) for word in Parameters.__dataclass_fields__]
        yield f"    parameters {{ {' '.join(f'{word} {number(value)}' for word, value in said if value != 0.0)} }}"
    if part.filenames is not None:
        files = _list(list(map(_text, part.filenames)), "      ")
        yield f"    filename {{ {files} }}" if files else "    filename { }"


def _comment(text: str) -> str:
    """A text on one line."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _list(words: list[str], indent: str) -> str:
    """Words in a row; twenty to a line."""
    rows = [" ".join(words[i : i + 20]) for i in range(0, len(words), 20)]
    return f"\n{indent}".join(rows)


def _node(robot: RaffRobot, number: int) -> str:
    if number == 0:
        return "base"
    part = robot.nodes.get(number)
    return f"frame {number}" if isinstance(part, RaffFrame) else f"link {number}"


def number(value: float) -> str:
    """The shortest text that reads back to the same double; whole numbers without a point.

    Raises:
        RaffError: RAFF can't write what is not finite.
    """
    if not math.isfinite(value):
        raise RaffError(f"RAFF can't write the number {value}")
    return repr(float(value)).removesuffix(".0")


def _text(text: str) -> str:
    if '"' in text or "\n" in text:
        raise RaffError(f"RAFF can't write the text {text!r}: it holds a quotation mark or a line's end")
    return f'"{text}"'


_WORD_ENDS = frozenset(' \t\r\f\v{}()"/')


def _name(name: str) -> str:
    """A name as a bare word where it is one: neither a number nor broken by what ends a word."""
    word = name and name.isprintable() and not _WORD_ENDS & set(name)
    return name if word and name[0] not in "+-." and not name[0].isdecimal() else _text(name)
