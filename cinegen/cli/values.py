"""Values of motors and coordinates of poses as options give them: numbers or NAME=NUMBER, in mm and degrees."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cinegen.model import Mechanism


def parts(words: Sequence[str]) -> list[str]:
    """What commas or blanks part."""
    text = re.sub(r"\s*=\s*", "=", " ".join(words))
    return [part for part in re.split(r"[,\s]+", text) if part]


def number(text: str, option: str) -> float:
    """A finite number.

    Raises:
        CinegenError: it is none.
    """
    from cinegen.errors import CinegenError

    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CinegenError(f"{option}: '{text}' is no number")
    return value


def named(given: Sequence[str], option: str, example: str) -> dict[str, float] | None:
    """Values by name; None where none has a name.

    Raises:
        CinegenError: some have a name and some have none, a name is given twice, or it is no number.
    """
    from cinegen.errors import CinegenError

    having = [part for part in given if "=" in part]
    if not having:
        return None
    if len(having) < len(given):
        raise CinegenError(f"{option}: give all values by name, such as {example}, or none")
    found: dict[str, float] = {}
    for name, _, text in (part.partition("=") for part in having):
        if name in found:
            raise CinegenError(f"{option}: {name} is given twice")
        found[name] = number(text, option)
    return found


def meant(mechanism: Mechanism, name: str, value: float) -> float:
    """m or rad, of what is typed in mm or degrees for a joint or a coordinate of a pose."""
    long = mechanism.slides(name) if name in mechanism.joints else name in ("x", "y", "z")
    return value / 1e3 if long else math.radians(value)
