"""Barriers: linear bounds of the joint velocities that neither tasks nor objectives violate."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from cinegen.arrays import Array
from cinegen.ik.state import State


class Bounds(NamedTuple):
    """Bounds rows v <= most of the joint velocities v.

    Attributes:
        rows: (m, nv) m/s per rad/s and m/s.
        most: (m,) m/s; negative where the mechanism has to retreat. Where velocity limits or other bounds do not allow
            that, it retreats more slowly, or stops; it never advances.
    """

    rows: Array
    most: Array


class Barrier(Protocol):
    """Object with the methods `bounds` and `clear`.

    A tick keeps the bounds exactly, like joint limits: B. Faverjon and P. Tournassoud, "A local based approach for path
    planning of manipulators with a high number of degrees of freedom", IEEE Int. Conf. Robotics and Automation, 1987.
    The bounds are linear, what they stand for is not: so each step is checked by `clear` before it is made.
    """

    def bounds(self, state: State) -> Bounds:
        """Return the bounds of the next tick."""
        ...

    def clear(self, state: State, q: Array) -> float:
        """Return the fraction of the step to q (nq,) that the mechanism may make: 1 for all of it."""
        ...
