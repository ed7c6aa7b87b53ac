"""Texts that documents are read from, and locations in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from raff2urdf.errors import Problem, SourceLocation

Locations = Mapping[str, SourceLocation]


@dataclass(frozen=True, slots=True, kw_only=True)
class Located:
    """A statement of a text, and the `locations` of its words."""

    locations: Locations = field(default_factory=dict, compare=False, repr=False)

    def line(self, word: str) -> int | None:
        """Return the line of a word; None if it is not in the text."""
        return self.locations[word].line if word in self.locations else None


@dataclass(frozen=True, slots=True)
class SourceText:
    """The text that a document was read from, for error messages."""

    name: str = "<document>"
    lines: tuple[str, ...] = ()

    def problem(self, message: str, location: SourceLocation | None = None) -> Problem:
        """Return a problem with the name of this text and the line of the location."""
        text = self.lines[location.line - 1] if location and 0 < location.line <= len(self.lines) else ""
        return Problem(message, self.name, location, text)
