"""Tokens of a RAFF file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from raff2urdf.errors import SourceLocation

SPACES = r"\t-\r\x1c- \x85\xa0\u1680\u2000-\u200a\u2028\u2029\u202f\u205f\u3000"
"""Unicode's white space, as in the brackets of a regular expression."""

OF_WORDS = rf'[^{SPACES}{{}}()"/]'

TOKENS = {
    "": r"[ \t\f\r]+|//.*",
    "NUMBER": rf"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?(?!{OF_WORDS})",  # `5mm` is a word
    "STRING": r'"[^"]*"',
    "WORD": f"{OF_WORDS}+",
    "MARK": r"[{}()]",
    "ILLEGAL": ".",
}
"""Regular expressions of the tokens of a line, by kind: the first that matches counts. The empty kind separates."""

_TOKEN = re.compile("|".join(f"(?P<{kind}>{pattern})" if kind else pattern for kind, pattern in TOKENS.items()))


class Token(NamedTuple):
    """A token of a text: its kind is NUMBER, STRING, WORD, ILLEGAL or END; of a brace or parenthesis, itself."""

    kind: str
    text: str
    line: int
    column: int

    @property
    def location(self) -> SourceLocation:
        """Location in the text."""
        return SourceLocation(self.line, self.column, len(self.text))

    @property
    def string(self) -> str:
        """The text without its quotation marks."""
        return self.text[1:-1] if self.kind == "STRING" else self.text


def tokens(lines: Sequence[str]) -> Iterator[Token]:
    """Yield the tokens of a text; the last one is of the kind END."""
    end = Token("END", "", max(1, len(lines)), 1)
    for number, line in enumerate(lines, 1):
        for match in _TOKEN.finditer(line):
            if kind := match.lastgroup:
                token = Token(match[0] if kind == "MARK" else kind, match[0], number, match.start() + 1)
                end = Token("END", "", number, match.end() + 1)
                yield token
    yield end
