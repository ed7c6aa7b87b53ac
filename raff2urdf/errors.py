"""Errors and warnings of raff2urdf: one root class, and every problem with its location."""

from __future__ import annotations

import difflib
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True, order=True)
class SourceLocation:
    """Location of a word in a text: line and column count from 1, `length` is in characters."""

    line: int
    column: int
    length: int = 1


MOST_CHARACTERS = 4000  # of a message


def shortened(text: str) -> str:
    """Return the begin and the end of a message that quotes a very long text."""
    if len(text) <= MOST_CHARACTERS:
        return text
    return f"{text[: MOST_CHARACTERS // 2]} ... {text[-MOST_CHARACTERS // 2 :]}"


@dataclass(frozen=True, slots=True)
class Problem:
    """A problem in a text: what is wrong, where, and the likely remedy."""

    message: str
    source: str = ""
    location: SourceLocation | None = None
    text: str = ""  # the line of the location, without its end

    def __str__(self) -> str:
        message = shortened(self.message)
        if self.location is None:
            return f"{self.source}: {message}" if self.source else message
        head = f"{self.source}:{self.location.line}:{self.location.column}: {message}"
        if not self.text:
            return head
        shown, column = _excerpt(self.text, self.location.column)
        length = max(1, min(self.location.length, len(shown) - column + 1))
        return f"{head}\n    {shown}\n    {' ' * (column - 1)}{'^' * length}"


SHOWN = 20  # problems in the text of an error


def listed(problems: Sequence[object]) -> str:
    """Return the first problems, a line each, and how many there are more."""
    more = len(problems) - SHOWN
    return "\n".join([*map(str, problems[:SHOWN]), *([f"and {more} more"] if more > 0 else [])])


class RaffError(Exception):
    """Root of every error of this package.

    Attributes:
        problems: every problem found, in the order of the text; at least one.
    """

    def __init__(self, problems: str | Problem | Iterable[Problem]) -> None:
        if isinstance(problems, str):
            problems = Problem(problems)
        if isinstance(problems, Problem):
            problems = [problems]
        self.problems = tuple(sorted(problems, key=lambda problem: problem.location or SourceLocation(0, 0)))
        super().__init__(listed(self.problems))

    def __reduce__(self) -> tuple[type[RaffError], tuple[tuple[Problem, ...]]]:
        return type(self), (self.problems,)


Caught = type[Exception] | tuple[type[Exception], ...]


@contextmanager
def raised_as(kind: Callable[[str], Exception], caught: Caught, before: str = "", after: str = "") -> Iterator[None]:
    """Raise errors as another kind of error, with the same text between texts before and after it."""
    try:
        yield
    except caught as error:
        raise kind(f"{before}{error}{after}") from None


def run_all(checks: Iterable[Callable[[], object]]) -> None:
    """Run checks that don't need each other.

    Raises:
        RaffError: with every problem that they found.
    """
    problems = list[Problem]()
    for check in checks:
        try:
            check()
        except RaffError as error:
            problems += error.problems
    if problems:
        raise RaffError(problems)


class RaffClosureError(RaffError):
    """Loops that cannot be closed: which ones, their least gaps, and which weaker kinds of loop would close."""


class NearlyRedundantError(RaffClosureError):
    """Loops that rounded numbers keep from closing, or from moving: see `raff2urdf.loops.near_redundancy`."""


class RaffWarning(UserWarning):
    """Input that is valid but probably not intended."""


def warn(message: str, category: type[Warning] = RaffWarning) -> None:
    """Warn the program that calls these packages: the warning is of its line, however deep in them it arose."""
    frame, level = sys._getframe(1), 2
    ours = ("raff2urdf", "cinegen", "functools", "contextlib")  # cached properties
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] in ours:
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)


LONGEST, MOST = 100, 1000  # length and number of words that are compared
NEAR = 3  # names that are proposed
MOST_KNOWN = 12  # words in a list of known ones
_SIMILAR = 0.6  # least ratio of similar words, as difflib computes it


def near_names(word: str, known: Iterable[str]) -> list[str]:
    """Return the known names that are nearest to a word; none if all are far, or if too many are as near.

    A name is near if at most every fourth letter must be changed, inserted, left out or exchanged with the next one,
    upper and lower case being the same. One letter always may differ, two where names of four or more begin alike, and
    the end may be left out.
    """
    names = [*known]
    return _near(word, names, _similar(word, names))


