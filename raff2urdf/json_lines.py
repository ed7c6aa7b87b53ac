"""Where a value stands in a JSON text."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator

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


def repeated_key(text: str) -> tuple[list[str | int], tuple[int, int]] | None:
    """Return the path to a key that its object holds twice, and both lines; None if there is no such key.

    Args:
        text: JSON, correct.
    """
    left: list[tuple[list[str | int], int]] = [([], _skip(text, 0))]
    while left:
        path, at = left.pop()
        first: dict[str | int, int] = {}
        for key, start in _members(text, at):
            if key in first:
                lines = [text.count("\n", 0, place) + 1 for place in (first[key], start)]
                return [*path, key], (lines[0], lines[1])
            first[key] = start
            left.append(([*path, key], start))
    return None


def _member(text: str, at: int, step: str | int) -> int | None:
    """Where the member of an object or array begins that begins at `at`."""
    return next((start for key, start in _members(text, at) if key == step), None)


def _members(text: str, at: int) -> Iterator[tuple[str | int, int]]:
    """Yield the key or index of each member of the value that begins at `at`, and where the member begins."""
    if text[at] not in "{[":
        return
    decoder, keyed, index = json.JSONDecoder(parse_int=float), text[at] == "{", 0
    at = _skip(text, at + 1)
    while text[at] not in "]}":
        key: str | int = index
        if keyed:
            key, at = decoder.raw_decode(text, at)
            at = _skip(text, _skip(text, at) + 1)
        yield key, at
        at = _skip(text, decoder.raw_decode(text, at)[1])
        at = _skip(text, at + 1) if text[at] == "," else at
        index += 1


def _skip(text: str, at: int) -> int:
    space = _SPACE.match(text, at)
    return at if space is None else space.end()
