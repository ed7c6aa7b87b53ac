"""The numbers of a robot's files that place its joints and the ends of its loops, with their positions in the text.

They can be changed without touching anything else in the file: RAFF, URDF with its constraints file, SDF, MJCF.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from raff2urdf.errors import RaffError
from raff2urdf.files import read_bytes
from raff2urdf.placement import rotation
from raff2urdf.raff.document import UNITS_PER_METRE
from raff2urdf.readers import holds_xml
from raff2urdf.readers.loops.sidecar import constraints_of
from raff2urdf.readers.xml_file import read_text

_NUMBER = re.compile(rb"[^\s,\[\]]+")
_ELEMENT = re.compile(
    rb"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<(/?)([\w:.-]+)((?:[^>\"']|\"[^\"]*\"|'[^']*')*?)(/?)>", re.DOTALL
)
_ATTRIBUTE = re.compile(rb"([\w:.-]+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_ELSEWHERE = {b"visual", b"collision", b"inertial", b"sensor", b"plugin", b"geom", b"camera", b"light", b"gazebo"}
"""Elements whose poses move no joint."""

_ATTRIBUTES = {
    b"robot": {b"xyz": "", b"rpy": "aaa"},
    b"mujoco": {
        b"pos": "lll", b"quat": "dddd", b"axis": "ddd", b"euler": "eee", b"axisangle": "ddde", b"xyaxes": "dddddd",
        b"zaxis": "ddd", b"anchor": "lll", b"relpose": "llldddd",
    },
}  # fmt: skip
"""Attributes by root element: for each number l, a length; a, an angle; e, an angle in the compiler's unit; d, a
component of a direction."""

_RAFF = re.compile(rb"//[^\n]*|\"[^\"\n]*\"|\b(theta|alpha|gamma|r|d|epsilon)\s+([+-]?[\d.][^\s{}()\"/]*)")


@dataclass(frozen=True, slots=True)
class WrittenNumber:
    """A number of a file.

    Attributes:
        file: that holds it.
        start: its position, in bytes.
        text: as written.
        line: its line.
        name: the element or statement that it belongs to.
        scale: m or rad of one unit; for a component of a direction, the rad by which one unit turns it.
        is_length: whether it is a length, not an angle or a direction.
    """

    file: Path
    start: int
    text: str
    line: int
    name: str
    scale: float
    is_length: bool

    @property
    def value(self) -> float:
        """The number."""
        return float(self.text)


@dataclass(frozen=True, slots=True)
class Adjustable:
    """Numbers that change together: one by itself, or the twelve of a matrix that must remain a placement.

    Attributes:
        numbers: in the order of the text.
        is_length: of each independent change, whether it is a length.
    """

    numbers: tuple[WrittenNumber, ...]
    is_length: tuple[bool, ...]

    def values(self, change: Sequence[float]) -> list[float]:
        """Return the numbers after changes, in m and rad."""
        if len(self.numbers) == 1:
            return [self.numbers[0].value + change[0] / self.numbers[0].scale]
        matrix = np.array([number.value for number in self.numbers]).reshape(3, 4)
        moved = matrix.copy()
        moved[:, 3] += matrix[:, :3] @ np.asarray(change[:3])
        angle = float(np.linalg.norm(change[3:]))
        moved[:, :3] = matrix[:, :3] @ rotation(np.asarray(change[3:]) / (angle or 1.0), angle)[:3, :3]
        return [float(value) for value in moved.ravel()]


def adjustables(path: Path) -> list[Adjustable]:
    """Return the numbers that place the joints and loops of a robot's file, and of its constraints file.

    Raises:
        RaffError: a file can't be read.
    """
    data = read_bytes(path)
    if not holds_xml(path):
        return [Adjustable((n,), (n.is_length,)) for n in _raff(path, data)]
    root, numbers = _xml(path, data)
    sidecar = constraints_of(path)
    placements = _placements(sidecar) if root == b"robot" and sidecar.is_file() else ()
    return [*(Adjustable((n,), (n.is_length,)) for n in numbers), *placements]


def rewritten(numbers: Sequence[WrittenNumber], values: Sequence[float]) -> dict[Path, bytes]:
    """Return the content of files in which numbers are replaced by values; everything else is kept, byte for byte. A
    value that is the same as before is not written."""
    changes: dict[Path, list[tuple[WrittenNumber, float]]] = {}
    for number, value in zip(numbers, values, strict=True):
        changes.setdefault(number.file, []).append((number, value))
    contents = {}
    for file, changed in changes.items():
        data, end, parts = read_bytes(file), 0, []
        for number, value in sorted(changed, key=lambda change: change[0].start):
            text = number.text if value == number.value else repr(float(value))
            parts += [data[end : number.start], text.encode()]
            end = number.start + len(number.text.encode())
        contents[file] = b"".join([*parts, data[end:]])
    return contents


def _numbers(
    path: Path, data: bytes, start: int, end: int, kinds: str, name: str, angle: float = 1.0
) -> Iterator[WrittenNumber]:
    """Yield the numbers between two positions, if they are as many as their kinds."""
    words = [(match.start() + start, match[0]) for match in _NUMBER.finditer(data[start:end])]
    try:
        values = [float(word) for _, word in words]
    except ValueError:
        return
    if len(words) != len(kinds):
        return
    size = math.sqrt(sum(v * v for v, kind in zip(values, kinds, strict=True) if kind == "d")) or 1.0
    for (at, word), kind in zip(words, kinds, strict=True):
        scale = {"l": 1.0, "a": 1.0, "e": angle, "g": math.radians(1.0), "d": 1.0 / size}[kind]
        line = data.count(b"\n", 0, at) + 1
        yield WrittenNumber(path, at, word.decode(), line, name, scale, kind == "l")


def _xml(path: Path, data: bytes) -> tuple[bytes, list[WrittenNumber]]:
    """Return the root element of a URDF, SDF or MJCF, and its numbers."""
    stack: list[tuple[bytes, str]] = []
    numbers: list[WrittenNumber] = []
    root, unit = b"", math.radians(1.0)
    if re.search(rb"<compiler\b[^>]*\bangle\s*=\s*[\"']radian", data):
        unit = 1.0
    for match in _ELEMENT.finditer(data):
        closing, tag, attributes, alone = match.groups()
        if tag is None:
            continue
        if closing:
            while stack and stack.pop()[0] != tag:
                pass
            continue
        values = {key: first or second for key, first, second in _ATTRIBUTE.findall(attributes)}
        root = root or tag
        near = next((name for _, name in reversed(stack) if name), "")
        label = values.get(b"name", b"").decode(errors="replace")
        name = f"{tag.decode()} '{label}'" if label else ""
        if not any(outer in _ELSEWHERE for outer, _ in [*stack, (tag, "")]):
            said = name or f"{near} {tag.decode()}".strip()
            kinds = _ATTRIBUTES.get(root, {})
            for attribute in _ATTRIBUTE.finditer(attributes):
                kind = kinds.get(attribute[1])
                if kind is not None:
                    group = 2 if attribute[2] is not None else 3
                    kind = kind or ("ddd" if tag == b"axis" else "lll")
                    start, end = (match.start(3) + at for at in attribute.span(group))
                    numbers += _numbers(path, data, start, end, kind, f"{said} {attribute[1].decode()}", unit)
            if root == b"sdf" and not alone and tag in (b"pose", b"xyz"):
                kind = "ddd" if tag == b"xyz" else "lllggg" if values.get(b"degrees") in (b"true", b"1") else "lllaaa"
                kind = "llldddd" if values.get(b"rotation_format") == b"quat_xyzw" else kind
                numbers += _numbers(path, data, match.end(), data.index(b"<", match.end()), kind, said)
        if not alone:
            stack.append((tag, name))
    return root, numbers


def _raff(path: Path, data: bytes) -> Iterator[WrittenNumber]:
    """Yield the parameters of a RAFF file."""
    unit = re.search(rb"^\s*units\s+\"?(\w+)\"?", data, re.MULTILINE)
    metre = UNITS_PER_METRE.get(unit[1].decode(), 1e3) if unit else 1e3
    for match in _RAFF.finditer(data):
        if match[1] is None:
            continue
        is_length = match[1] in (b"r", b"d", b"epsilon")
        line = data.count(b"\n", 0, match.start(2)) + 1
        owners = re.findall(rb"\b(?:link|frame)\s+\d+|\bbase\b", data[: match.start()])
        name = f"{owners[-1].decode() if owners else 'parameters'} {match[1].decode()}"
        scale = 1.0 / metre if is_length else math.radians(1.0)
        yield WrittenNumber(path, match.start(2), match[2].decode(), line, name, scale, is_length)


def _placements(path: Path) -> Iterator[Adjustable]:
    """Yield the placements of the ends of loops in a constraints file."""
    data = read_text(path).encode()
    if data != read_bytes(path):
        raise RaffError(f"{path}: is not UTF-8 text without a byte-order mark: save it as UTF-8")
    names = [loop["name"] for loop in json.loads(data)["loops"]]
    for i, match in enumerate(re.finditer(rb"\"placement\"\s*:\s*((?:\[[^\]]*\]\s*,?\s*|\[\s*|\s)*)", data)):
        name = f"loop '{names[i // 2]}' {('first', 'second')[i % 2]} placement"
        numbers = [
            replace(number, scale=1.0) for number in _numbers(path, data, *match.span(1), "dddl" * 3 + "dddd", name)
        ]
        if numbers:
            yield Adjustable(tuple(numbers[:12]), (True,) * 3 + (False,) * 3)
