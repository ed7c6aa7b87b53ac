"""Read the Neutral File Format of Sense8's WorldToolKit: ASCII, versions 2 and 3.

    nff                                       the first word
    version 2.1
    viewpos 0 0 -5                            position and direction of the camera: not used
    viewdir 0 0 1

    plate                                     an object: its name,
    4                                         its number of vertices,
    0 0 0                                     x y z, then perhaps a normal, texture coordinates and a colour:
    1 0 0  norm 0 0 1  uv 1 0  0xff8000
    1 1 0
    0 1 0
    1                                         its number of polygons,
    4 0 1 2 3 0xfff both _V_wood              corners, which vertices, colour, visible from both sides, texture

Blank space and empty lines only separate; `//` begins a comment. A colour of up to three hexadecimal digits is 0xRGB,
a longer one 0xRRGGBB. If all corners of a polygon have the same colour, it is the polygon's; vertex colours that differ
are for smooth shading, and left out like normals, textures and the materials of version 3: STL has none.

Facts: Sense8 Corporation, "WorldToolKit Neutral File Format, Version 2.1", 1993. Eric Haines' Neutral File Format has
the same name, but another syntax.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from raff2urdf.errors import Problem, RaffError, SourceLocation, counted
from raff2urdf.files import read_bytes
from raff2urdf.graphics.surface import LARGEST, MOST_CORNERS, Colour, ColouredSurface, Point, Polygons

_HEADER = ("version", "viewpos", "viewdir")

# First words of lines in Haines' format.
_HAINES = ("v", "from", "at", "up", "angle", "hither", "resolution", "b", "l", "f", "fm", "c", "s", "p", "pp", "tpp")

_COUNT = re.compile(r"[0-9]{1,15}")
_HEX = re.compile(r"0[xX]([0-9a-fA-F]{1,6})")
_NUMBERS = {"norm": 3, "uv": 2}  # that follow a word after a vertex


def read(path: str | Path) -> list[ColouredSurface]:
    """Read a file; see `loads`.

    Raises:
        RaffError: it can't be read, or is wrong: where and why.
    """
    text = read_bytes(path).decode("latin-1")  # names may be in any encoding
    return loads(text.removeprefix("\xef\xbb\xbf"), str(path))


def loads(text: str, name: str = "<text>") -> list[ColouredSurface]:
    """Return the surfaces of a file, one for each colour.

    Args:
        text: of the file.
        name: of the file, in errors.

    Raises:
        RaffError: it is wrong: where and why.
    """
    return _Reader(text, name).surfaces()


@dataclass(frozen=True, slots=True)
class _Line:
    number: int  # from 1
    text: str
    words: list[str]


@dataclass(frozen=True, slots=True)
class _Vertex:
    point: Point
    colour: Colour | None


class _Reader:
    def __init__(self, text: str, name: str) -> None:
        self.name = name
        self.lines = []
        for number, line in enumerate(re.split(r"\r\n|\r|\n", text), 1):
            if words := line.partition("//")[0].split():
                self.lines.append(_Line(number, line, words))
        self.at = 0
        self.polygons = Polygons()

    def surfaces(self) -> list[ColouredSurface]:
        if not self.lines:
            self.wrong("is empty", _Line(1, "", []))
        first = self.next("'nff'")
        if first.words[0].lower() != "nff":
            self.foreign(first)
        objects = 0
        while self.at < len(self.lines):
            if self.begins_object():
                self.object()
                objects += 1
                continue
            line = self.next("an object")
            # Other keywords may precede the objects. After an object, the line is left over from a wrong count.
            unknown = objects == 0 and line.words[0].isalpha() and len(line.words) > 1
            if line.words[0].lower() not in _HEADER and not unknown:
                where = "the file ends" if self.at == len(self.lines) else "the number of vertices does not follow"
                self.wrong(f"'{_short(line.words[0])}' is where an object's name should be, but {where}", line)
        if objects == 0:
            self.wrong("holds no object", first)
        return self.polygons.surfaces()

    def begins_object(self) -> bool:
        """Return whether the next line is an object's name: then a count, or the name of a material table, follows."""
        name, following = (*self.lines[self.at : self.at + 2], None)[:2]
        if name is None or following is None or name.words[0].lower() in _HEADER:
            return False
        words = following.words
        return words[0].lower() == "mtable" or (len(words) == 1 and words[0].isdecimal())

    def object(self) -> None:
        name = " ".join(self.next("an object's name").words)
        while self.at < len(self.lines) and self.lines[self.at].words[0].lower() == "mtable":
            self.at += 1
        count = self.count("vertices", name)
        vertices = [self.vertex(self.next(f"vertex {i} of {count}")) for i in range(count)]
        count = self.count("polygons", name)
        for i in range(count):
            self.polygon(self.next(f"polygon {i} of {count}"), vertices)

    def count(self, what: str, name: str) -> int:
        """Return the number of vertices or polygons: at most as many as lines are left, since each has one."""
        line = self.next(f"the number of {what} of '{_short(name)}'")
        left = len(self.lines) - self.at
        if len(line.words) != 1 or not line.words[0].isdecimal():
            self.wrong(f"the number of {what} of '{_short(name)}' must be alone on a line", line)
        word = line.words[0]
        count = int(word) if _COUNT.fullmatch(word) else math.inf
        if count > left:
            self.wrong(f"{_short(word)} {what} should follow, but {left} lines do", line)
        return int(count)

    def vertex(self, line: _Line) -> _Vertex:
        if len(line.words) < 3:
            self.wrong("a vertex needs three coordinates", line)
        x, y, z = (self.number(line, i) for i in range(3))
        colour, _ = self.trailing(line, 3, _NUMBERS, "a vertex has three coordinates: '{}' is one too many")
        return _Vertex((x, y, z), colour)

    def trailing(self, line: _Line, i: int, numbers: Mapping[str, int], message: str) -> tuple[Colour | None, set[str]]:
        """Return the colour and the other words of a line from word i on.

        Args:
            line: of a vertex or a polygon.
            i: where the remainder begins.
            numbers: how many numbers follow a word; any may follow an unknown word.
            message: the error for another number.
        """
        colour: Colour | None = None
        words: set[str] = set()
        after_word = False
        while i < len(line.words):
            word = line.words[i].lower()
            if word.startswith("0x"):
                colour, after_word = self.colour(line, i), False
            elif word in numbers:
                if len(line.words) <= i + numbers[word]:
                    self.wrong(f"'{word}' needs {counted(numbers[word], 'number')}", line, i)
                for k in range(numbers[word]):
                    self.number(line, i + 1 + k)
                i, after_word = i + numbers[word], False
            elif not _is_number(word):
                words.add(word)
                after_word = word != "both"
            elif not after_word:
                self.wrong(message.format(_short(word)), line, i)
            i += 1
        return colour, words

    def polygon(self, line: _Line, vertices: Sequence[_Vertex]) -> None:
        corners = int(line.words[0]) if _COUNT.fullmatch(line.words[0]) else 0
        if corners < 1:
            self.wrong(f"a polygon begins with its number of corners, not '{_short(line.words[0])}'", line)
        if corners > MOST_CORNERS:
            self.wrong(f"a polygon has {_short(line.words[0])} corners: at most {MOST_CORNERS} are allowed", line)
        if len(line.words) <= corners:
            self.wrong(f"a polygon of {corners} corners lists {len(line.words) - 1}", line)
        chosen = []
        for i in range(1, corners + 1):
            index = int(line.words[i]) if _COUNT.fullmatch(line.words[i]) else len(vertices)
            if index >= len(vertices):
                most = f"0 to {len(vertices) - 1}" if vertices else "there are none"
                self.wrong(f"'{_short(line.words[i])}' is not a vertex of this object ({most})", line, i)
            chosen.append(vertices[index])
        message = f"'{{}}' is one too many for a polygon of {corners} corners"
        colour, words = self.trailing(line, corners + 1, {}, message)
        if corners > 2:  # else it has no area
            shared = chosen[0].colour if len({vertex.colour for vertex in chosen}) == 1 else None
            self.polygons.add([vertex.point for vertex in chosen], shared or colour, "both" in words)

    def number(self, line: _Line, i: int) -> float:
        word = line.words[i]
        value = float(word) if _is_number(word) else math.nan
        if not abs(value) <= LARGEST:
            self.wrong(f"'{_short(word)}' is not a number up to {LARGEST:g}", line, i)
        return value

    def colour(self, line: _Line, i: int) -> Colour:
        match = _HEX.fullmatch(line.words[i])
        if match is None:
            self.wrong(f"'{_short(line.words[i])}' is not a colour: write 0xRGB or 0xRRGGBB", line, i)
        value = int(match[1], 16)
        if len(match[1]) <= 3:
            return 17 * (value >> 8), 17 * (value >> 4 & 15), 17 * (value & 15), 255
        return value >> 16, value >> 8 & 255, value & 255, 255

    def next(self, what: str) -> _Line:
        if self.at == len(self.lines):
            self.wrong(f"the file ends where {what} should be", self.lines[-1])
        self.at += 1
        return self.lines[self.at - 1]

    def foreign(self, line: _Line) -> NoReturn:
        word = _short(line.words[0])
        if word.lower() in _HAINES or word.startswith("#"):  # its comments
            self.wrong(f"this is Haines' Neutral File Format (it begins with '{word}'), not WorldToolKit's", line)
        self.wrong(f"this is not a Neutral File Format: its first word is '{word}', not 'nff'", line)

    def wrong(self, message: str, line: _Line, word: int = 0) -> NoReturn:
        starts = [match.span() for match in re.finditer(r"\S+", line.text)]
        begin, end = starts[word] if word < len(starts) else (0, 1)
        raise RaffError(Problem(message, self.name, SourceLocation(line.number, begin + 1, end - begin), line.text))


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word)) and word.isascii() and "_" not in word  # not 1_000 or ٣, as in Python
    except ValueError:
        return False


def _short(word: str) -> str:
    """Return a word for an error: in a file that is not text, it may be long, and have any characters."""
    shown = "".join(c if c.isprintable() else "?" for c in word[:40])
    return shown + "..." if len(word) > 40 else shown
