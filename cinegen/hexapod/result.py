"""Results: the assembly modes of a platform on six legs, with an account of all complex solutions."""

from __future__ import annotations

from dataclasses import dataclass

from cinegen.arrays import Array, Integers


@dataclass(frozen=True)
class SolutionCounts:
    """Numbers of all complex solutions: each is real, complex, infinite or lost.

    Attributes:
        real: real solutions, each with its multiplicity.
        complex: solutions that are not real.
        infinite: solutions at infinity.
        multiple: how many of the real and complex ones coincide with others, or lie where joints are locked.
        lost: solutions of which nothing is known.
    """

    real: int = 0
    complex: int = 0
    infinite: int = 0
    multiple: int = 0
    lost: int = 0

    @property
    def total(self) -> int:
        """Number of solutions."""
        return self.real + self.complex + self.infinite + self.lost


@dataclass(frozen=True, eq=False)
class NearestPlacement:
    """The placement nearest to leg lengths with which the platform can't be assembled.

    Attributes:
        placement: (4, 4) where the sum of squared length errors has its smallest known minimum.
        errors: (6,) length of each leg there minus the required one.
    """

    placement: Array
    errors: Array


@dataclass(frozen=True, eq=False)
class PlatformModes:
    """All placements of a platform in the base frame for six leg lengths.

    Where legs let the platform move, on a curve of configurations, placements are the points of it that were found.

    Attributes:
        placements: (n, 4, 4).
        coincident: (n,) how many solutions coincide in each: 1 for a regular one.
        counts: of all complex solutions: 40, or 16 if legs meet in pairs on the platform or on the base.
        complete: whether these are all modes: no solution was lost, and no curve of configurations is possible.
        method: how they were computed, and what is not excluded.
        closest: if there is no mode, the nearest placement.
        almost_surely: whether `complete` holds with probability one only: general lengths leave fewer solutions than
            the theorem allows, and their number was found from a random start.
    """

    placements: Array
    coincident: Integers
    counts: SolutionCounts
    complete: bool
    method: str
    closest: NearestPlacement | None = None
    almost_surely: bool = False

    def __repr__(self) -> str:
        worth = ", all with probability one" if self.almost_surely else ", proved to be all" if self.complete else ""
        return f"<PlatformModes: {len(self.placements)}{worth}>"

    @property
    def proved(self) -> bool:
        """True if it is proved that these are all modes."""
        return self.complete and not self.almost_surely
