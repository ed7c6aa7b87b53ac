"""Read RAFF text into a `Document`, or list every error in it with line, column and likely remedy."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from lark import Lark, Token, UnexpectedCharacters, UnexpectedToken

from raff2urdf.check import check_tree
from raff2urdf.document import Document, JointType, LoopKind, SourceText
from raff2urdf.errors import Problem, RaffError, SourceLocation, did_you_mean, sort_key
from raff2urdf.rules import Build, location_of

LONGEST_LINE = 10_000  # characters: no person writes such a line, and no error could show it
MOST_PROBLEMS = 100  # a file with more is not RAFF
LARGEST_FILE = 256 * 1024 * 1024  # bytes: about two million links


def read(path: str | Path) -> str:
    """Return the text of a RAFF file.

    Raises:
        RaffError: it can't be read, is too large, or is not UTF-8 text.
    """
    name = str(path)
    try:
        with open(path, "rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise RaffError(Problem(f"can't be read: {reason}", name)) from None
    if len(data) > LARGEST_FILE:
        raise RaffError(Problem(f"is larger than {LARGEST_FILE // 2**20} MiB: this is no RAFF file", name))
    at = data.find(b"\0")
    if at >= 0:
        line = data.count(b"\n", 0, at) + 1
        raise RaffError(Problem(f"line {line} holds a zero byte: this is a binary file, not RAFF text", name))
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise RaffError(Problem(f"line {line} is not UTF-8 text: a binary file, or another encoding", name)) from None


def load(path: str | Path) -> Document:
    """Read a RAFF file; see `loads`.

    Raises:
        RaffError: the file can't be read, or with every problem found in it.
    """
    return loads(read(path), str(path))


def loads(text: str, name: str = "<text>") -> Document:
    """Read RAFF text.

    The text may be an excerpt: constraints may name links that it lacks. `check`, `convert` and `cinegen.load` refuse
    that.

    Args:
        text: of a RAFF file.
        name: of the text, in errors.

    Raises:
        RaffError: with every problem: location, cause, likely remedy.
    """
    document = parse(text, name)
    check_tree(document)
    return document


def parse(text: str, name: str = "<text>") -> Document:
    """Return the document of a text.

    Each block is checked by itself; `raff2urdf.check` checks the whole.

    Args:
        text: of a RAFF file.
        name: of the text, in errors.

    Raises:
        RaffError: with every problem, up to `MOST_PROBLEMS`.
    """
    lines = [line.removesuffix("\r") for line in text.split("\n")]
    source = SourceText(name, tuple(lines))
    for number, line in enumerate(lines, 1):
        if len(line) > LONGEST_LINE:
            message = f"line {number} is {len(line)} characters long; at most {LONGEST_LINE} make sense"
            raise RaffError(Problem(message, name, SourceLocation(number, 1)))
    reading = _Reading(source)
    document = reading.run(text)
    problems = sorted(reading.problems or reading.missing, key=sort_key)
    if problems:
        raise RaffError(problems[:MOST_PROBLEMS])
    return document


# --- reading on after an error ----------------------------------------------------------------------------------

_PARAMETERS = ["theta", "r", "d", "alpha", "gamma", "epsilon"]
_WORDS: dict[str, list[str]] = {  # statements of each kind of block; "" is the file
    "": ["robot", "sensor", "units"],
    "robot": ["path", "base", "link", "frame", "constraint"],
    "base": ["parameters", "filename"],
    "link": ["parameters", "type", "pred", "limits", "velocity", "actuated", "name", "filename"],
    "frame": ["parameters", "pred", "name", "filename"],
    "parameters": _PARAMETERS,
    "constraint": ["link", "frame", "base", "type", "sensor"],
    "sensor": ["port", "translation", "rotation"],
    "limits": [],
    "filename": [],
}
_SHOWN = {"LBRACE": "'{'", "RBRACE": "'}'", "LPAR": "'('", "RPAR": "')'", "$END": "the end of the file"}
_SHOWN |= {"NUMBER": "a number", "STRING": 'a text in "..."', "WORD": "a name"}


class _Everywhere:
    """Terminals that lark's contextual lexer accepts everywhere, so that the parser finds the error."""

    always_accept = ("WORD", "NUMBER", "STRING", "LBRACE", "RBRACE", "LPAR", "RPAR")

    def process(self, stream: Iterator[Token]) -> Iterator[Token]:
        return stream


class _Parser(threading.local):
    """The parser and the builder of its document: made once in each thread (33 ms), used for one text at a time."""

    def __init__(self) -> None:
        self.build = Build()
        grammar = files("raff2urdf").joinpath("raff.lark").read_text(encoding="utf-8")
        postlex: Any = _Everywhere()
        self.lark = Lark(grammar, parser="lalr", lexer="contextual", postlex=postlex, transformer=self.build)


