"""Put other numbers into the text of a RAFF file, and leave everything else in it as it is."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from raff2urdf.errors import RaffError
from raff2urdf.raff.document import Document, RaffParameters, RaffRobot
from raff2urdf.raff.reader import parse
from raff2urdf.raff.tokens import Token, tokens
from raff2urdf.raff.writer import dumps, number

_WORDS = tuple(RaffParameters.__dataclass_fields__)


def rewritten(document: Document, wanted: Document, robot: str) -> str:
    """Return the text of a document with the parameters of another one, which differs from it in them only.

    If the document was not read from a text, it is written anew.

    Args:
        document: as read.
        wanted: with other parameters of nodes.
        robot: name of the robot whose parameters differ.
    """
    lines = document.source.lines
    if not lines:
        return dumps(wanted)
    changed = list(lines)
    edits = sorted(_edits(lines, document.robot(robot), wanted.robot(robot)), reverse=True)
    for line, column, length, text in edits:
        row = changed[line - 1]
        changed[line - 1] = row[: column - 1] + text + row[column - 1 + length :]
    text = "\n".join(changed)
    try:
        if parse(text) == wanted:
            return text
    except RaffError:
        pass
    return dumps(wanted)


def _edits(lines: Sequence[str], old: RaffRobot, new: RaffRobot) -> Iterator[tuple[int, int, int, str]]:
    """Yield line, column and length of a text that is replaced, and the text that replaces it."""
    numbers, blocks, ends = _located(lines, old.name)
    for key, node in old.nodes.items():
        before, after = node.parameters, new.nodes[key].parameters
        added = []
        for word in _WORDS:
            value = getattr(after, word)
            if value == getattr(before, word):
                continue
            written = numbers.get((key, word))
            if written is None:
                added.append(f"{word} {number(value)}")
            else:
                yield written.line, written.column, len(written.text), number(value)
        if added and key in ends:
            token = ends[key]
            space = "" if lines[token.line - 1][: token.column - 1].endswith(" ") else " "
            yield token.line, token.column, 0, f"{space}{' '.join(added)} "
        elif added and key in blocks:
            token = blocks[key]
            yield token.line, token.column + 1, 0, f" parameters {{ {' '.join(added)} }}"


def _located(
    lines: Sequence[str], robot: str
) -> tuple[dict[tuple[int, str], Token], dict[int, Token], dict[int, Token]]:
    """Return the numbers of a robot's parameters, by node and word; and by node the opening brace of its block, and the
    closing brace of its parameters."""
    path: list[list[Token]] = [[]]  # of open blocks: the words before their braces; the last has those since
    numbers: dict[tuple[int, str], Token] = {}
    blocks: dict[int, Token] = {}
    ends: dict[int, Token] = {}
    is_inside = False
    for token in tokens(lines):
        head = [block[-1].text if block else "" for block in path[:-1]]
        if token.kind == "{":
            words = path[-1]
            if len(path) == 1 and len(words) >= 2:
                is_inside = words[-2].text == "robot" and words[-1].string == robot
            path[-1] = words[-2:]
            path.append([])
            node = _node(path)
            if is_inside and node is not None and len(path) == 3:
                blocks[node] = token
        elif token.kind == "}" and len(path) > 1:
            node = _node(path)
            if is_inside and node is not None and len(path) == 4 and head[-1] == "parameters":
                ends[node] = token
            path.pop()
            path[-1] = []
        else:
            node = _node(path)
            if is_inside and node is not None and len(path) == 4 and head[-1] == "parameters" and path[-1]:
                numbers.setdefault((node, path[-1][-1].text), token)
            path[-1].append(token)
    return numbers, blocks, ends


def _node(path: Sequence[Sequence[Token]]) -> int | None:
    """Return the number of the node whose block is open, as the second of the open blocks."""
    if len(path) < 3:
        return None
    words = [token.text for token in path[1]]
    if words[-1:] == ["base"]:
        return 0
    if words[-2:-1] in (["link"], ["frame"]) and re.fullmatch(r"\d+", words[-1]):
        return int(words[-1])
    return None
