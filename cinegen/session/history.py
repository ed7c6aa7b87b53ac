"""Gestures that can be undone, and done again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cinegen.session.driven import Driven, Pinned

Array = NDArray[np.float64]

_MOST = 100  # gestures that are remembered
_LONGEST = 600  # configurations of a trace; of a longer gesture fewer are kept


@dataclass(frozen=True)
class Arrangement:
    """How things are: where each robot is, and what is pinned."""

    q: Mapping[str, Array]
    pins: Mapping[str, tuple[Pinned, ...]]

    @classmethod
    def of(cls, robots: Mapping[str, Driven]) -> Arrangement:
        """As they are now."""
        return cls({name: one.q for name, one in robots.items()}, {name: one.pins for name, one in robots.items()})

    def same(self, other: Arrangement) -> bool:
        """Whether nothing is different, rounding apart."""
        return self.pins == other.pins and all(np.allclose(q, other.q[name], atol=1e-9) for name, q in self.q.items())


class Trace:
    """Where the robots were, as time went on.

    Args:
        period: s between two configurations.
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self.passed: dict[str, list[Array]] = {}
        self._skip, self._count = 1, 0

    def note(self, robots: Mapping[str, Driven]) -> None:
        """Where they are now; called once a period of the beginning."""
        self._count += 1
        if self._count % self._skip:
            return
        for name, one in robots.items():
            self.passed.setdefault(name, []).append(one.q)
        if any(len(trace) > _LONGEST for trace in self.passed.values()):
            self.passed = {name: trace[::2] for name, trace in self.passed.items()}
            self._skip *= 2
            self.period *= 2.0


@dataclass(frozen=True)
class Gesture:
    """What one gesture did: how things were before and after it, and the way between."""

    before: Arrangement
    after: Arrangement
    trace: Trace


@dataclass
class History:
    """Gestures, the last one last; those that were undone wait to be done again."""

    done: list[Gesture] = field(default_factory=list)
    undone: list[Gesture] = field(default_factory=list)

    def add(self, gesture: Gesture) -> None:
        """A gesture was made: what was undone before it is forgotten."""
        self.done = [*self.done[1 - _MOST :], gesture]
        self.undone = []

    def undo(self) -> Gesture | None:
        """The last gesture; None if there is none."""
        if not self.done:
            return None
        self.undone.append(self.done.pop())
        return self.undone[-1]

    def redo(self) -> Gesture | None:
        """The gesture that was undone last; None if there is none."""
        if not self.undone:
            return None
        self.done.append(self.undone.pop())
        return self.done[-1]
