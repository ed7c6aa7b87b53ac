"""Where a value stands in a JSON text."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable

_SPACE = re.compile(r"[ \t\n\r]*")


def line_of(text: str, path: Iterable[str | int]) -> int:
    """The line, from 1, where a value begins; where there is none, that of what should hold it.

    Args:
        text: JSON, correct.
        path: keys and indices that lead to the value, such as `("loops", 0, "name")`.
    """
    at = _skip(text, 0)
    for step in path:
        found = _member(text, at, step)
        if found is None:
            break
        at = found
    return text.count("\n", 0, at) + 1


def _member(text: str, at: int, step: str | int) -> int | None:
    """Where the member of an object or array begins that begins at `at`."""
    decoder, keyed, index = json.JSONDecoder(), text[at] == "{", 0
    at = _skip(text, at + 1)
    while text[at] not in "]}":
        key: str | int = index
        if keyed:
            key, at = decoder.raw_decode(text, at)
            at = _skip(text, _skip(text, at) + 1)
        if key == step:
            return at
        at = _skip(text, decoder.raw_decode(text, at)[1])
        at = _skip(text, at + 1) if text[at] == "," else at
        index += 1
    return None


def _skip(text: str, at: int) -> int:
    space = _SPACE.match(text, at)
    return at if space is None else space.end()
