"""What a mechanism must not run into: bounds of its velocities that no task and no objective breaks."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cinegen.ik.objectives import State

Array = NDArray[np.float64]


class Bounds(NamedTuple):
    """Velocities v are allowed where rows v <= most.

    Attributes:
        rows: (m, nv) m/s by rad/s and m/s.
        most: (m,) m/s; below 0 where the mechanism has to go back. Where joints can't go so fast, or bounds contradict
            each other, it goes back slower, or stays; it never goes on.
    """

    rows: Array
    most: Array


class Barrier(Protocol):
    """Anything with the methods `bounds` and `clear`.

    A tick keeps the bounds exactly, as it keeps limits of joints: B. Faverjon and P. Tournassoud, "A local based
    approach for path planning of manipulators with a high number of degrees of freedom", IEEE Int. Conf. Robotics and
    Automation, 1987. They are linear and what they stand for is not, so every step is asked about before it is made.
    """

    def bounds(self, state: State) -> Bounds:
        """What holds in the next tick."""
        ...

    def clear(self, state: State, q: Array) -> float:
        """Which part of the way from where it is to q (nq,) the mechanism may go: 1 for all of it."""
        ...
