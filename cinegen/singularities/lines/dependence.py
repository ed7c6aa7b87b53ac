"""What is said of lines that are dependent: which, why, and what motion it sets free."""

from __future__ import annotations

from dataclasses import dataclass, replace

from cinegen.singularities.lines import words
from cinegen.singularities.lines.dependent_set import DependentSet
from cinegen.singularities.lines.screw import Screw
from cinegen.singularities.lines.variety import Variety


@dataclass(frozen=True, eq=False)
class Dependence:
    """Why lines are dependent.

    Attributes:
        rank: of all lines together.
        sigma: the smallest singular value of all lines: how near to dependent they are.
        names: of the lines.
        sets: the sets that are dependent while no fewer of their lines are: all of the smallest size, then larger ones
            until the rank is explained. Those that span the same count as one.
        gained: screws that span all that is reciprocal to all lines: the motions that they leave free. One where the
            rank is 5.
        length: the characteristic length.
        nearly: whether the lines are only near to it.
    """

    rank: int
    sigma: float
    names: tuple[str, ...]
    sets: tuple[DependentSet, ...]
    gained: tuple[Screw, ...]
    length: float
    nearly: bool = False

    @property
    def lines(self) -> tuple[int, ...]:
        """The lines of the first set, counted from 0."""
        return self.sets[0].lines

    @property
    def variety(self) -> Variety:
        """Of the first set."""
        return self.sets[0].variety

    @property
    def reason(self) -> str:
        """Why, in words, without unit."""
        return self.words()

    def words(self, noun: str = "leg", unit: str = "") -> str:
        """Why, in words.

        Args:
            noun: what the lines are.
            unit: of length, as "mm".
        """
        reasons = "; ".join(words.reason(some, self.names, noun, unit, self.length) for some in self.sets)
        return f"nearly: {reasons}" if self.nearly else reasons

    def loosely(self) -> Dependence:
        """The same, said of lines that are only near to it."""
        return replace(self, nearly=True)
