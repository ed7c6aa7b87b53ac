"""The definitions of RAFF as a module of JavaScript: what the reader in the browser must not repeat by hand.

Tokens, statements, limits and the texts of errors are Python's own; `python -m cinegen.page.raff_definitions` writes
them to `static/raff/definitions.js`, and a test compares the file with what this module makes.
"""

from __future__ import annotations

import json
from enum import IntEnum
from pathlib import Path
from typing import Any

from raff2urdf import errors
from raff2urdf.inertia import ROUNDED
from raff2urdf.raff import check, reader, texts
from raff2urdf.raff.compound import VARIABLES
from raff2urdf.raff.document import LEAST_SIZE, UNITS_PER_METRE, DriveKind, JointType, LoopKind
from raff2urdf.raff.syntax import LARGEST_WHOLE, SPACES, STATEMENTS, TOKENS, Choice, Statement, whole
from raff2urdf.readers.urdf import LEAST_SPEED
from raff2urdf.residual import ROWS

FILE = Path(__file__).parent / "static" / "raff" / "definitions.js"

_HEAD = """\
// Generated from Python's definitions of RAFF by `make generated`: not to be edited.

"""


def definitions() -> dict[str, Any]:
    """Return every definition that both readers share, by its name in JavaScript."""
    return {
        "tokens": TOKENS,
        "spaces": SPACES,
        "numberWithUnit": reader.NUMBER_WITH_UNIT,
        "statements": {
            block: {word: _statement(one) for word, one in words.items()} for block, words in STATEMENTS.items()
        },
        "wanted": reader.WANTED,
        "labels": reader.LABELS,
        "counts": reader.COUNTS,
        "unitsPerMetre": dict(UNITS_PER_METRE),
        "jointTypes": _names(JointType),
        "loopKinds": _names(LoopKind),
        "driveKinds": _names(DriveKind),
        "rows": [ROWS[kind] for kind in LoopKind],
        "variables": {kind.value: dict(variables) for kind, variables in VARIABLES.items()},
        "reserved": check.RESERVED,
        "xmlName": check.XML_NAME,
        "limits": {
            "line": reader.LONGEST_LINE,
            "problems": reader.MOST_PROBLEMS,
            "whole": LARGEST_WHOLE,
            "leastSize": LEAST_SIZE,
            "largest": check.LARGEST,
            "smallest": check.SMALLEST,
            "leastSpeed": LEAST_SPEED,
            "rounded": ROUNDED,
            "message": errors.MOST_CHARACTERS,
            "shownProblems": errors.SHOWN,
            "excerpt": errors.WIDTH,
            "similarLength": errors.LONGEST,
            "similarWords": errors.MOST,
            "knownWords": errors.MOST_KNOWN,
        },
        "texts": {name: text for name, text in vars(texts).items() if name.isupper()},
    }


def module() -> str:
    """Return the module of JavaScript."""
    exports = (
        f"export const {name} = {json.dumps(value, indent=2, ensure_ascii=True)};\n"
        for name, value in definitions().items()
    )
    return _HEAD + "\n".join(exports)


def _statement(statement: Statement) -> dict[str, Any]:
    """Return what a statement is, without the functions that make its value."""
    found: dict[str, Any] = {"follows": statement.follows}
    for key in ("name", "repeats", "unless"):
        if getattr(statement, key):
            found[key] = getattr(statement, key)
    if statement.required is not None:
        found["required"] = statement.required
    if isinstance(statement.value, Choice):
        found["choice"] = {"what": statement.value.what, "words": list(statement.value.words)}
    if statement.value is whole:
        found["whole"] = True
    return found


def _names(kinds: type[IntEnum]) -> list[str]:
    return [kind.name.lower() for kind in kinds]


if __name__ == "__main__":
    FILE.write_text(module(), encoding="utf-8")