@cache
def _parser() -> _Parser:
    return _Parser()


@dataclass(slots=True)
class _Block:
    kind: str  # the word before its brace: robot, link, parameters...
    label: str  # with its number or name: "link 2"
    line: int


class _Tokens:
    """A stream of tokens that takes back a token."""

    def __init__(self, stream: Iterator[Token]) -> None:
        self.stream = stream
        self.back: list[Token] = []

    def __iter__(self) -> _Tokens:
        return self

    def __next__(self) -> Token:
        return self.back.pop() if self.back else next(self.stream)

    def push(self, token: Token) -> None:
        self.back.append(token)


class _StopReadingError(Exception):
    """What follows would only be guesses."""


class _Reading:
    """One pass over a text: feeds the parser, keeps track of the blocks, and goes on after most errors."""

    def __init__(self, source: SourceText) -> None:
        self.source = source
        self.problems: list[Problem] = []
        self.missing: list[Problem] = []  # reported only if there are no other problems
        self.open: list[_Block] = []
        self.closed: dict[str, _Block] = {}  # the last block of each kind, with the line of its closing brace
        self.header = SourceLocation(1, 1)
        self.last: tuple[str, str] = ("", "")  # the word to which a brace would belong, and what follows it

    def report(self, message: str, location: SourceLocation) -> None:
        self.problems.append(self.source.problem(message, location))

    def report_missing(self, message: str, location: SourceLocation) -> None:
        self.missing.append(self.source.problem(message, location))

    def run(self, text: str) -> Document:
        made = _parser()
        made.build.report, made.build.report_missing = self.report, self.report_missing
        self.parser: Any = made.lark.parse_interactive(text)
        self.tokens = _Tokens(self.parser.lexer_thread.lex(self.parser.parser_state))
        end = SourceLocation(max(1, len(self.source.lines)), 1)
        try:
            for token in self.tokens:
                end = SourceLocation(token.line or 1, (token.column or 1) + len(token))
                self.feed(token)
            return Document(**self.parser.feed_eof(), source=self.source)
        except UnexpectedToken:
            self.at_end(end)
        except UnexpectedCharacters as error:
            self.at_character(error)
        except _StopReadingError:
            pass
        return Document("")

    def feed(self, token: Token) -> None:
        """Feed one token to the parser; report a token that doesn't fit, and pass over it."""
        if len(self.problems) >= MOST_PROBLEMS:
            raise _StopReadingError
        if self.last[0] == "RAFF" and self.last[1] == "RAFF" and (token.line or 1) > self.header.line:
            self.report("a RAFF file begins with 'RAFF <name>', both on one line", self.header)
            raise _StopReadingError
        try:
            self.parser.feed_token(token)
        except UnexpectedToken as error:
            self.recover(token, error)
            return
        if token.type == "LBRACE":
            word, label = self.last
            self.open.append(_Block(word, label, token.line or 1))
        elif token.type == "RBRACE":
            block = self.open.pop()
            self.closed[block.kind] = _Block(block.kind, block.label, token.line or 1)
        elif token.type in ("NUMBER", "STRING", "WORD"):
            self.last = (self.last[0], f"{self.last[0]} {token}")
        elif token.type not in ("LPAR", "RPAR"):
            self.last = (str(token), str(token))
        if token.type == "RAFF":
            self.header = location_of(token)

    def here(self) -> str:
        return self.open[-1].kind if self.open else ""

    def where(self) -> str:
        return self.open[-1].label if self.open else "the file"

    def recover(self, token: Token, error: UnexpectedToken) -> None:
        """Report a token that doesn't fit, with its likely meaning, and find where to go on."""
        word, location, expected = str(token), location_of(token), set(error.expected)
        kind = self.here()
        shown = "'{'" if token.type == "LBRACE" else f"'{word}'"
        if "RAFF" in expected:
            self.report(f"a RAFF file begins with 'RAFF <name>', not with {shown}", location)
            raise _StopReadingError
        if expected == {"NUMBER"}:
            if token.type == "WORD":
                self.report(f"'{self.last[0]}' needs a number, and {shown} is not one{self.hint(word)}", location)
                self.substitute("NUMBER", "1", token)
                return
            self.report(f"'{self.last[0]}' needs {'two numbers' if kind == 'limits' else 'a number'} here", location)
            while self.parser.accepts() == {"NUMBER"}:
                self.substitute("NUMBER", "1", token)
            self.tokens.push(token)
            return
        if token.type == "WORD" and (expected == {"STRING"} or kind == "filename"):
            self.report(f'expected a text in "..." here, found {shown}', location)
            self.substitute("STRING", '""', token)
            return
        if not expected & {"RBRACE", "$END"}:  # within a statement, such as 'link {'
            wanted = sorted(_SHOWN.get(name, f"'{name.lower()}'") for name in expected)
            self.report(f"expected {' or '.join(wanted)} here, found {shown}", location)
            raise _StopReadingError
        if token.type == "RBRACE":
            robot = self.closed.get("robot")
            closed = f": {robot.label} was closed on line {robot.line}" if robot else ""
            self.report(f"a '}}' too many{closed}", location)
            raise _StopReadingError
        if token.type != "WORD":
            listed = ", ".join(f"'{w}'" for w in _WORDS.get(kind, [])) or "'}'"
            self.report(f"unexpected {shown} in {self.where()}: expected {listed}", location)
            self.skip(location.line)
            return
        self.stray(word, kind, location)

    def substitute(self, kind: str, text: str, token: Token) -> None:
        """Feed a token that fits instead of one that does not, so that reading can go on."""
        self.parser.feed_token(Token(kind, text, line=token.line, column=token.column))

    def hint(self, word: str) -> str:
        """Return the likely meaning of a word where a number should be."""
        if self.last[0] == "type":
            kinds: list[IntEnum] = list(LoopKind if self.here() == "constraint" else JointType)
            return f" ({', '.join(f'{kind.value} {kind.name.lower()}' for kind in kinds)})"
        if word[0].isdigit() and word.rstrip("umcdegra").replace(".", "", 1).isdigit():
            return " (numbers have no unit: lengths are in the file's `units`, angles in degrees)"
        return ""

    def stray(self, word: str, kind: str, location: SourceLocation) -> None:
        """Report a word that doesn't belong in this kind of block."""
        if kind and word in _WORDS[""]:
            self.report(f"'{word}' is inside {self.where()}: it belongs outside every robot", location)
            self.skip(location.line)
            return
        homes = [home for home, words in _WORDS.items() if word in words and home not in ("", kind)]
        outer = [home for home in homes if home in self.closed]
        if outer and not any(block.kind in homes for block in self.open):
            block = max((self.closed[home] for home in outer), key=lambda block: block.line)
            home = "a " * (block.kind != "parameters") + block.kind
            self.report(f"'{word}' is outside {home}: {block.label} was closed on line {block.line}", location)
            self.reopen(kind)
            return
        if kind == "parameters":
            self.report(f"unknown parameter '{word}'{did_you_mean(word, _PARAMETERS)}", location)
        elif homes:
            listed = " or ".join(f"'{home} {{ }}'" for home in homes)
            self.report(f"'{word}' does not belong in {self.where()}, but in {listed}", location)
        else:
            known = _WORDS.get(kind, [])
            self.report(f"unknown word '{word}' in {self.where()}{did_you_mean(word, known)}", location)
        self.skip(location.line)

    def skip(self, line: int) -> None:
        """Pass over what belongs to a stray word: a word after it on its line, its values, its block."""
        depth = 0
        word_may_follow = self.here() != "parameters"
        for token in self.tokens:
            if token.type == "LBRACE":
                depth += 1
            elif token.type == "RBRACE" and depth > 0:
                depth -= 1
                if depth == 0:
                    return
            elif depth == 0 and token.type == "WORD" and token.line == line and word_may_follow:
                pass
            elif depth == 0 and token.type not in ("NUMBER", "STRING", "LPAR", "RPAR"):
                self.tokens.push(token)
                return
            word_may_follow = False
        raise _StopReadingError

    def reopen(self, kind: str) -> None:
        """Pass over the remainder of a block that was closed too early, its second closing brace included."""
        depth = 0
        parts = _WORDS[kind]
        for token in self.tokens:
            if token.type == "LBRACE":
                depth += 1
            elif token.type == "RBRACE":
                if depth == 0:
                    return
                depth -= 1
            elif depth == 0 and str(token) in parts:
                self.tokens.push(token)
                return
        raise _StopReadingError

    def at_end(self, end: SourceLocation) -> None:
        if self.open and not self.problems:
            block = self.open[-1]
            self.report(f"the file ends inside {block.label}, opened on line {block.line}: a '}}' is missing", end)
        elif not self.problems:
            self.report("the file ends too early: a RAFF file begins with 'RAFF <name>'", end)

    def at_character(self, error: UnexpectedCharacters) -> None:
        location = SourceLocation(max(1, error.line), max(1, error.column))
        if error.char == '"':
            self.report("this text is not closed on its line: a '\"' is missing", location)
        elif error.char == "/":
            self.report("a lone '/': comments begin with '//'", location)
        else:
            self.report(f"unexpected character {error.char!r}", location)
