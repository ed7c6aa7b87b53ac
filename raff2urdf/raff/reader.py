"""Read RAFF text into a `Document`, or list every error in it with line, column and likely remedy."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from enum import IntEnum
from pathlib import Path
from typing import Any, NoReturn

from raff2urdf.errors import Problem, RaffError, SourceLocation, did_you_mean
from raff2urdf.files import read_bytes
from raff2urdf.raff.check import check_tree
from raff2urdf.raff.document import UNITS_PER_METRE, Document, JointType, LoopKind
from raff2urdf.raff.source import SourceText
from raff2urdf.raff.syntax import STATEMENTS, Block
from raff2urdf.raff.tokens import Token, tokens
from raff2urdf.shipped import find_robot

LONGEST_LINE = 10_000  # characters: no person writes such a line, and no error could show it
MOST_PROBLEMS = 100  # a file with more is not RAFF
LARGEST_FILE = 256 * 1024 * 1024  # bytes: about two million links


def read(path: str | Path) -> str:
    """Return the text of a RAFF file.

    Raises:
        RaffError: it can't be read, is too large, or is not UTF-8 text.
    """
    name = str(path)
    data = read_bytes(path, LARGEST_FILE + 1)
    if len(data) > LARGEST_FILE:
        raise RaffError(Problem(f"is larger than {LARGEST_FILE // 2**20} MiB: this is not a RAFF file", name))
    at = data.find(b"\0")
    if at >= 0:
        line = data.count(b"\n", 0, at) + 1
        raise RaffError(Problem(f"line {line} holds a zero byte: this is a binary file, not RAFF text", name))
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise RaffError(Problem(f"line {line} is not UTF-8 text: save the file as UTF-8", name)) from None


def load(path: str | Path) -> Document:
    """Read a RAFF file, or that of a shipped robot by its name; see `loads`.

    Raises:
        RaffError: the file can't be read, or with every problem found in it.
    """
    path = find_robot(path)
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

    Each block is checked by itself; `raff2urdf.raff.check` checks the whole.

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
            message = f"line {number} is {len(line)} characters long; at most {LONGEST_LINE} are allowed"
            raise RaffError(Problem(message, name, SourceLocation(number, 1)))
    reading = _Reading(source)
    document = reading.run()
    if problems := reading.problems or reading.missing:
        raise RaffError(problems[:MOST_PROBLEMS])
    return document


# --- reading on after an error ----------------------------------------------------------------------------------

WANTED = {"STRING": 'a text in "..."', "WORD": "a name", "NAME": 'a name or a text in "..."'}
WANTED["MORE"] = "')' or a number"
LABELS = {"base": "the base", "parameters": "the parameter block", "constraint": "the constraint"}
LABELS |= {"limits": "the limits", "filename": "the list of files", "inertial": "the inertial"}
LABELS |= {"centre": "the centre", "moments": "the moments", "products": "the products"}
NUMBER_WITH_UNIT = "(?P<number>-?[0-9]+(?:[.][0-9]*)?)(?P<unit>[umcdegrak]*)"  # such as 5mm
DECIMAL_COMMA = "-?[0-9]+,[0-9]+"
COUNTS = {"limits": "two numbers", **dict.fromkeys(("centre", "moments", "products"), "three numbers")}


class _StopReadingError(Exception):
    """Reading ends here: errors in the remainder of the text would only be guesses."""


class _Reading:
    """One pass over a text, by `STATEMENTS`; it goes on after most errors.

    Attributes:
        problems: that were found.
        missing: statements that blocks lack; reported only if there are no other problems.
    """

    def __init__(self, source: SourceText) -> None:
        self.source = source
        self.problems: list[Problem] = []
        self.missing: list[Problem] = []
        self.open = [Block("", "the file", 1)]
        self.closed: dict[str, tuple[str, int]] = {}  # the last block of each kind: its label, and the line of its end
        self.tokens = tokens(source.lines)
        self.current = next(self.tokens)

    def report(self, message: str, location: SourceLocation) -> None:
        self.problems.append(self.source.problem(message, location))
        if len(self.problems) >= MOST_PROBLEMS:
            raise _StopReadingError

    def stop(self, message: str, token: Token) -> NoReturn:
        """Report an error after which nothing more can be understood."""
        self.report(message, token.location)
        raise _StopReadingError

    def run(self) -> Document:
        file = self.open[0]
        with suppress(_StopReadingError):
            name = self.header()
            while not self.ends(file):
                self.statement(file)
            robots, sensors = (tuple(file.values.pop(word, ())) for word in ("robots", "sensors"))
            stated = "units" in file.values
            return Document(name, robots, sensors, **file.values, states_units=stated, source=self.source)
        return Document("")

    @property
    def token(self) -> Token:
        """The token to be read next."""
        if self.current.kind == "ILLEGAL":
            text = self.current.text
            known = {
                '"': "this text is not closed on its line: a '\"' is missing",
                "/": "a lone '/': comments begin with '//'",
            }
            self.stop(known.get(text) or f"unexpected character {text!r}: write a space for it", self.current)
        return self.current

    def take(self) -> Token:
        """Return the next token, and advance."""
        token = self.token
        self.current = next(self.tokens, token)
        return token

    def header(self) -> str:
        """Return the name in the first line."""
        first = self.token
        if first.kind != "END" and first.text != "RAFF":
            hint = ": a URDF, SDF or MJCF is read by its ending" if first.text.startswith("<") else ""
            self.stop(f"a RAFF file begins with 'RAFF <name>', not with '{first.text}'{hint}", first)
        self.take()
        if self.token.kind == "END":
            self.stop("the file ends too early: a RAFF file begins with 'RAFF <name>'", self.token)
        if self.token.line > first.line:
            self.stop("a RAFF file begins with 'RAFF <name>', both on one line", first)
        return self.expect("NAME").string

    # --- by the table ---------------------------------------------------------------------------------------------

    def statement(self, block: Block) -> None:
        """Read a statement, and add its value to the block."""
        statement = STATEMENTS[block.kind].get(self.token.text)
        if statement is None or self.token.kind != "WORD":
            self.unfitting(block, self.take())
            return
        word, values, inner = self.take(), list[Token](), block
        follows = statement.follows.split()
        for kind in follows:
            if kind == "{":
                label = LABELS.get(word.text) or " ".join([word.text, *(token.text for token in values)])
                inner = Block(word.text, label, self.expect(kind).line)
                self.open.append(inner)
            elif kind == "}":
                while not self.ends(inner):
                    self.unfitting(inner, self.take())
            else:
                values += self.values(kind, word, values)
        arguments: list[Any] = values if follows[:1] not in ([], ["{"]) or "}" in follows else [word]
        location = (values if values and block.kind != "parameters" else [word])[0].location
        if follows[-1:] == ["{"]:
            while not self.ends(inner):
                self.statement(inner)
            for name, member in STATEMENTS[inner.kind].items():
                if member.required is not None and not {name, member.unless} & inner.values.keys():
                    message = f"{inner.label} has no '{name}'{member.required}: add it"
                    self.missing.append(self.source.problem(message, location))
            arguments = [inner, *arguments]
        block.add(self.report, statement, word, statement.value(self.report, *arguments), location)

    def values(self, kind: str, word: Token, before: Sequence[Token]) -> Iterator[Token]:
        """Read the values of a kind that follow a word and those before; yield them, without parentheses."""
        if kind == "STRING*":
            while self.token.kind in ("STRING", "WORD"):
                yield self.expect("STRING")
        elif kind == "NUMBER" and before and before[-1].kind == "MISSING":
            yield before[-1]
        elif kind.startswith("NUMBER"):
            yield self.number(word)
            while kind == "NUMBER+" and self.token.kind != ")":
                yield self.expect("NUMBER" if self.token.kind == "NUMBER" else "MORE")
        else:
            yield from (token for token in [self.expect(kind)] if kind not in "()")

    def ends(self, block: Block) -> bool:
        """Return whether a block ends here, and read its closing brace."""
        if self.token.kind == "END":
            if block.kind:
                self.at_end("a '}'")
            return True
        if not block.kind or self.token.kind != "}":
            return False
        self.open.pop()
        self.closed[block.kind] = block.label, self.take().line
        return True

    def number(self, word: Token) -> Token:
        """Return the number after a word; if there is none, 1."""
        token = self.token
        if token.kind == "WORD":
            hint = self.hint(word, token)
            self.report(f"'{word.text}' needs a number, and '{token.text}' is not one{hint}", token.location)
            return self.take()._replace(kind="NUMBER", text="1")
        if token.kind in ("NUMBER", "END"):
            return self.expect("NUMBER")
        wanted = COUNTS.get(word.text, "a number")
        self.report(f"'{word.text}' needs {wanted} here", token.location)
        return token._replace(kind="MISSING", text="1")

    def expect(self, kind: str) -> Token:
        """Return the current token, which must be of this kind, and advance."""
        token, shown = self.token, WANTED.get(kind, f"'{kind}'")
        if token.kind in (kind, *(("WORD", "STRING") if kind == "NAME" else ())):
            return self.take()
        if token.kind == "END":
            self.at_end(shown)
        message = f"expected {shown} here, found '{token.text}'"
        if kind == "STRING" and token.kind == "WORD":
            self.report(f"{message}: put it in quotation marks", token.location)
            return self.take()._replace(kind="STRING", text='""')
        self.stop(message, token)

    # --- what does not fit it -------------------------------------------------------------------------------------

    def at_end(self, missing: str) -> NoReturn:
        block = self.open[-1]
        if not self.problems and block.kind:
            self.stop(f"the file ends inside {block.label}, opened on line {block.line}: a '}}' is missing", self.token)
        if not self.problems:
            self.stop(f"the file ends too early: {missing} is missing", self.token)
        raise _StopReadingError

    def hint(self, word: Token, token: Token) -> str:
        """Return the likely meaning of a word where a number should be."""
        if word.text == "type":
            kinds: list[IntEnum] = list(LoopKind if self.open[-1].kind == "constraint" else JointType)
            near = difflib.get_close_matches(token.text.lower(), [kind.name.lower() for kind in kinds], n=1)
            meant = [f": write 'type {kind.value}'" for kind in kinds if kind.name.lower() in near]
            return f" ({', '.join(f'{kind.value} {kind.name.lower()}' for kind in kinds)}){''.join(meant)}"
        if match := re.fullmatch(NUMBER_WITH_UNIT, token.text):
            stated = self.open[0].values.get("units", "mm")
            units = stated if stated in UNITS_PER_METRE else "mm"
            factor = UNITS_PER_METRE[units] / UNITS_PER_METRE.get(match["unit"], UNITS_PER_METRE[units])
            why = (
                f" (numbers have no unit: lengths are in the file's `units`, here {units}; angles in degrees, "
                "masses in kg)"
            )
            return f": write {float(match['number']) * factor:.10g}{why}"
        if re.fullmatch(DECIMAL_COMMA, token.text):
            return f": write {token.text.replace(',', '.')}"
        return ""

    def unfitting(self, block: Block, token: Token) -> None:
        """Report a token that doesn't belong in a block, with its likely meaning, and find where to go on."""
        word, known = token.text, list(STATEMENTS[block.kind])
        homes = [home for home, words in STATEMENTS.items() if word in words and home not in ("", block.kind)]
        outer = [home for home in homes if home in self.closed]
        if token.kind == "}":
            label, line = self.closed.get("robot", ("", 0))
            remedy = f"{label} was closed on line {line}" if label else "remove it"
            self.stop(f"one '}}' too many: {remedy}", token)
        if token.kind != "WORD":
            listed = ", ".join(f"'{term}'" for term in known) or "'}'"
            message = f"unexpected '{word}' in {block.label}: expected {listed}"
        elif block.kind and word in STATEMENTS[""]:
            message = f"'{word}' is inside {block.label}: it belongs outside every robot"
        elif outer and not any(opened.kind in homes for opened in self.open):
            home = max(outer, key=lambda kind: self.closed[kind][1])
            label, line = self.closed[home]
            name = "a parameter block" if home == "parameters" else f"a {home}"
            closed = f"{label} was closed on line {line}"
            self.report(f"'{word}' is outside {name}: {closed}; remove that '}}'", token.location)
            self.reopen(known)
            return
        elif block.kind == "parameters":
            message = f"unknown parameter '{word}'{did_you_mean(word, known)}"
        elif homes:
            listed = " or ".join(f"'{home} {{ }}'" for home in homes)
            message = f"'{word}' does not belong in {block.label}, but in {listed}"
        else:
            message = f"unknown word '{word}' in {block.label}{did_you_mean(word, known)}"
        self.report(message, token.location)
        self.skip(token.line, known, block.kind != "parameters")

    def skip(self, line: int, known: Collection[str], word_may_follow: bool) -> None:
        """Pass over what belongs to a stray word: a word after it on its line, its values, its block."""
        depth = 0
        while self.token.kind != "END":
            kind = self.token.kind
            if kind == "}" and depth == 1:
                self.take()
                return
            depth += (kind == "{") - (kind == "}" and depth > 0)
            name = word_may_follow and kind == "WORD" and self.token.line == line and self.token.text not in known
            if depth == 0 and not name and kind not in ("NUMBER", "STRING", "(", ")"):
                return
            word_may_follow = False
            self.take()
        raise _StopReadingError

    def reopen(self, known: Collection[str]) -> None:
        """Pass over the remainder of a block that was closed too early, its second closing brace included."""
        depth = 0
        while self.token.kind != "END":
            if depth == 0 and self.token.kind == "WORD" and self.token.text in known:
                return
            depth += (self.token.kind == "{") - (self.token.kind == "}")
            self.take()
            if depth < 0:
                return
        raise _StopReadingError
