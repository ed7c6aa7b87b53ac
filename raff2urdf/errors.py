"""What raff2urdf says when something is wrong: one root class, every problem with its place."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SourceLocation:
    """Where a word stands in a text: line and column count from 1, `length` is in characters."""

    line: int
    column: int
    length: int = 1


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong, where, and what it probably should be."""

    message: str
    source: str = ""
    place: SourceLocation | None = None
    text: str = ""  # the line it stands on, without its end

    def __str__(self) -> str:
        if self.place is None:
            return f"{self.source}: {self.message}" if self.source else self.message
        head = f"{self.source}:{self.place.line}:{self.place.column}: {self.message}"
        if not self.text:
            return head
        shown, column = _window(self.text, self.place.column)
        length = max(1, min(self.place.length, len(shown) - column + 1))
        return f"{head}\n    {shown}\n    {' ' * (column - 1)}{'^' * length}"


class RaffError(Exception):
    """Root of every error of this package.

    Attributes:
        problems: every problem found, in the order of the text; at least one.
    """

    def __init__(self, problems: str | Problem | Iterable[Problem]) -> None:
        if isinstance(problems, str):
            problems = Problem(problems)
        self.problems: tuple[Problem, ...] = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))

    def __reduce__(self) -> tuple[type[RaffError], tuple[tuple[Problem, ...]]]:
        return type(self), (self.problems,)


class RaffClosureError(RaffError):
    """A mechanism whose loops can't be closed; says which, by how much, and what would close them."""


class RaffWarning(UserWarning):
    """Something that was understood but is probably not what the author wants."""


def did_you_mean(word: str, known: Sequence[str]) -> str:
    """`": did you mean 'alpha'?"`, or a list of what exists when nothing is near."""
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    if near:
        return f": did you mean '{near[0]}'?"
    shown = list(known[:12])
    return f" (known: {', '.join(shown)}{', ...' if len(known) > len(shown) else ''})" if shown else ""


_WIDTH = 100


def _window(text: str, column: int) -> tuple[str, int]:
    """The part of a long line that surrounds `column`, and the column in it; tabs become one space."""
    text = "".join(c if c.isprintable() else " " for c in text)
    if len(text) <= _WIDTH:
        return text, column
    start = max(0, min(column - 1 - _WIDTH // 2, len(text) - _WIDTH))
    return text[start : start + _WIDTH], column - start
