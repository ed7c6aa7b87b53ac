"""The axes of a sensor, as one text in RAFF, Python, commands and the page: `x, -z, y, rx, -rz, 0.5*ry`.

Entry by entry, it gives the axis of the sensor, with its sign and factor, that commands x, y, z, rx, ry and rz.
0 stands for none, and so do entries that are left out at the end. Commas or spaces separate.
"""

from __future__ import annotations

import re
from functools import lru_cache

from raff2urdf.errors import Problem, RaffError, SourceLocation

AXES = ("x", "y", "z", "rx", "ry", "rz")
UNCHANGED = ", ".join(AXES)

LARGEST_FACTOR = 100.0

SensorAxes = tuple[tuple[float, int], ...]
"""For each commanded axis, the factor (0: none) and the index of the sensor's axis."""

_NUMBER = r"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_ENTRY = re.compile(rf"([+-]?)(?:({_NUMBER})\*)?({'|'.join(AXES)})")


@lru_cache
def parse_axes(text: str) -> SensorAxes:
    """Return the axes of a sensor that a text describes.

    An axis may command a translation and a rotation, but not two of either.

    Raises:
        RaffError: the text is wrong; with the column.
    """

    def problem(message: str, start: int, length: int = 1) -> RaffError:
        return RaffError(Problem(message, "axes", SourceLocation(1, start + 1, length), text))

    axes: list[tuple[float, int]] = []
    before = ","
    for token in re.finditer(r"[^,\s]+|,|$", text):
        word = token[0] or ","
        if word == before == ",":
            raise problem("an axis is missing here: write 0 for none", token.start())
        before = word
        if word == ",":
            continue
        length, number = len(word), len(axes)
        if number == len(AXES):
            why = f"'{word}' is a seventh axis: remove it; x, y, z, rx, ry and rz are commanded"
            raise problem(why, token.start(), length)
        entry = _ENTRY.fullmatch(word)
        if entry is None and word != "0":
            why = f"'{word}' is no axis of a sensor: write {UNCHANGED}, or 0 for none"
            why += "; with a sign or a factor, such as -0.5*rx"
            raise problem(why, token.start(), length)
        factor, axis = (0.0, number) if entry is None else (float(entry[2] or 1), AXES.index(entry[3]))
        if factor > LARGEST_FACTOR:
            message = f"the factor of '{word}' is too large: write {LARGEST_FACTOR:g}*{AXES[axis]} at most"
            raise problem(message, token.start(), length)
        for other in range(number - number % 3, number):
            if factor and axes[other][0] and axes[other][1] == axis:
                both = f"{AXES[other]} and {AXES[number]}"
                message = f"'{AXES[axis]}' would command both {both}: write 0 for one of them, or another axis"
                raise problem(message, token.start(), length)
        axes.append((-factor if entry is not None and entry[1] == "-" else factor, axis))
    return (*axes, *((0.0, axis) for axis in range(len(axes), len(AXES))))


def format_axes(axes: SensorAxes) -> str:
    """Return the text that `parse_axes` reads, with all six entries."""
    return ", ".join(
        f"{'-' * (factor < 0)}{f'{abs(factor)!r}*' * (abs(factor) != 1.0)}{AXES[axis]}" if factor else "0"
        for factor, axis in axes
    )