def _similar(word: str, known: Sequence[str]) -> list[str]:
    """Return the known names that share most letters with a word, the most similar first."""
    if not 0 < len(word) <= LONGEST:  # the time grows with squares of lengths
        return []
    matcher, ratios = difflib.SequenceMatcher(b=word), dict[str, float]()
    for name in known[:MOST]:
        matcher.set_seq1(name)
        if len(name) <= LONGEST and matcher.quick_ratio() >= _SIMILAR and matcher.ratio() >= _SIMILAR:
            ratios[name] = matcher.ratio()
    return sorted(ratios, key=ratios.__getitem__, reverse=True)


def _near(word: str, known: Sequence[str], similar: list[str]) -> list[str]:
    lower = word.casefold()
    same_letters = [name for name in known if len(name) <= LONGEST and name.casefold() == lower]
    distances = {name: _edits(lower, name.casefold()) for name in [*similar[: NEAR + 1], *same_letters]}
    least = min(distances.values(), default=0)
    near = [name for name in dict.fromkeys(known) if distances.get(name) == least]
    begins = all(name.casefold().startswith(lower) or lower.startswith(name.casefold()) for name in near)
    same = len(word) > 3 and all(name[0].casefold() == lower[0] for name in near)
    return near if len(near) <= NEAR and (begins or least <= max(1 + same, len(word) // 4)) else []


def _edits(word: str, other: str) -> int:
    """Return the number of edits between words: Damerau and Levenshtein's distance, no part being edited twice."""
    before, last = [0] * (len(other) + 1), list(range(len(other) + 1))
    for i, letter in enumerate(word, 1):
        row = [i]
        for j, other_letter in enumerate(other, 1):
            row.append(min(last[j] + 1, row[-1] + 1, last[j - 1] + (letter != other_letter)))
            if i > 1 and j > 1 and letter == other[j - 2] and other_letter == word[i - 2]:
                row[-1] = min(row[-1], before[j - 2] + 1)
        before, last = last, row
    return last[-1]


def did_you_mean(word: str, known: Sequence[str]) -> str:
    """Return `": did you mean 'alpha'?"`, or a list of the known words, similar ones first, if none is near, see
    `near_names`."""
    similar = _similar(word, known)
    if near := _near(word, known, similar):
        meant = "' or '".join(near)
        return f": did you mean '{meant}'?"
    names = [*dict.fromkeys([*similar, *known])]
    listed, more = ", ".join(name[:LONGEST] for name in names[:MOST_KNOWN]), ", ..." if names[MOST_KNOWN:] else ""
    return f" (known: {listed}{more})" if names else ""


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: "1 joint", "2 joints"."""
    return f"{number} {noun}{'s' * (number != 1)}"


def first_of(names: Sequence[object], most: int) -> str:
    """Return the first of some names, and how many there are more."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(map(str, names[:most])) + more


def duplicates(things: Iterable[T], name: Callable[[T], object]) -> Iterator[tuple[T, T]]:
    """Yield each thing whose name an earlier one has, after the first one of that name."""
    known: dict[object, T] = {}
    for thing in things:
        first = known.setdefault(name(thing), thing)
        if first is not thing:
            yield first, thing


def defined_twice(what: str, line: int | None, hint: str = "") -> str:
    """Return the error for a second definition; `line` is that of the first one, `hint` how this one is changed."""
    return f"{what} is defined twice{first_on(line)}: change one of them{hint}"


def first_on(line: int | None) -> str:
    """Return the line of a first definition, as messages name it."""
    return f", first on line {line}" if line else ""


def limits_reversed(what: str, low: float, high: float) -> str:
    """Return the error for a lower limit above the upper one."""
    return f"the lower limit {low:g} of {what} is above its upper limit {high:g}: swap them"


WIDTH = 100


def _excerpt(text: str, column: int) -> tuple[str, int]:
    """Return the part of a long line around `column`, and the column in it; tabs become one space."""
    text = "".join(c if c.isprintable() else " " for c in text)
    start = max(0, min(column - 1 - WIDTH // 2, len(text) - WIDTH))
    return text[start : start + WIDTH], column - start
