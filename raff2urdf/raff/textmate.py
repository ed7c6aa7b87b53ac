"""The grammar of RAFF as editors take it for highlighting: TextMate's format, made of the table of statements.

Each rule has a regular expression that is tried in a line, or two that begin and end a region with rules of its own
(https://macromates.com/manual/en/language_grammars). Words that a block can't hold are marked as illegal.
"""

from __future__ import annotations

from typing import Any

from raff2urdf.raff.document import UNITS_PER_METRE, CompoundKind
from raff2urdf.raff.syntax import STATEMENTS, Statement
from raff2urdf.raff.tokens import OF_WORDS, TOKENS

Rule = dict[str, Any]

_VALUES = {"units": tuple(UNITS_PER_METRE), "joint": tuple(kind.value for kind in CompoundKind)}
"""Words that may follow others."""

_TOKENS: list[Rule] = [
    {"match": "//.*", "name": "comment.line.double-slash.raff"},
    {"match": TOKENS["NUMBER"], "name": "constant.numeric.raff"},
    {"match": TOKENS["STRING"], "name": "string.quoted.double.raff"},
    {"match": r"[()]", "name": "punctuation.section.parens.raff"},
]
_ILLEGAL: Rule = {"match": rf"{TOKENS['WORD']}|[\"/]", "name": "invalid.illegal.raff"}
_BRACE = {"0": {"name": "punctuation.section.block.raff"}}


def grammar() -> Rule:
    """Return the grammar."""
    return {
        "name": "RAFF",
        "scopeName": "source.raff",
        "fileTypes": ["raff"],
        "patterns": [
            {
                "match": rf"^\s*(RAFF)\s+({TOKENS['STRING']}|{TOKENS['WORD']})",
                "captures": {"1": {"name": "keyword.control.raff"}, "2": {"name": "entity.name.raff"}},
            },
            {"include": "#file"},
        ],
        "repository": {_key(kind): {"patterns": _rules(kind)} for kind in STATEMENTS},
    }


def _rules(kind: str) -> list[Rule]:
    """Return the rules of a block; the file is the block without a name."""
    return [*(_rule(word, statement) for word, statement in STATEMENTS[kind].items()), *_TOKENS, _ILLEGAL]


def _rule(word: str, statement: Statement) -> Rule:
    alone = rf"(?<!{OF_WORDS}){word}(?!{OF_WORDS})"
    if "{" not in statement.follows:
        if word in _VALUES and statement.follows == "WORD":
            return {
                "match": rf"({alone})(?:\s+({'|'.join(_VALUES[word])})(?!{OF_WORDS}))?",
                "captures": {"1": {"name": "keyword.other.raff"}, "2": {"name": "constant.language.raff"}},
            }
        return {"match": alone, "name": "keyword.other.raff"}
    name: Rule = {"match": TOKENS["WORD"], "name": "entity.name.raff"}
    block: Rule = {
        "begin": r"\{", "end": r"\}", "beginCaptures": _BRACE, "endCaptures": _BRACE,
        "patterns": [{"include": f"#{_key(word)}"}],
    }  # fmt: skip
    named = statement.follows.startswith(("NAME", "WORD"))
    return {
        "begin": alone, "end": r"(?<=\})", "beginCaptures": {"0": {"name": "storage.type.raff"}},
        "patterns": [block, *_TOKENS, name if named else _ILLEGAL],
    }  # fmt: skip


def _key(kind: str) -> str:
    return kind or "file"
