"""Highlighting of RAFF in the site, by the tokens and the statements of its reader."""

from typing import ClassVar

from pygments.lexer import RegexLexer
from pygments.token import Comment, Keyword, Name, Number, Punctuation, String, Text

from raff2urdf.raff.syntax import STATEMENTS
from raff2urdf.raff.tokens import TOKENS

_BLOCKS = {word for some in STATEMENTS.values() for word, statement in some.items() if statement.follows.endswith("{")}
_WORDS = {word for some in STATEMENTS.values() for word in some} | {"RAFF"}


def _of_word(lexer, match):
    word = match[0]
    kind = Keyword.Type if word in _BLOCKS else Keyword if word in _WORDS else Name
    yield match.start(), kind, word


class RaffLexer(RegexLexer):
    """Marks the tokens of RAFF; words whatever block they are in, since pages show excerpts."""

    name, aliases, filenames = "RAFF", ["raff"], ["*.raff"]
    tokens: ClassVar = {
        "root": [
            (r"//.*", Comment.Single),
            (TOKENS["NUMBER"], Number),
            (TOKENS["STRING"], String),
            (TOKENS["WORD"], _of_word),
            (TOKENS["MARK"], Punctuation),
            (r"\s+", Text),
            (r".", Text),
        ]
    }
