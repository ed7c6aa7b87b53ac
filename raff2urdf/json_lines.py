"""Lines of values in a JSON text."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable

Path = tuple[str | int, ...]
"""Keys and indices that lead to a value, such as `("loops", 0, "name")`."""

_SPACE = re.compile(r"[ \t\n\r]*")


def line_of(text: str, path: Iterable[str | int]) -> int:
    """Return the line, from 1, at which a value begins; if there is no such value, that of the innermost one around it.

    Args:
        text: valid JSON.
        path: keys and indices that lead to the value.
    """
    offsets, path = _offsets(text), tuple(path)
    while path not in offsets:
        path = path[:-1]
    return _line(text, offsets[path][0])


def repeated_key(text: str) -> tuple[Path, tuple[int, int]] | None:
    """Return the path to a key that its object holds twice, and both lines; None if there is no such key.

    Args:
        text: valid JSON.
    """
    for path, offsets in _offsets(text).items():
        if len(offsets) > 1:
            first, second = sorted(offsets)[:2]
            return path, (_line(text, first), _line(text, second))
    return None


def _offsets(text: str) -> dict[Path, list[int]]:
    """Return where each value begins: at several offsets if its key is repeated. Values come before their members."""
    found: dict[Path, list[int]] = {}
    decoder = json.JSONDecoder(parse_int=float)
    pending: list[tuple[Path, int]] = [((), _skip(text, 0))]
    while pending:
        path, start = pending.pop()
        found.setdefault(path, []).append(start)
        if text[start] not in "{[":
            continue
        key: str | int = -1
        at = _skip(text, start + 1)
        while text[at] not in "]}":
            if isinstance(key, int) and text[start] == "[":
                key += 1
            else:
                key, at = decoder.raw_decode(text, at)
                at = _skip(text, _skip(text, at) + 1)
            pending.append(((*path, key), at))
            at = _skip(text, decoder.raw_decode(text, at)[1])
            at = _skip(text, at + 1) if text[at] == "," else at
    return found


def _line(text: str, offset: int) -> int:
    return text.count("\n", 0, offset) + 1


def _skip(text: str, at: int) -> int:
    space = _SPACE.match(text, at)
    return at if space is None else space.end()
