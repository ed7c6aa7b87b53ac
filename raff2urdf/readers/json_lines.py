"""Lines of values in a JSON text."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from typing import Any

Path = tuple[str | int, ...]
"""Keys and indices that lead to a value, such as `("loops", 0, "name")`."""

_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[{}\[\]:,]|[^\s{}\[\]:,"]+')


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
    offsets: dict[Path, list[int]] = {}
    path: list[Any] = []  # the key or index of the next value in each open object or array; None: a key follows
    for token in _TOKEN.finditer(text):
        mark = token[0]
        if mark in "]}":
            path.pop()
        elif mark == ",":
            path[-1] = path[-1] + 1 if isinstance(path[-1], int) else None
        elif path and path[-1] is None:
            path[-1] = json.loads(mark)
        elif mark != ":":
            offsets.setdefault(tuple(path), []).append(token.start())
            if mark in "{[":
                path.append(None if mark == "{" else 0)
    return offsets


def _line(text: str, offset: int) -> int:
    return text.count("\n", 0, offset) + 1
