"""What was found of cells: a configuration each, and how it was found."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class How(IntEnum):
    """How a cell was settled. 0 is a cell that nobody has looked at yet."""

    NOT_YET = 0
    NEIGHBOUR = 1
    """A neighbour's configuration led there: the wave."""
    SEARCH = 2
    """It was found from another start, and is where a wave began."""
    GIVEN = 3
    """The motors say it, and the loops were closed."""
    OPEN = 4
    """The motors say it, and the loops can't be closed on home's branch."""
    NOT_FOUND = 5
    """Neither neighbours nor all other starts led there."""
    TOO_FAR = 6
    """The links are too short for it, or too long: it is certain (`ReachBounds`)."""
    BEYOND = 7
    """The motors say it, and it is beyond joint limits."""

    @property
    def reached(self) -> bool:
        """Whether there is a configuration."""
        return self in (How.NEIGHBOUR, How.SEARCH, How.GIVEN)

    @property
    def words(self) -> str:
        """For a file."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True, eq=False)
class Settled:
    """Cells of a piece, the last axis fastest.

    Attributes:
        q: (n, nq) a configuration for each; not a number where there is none.
        how: (n,) `How`.
        solutions: (n,) how many there are that differ in what the motors do, up to whole turns; of motors, how many
            assembly modes. None unless asked for.
        solid_angle: (n,) of the directions that the node's z can have, sr; None unless asked for.
    """

    q: Array
    how: NDArray[np.uint8]
    solutions: NDArray[np.int32] | None = None
    solid_angle: Array | None = None
