"""Gestures: what a person did to robots from taking to letting go; undone, and done again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cinegen.session.devices import Devices
from cinegen.session.driven import PIN, Driven, Pinned
from cinegen.session.motion import Retrace, Way

Array = NDArray[np.float64]

_MOST = 100  # gestures that are remembered
_LONGEST = 600  # configurations of a trace; of a longer gesture fewer are kept
_TRACED = 60  # configurations a second
_ON_IT = 0.05  # rad or lengths from the begin of a way: near enough to go it


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
        skipped = self._count % self._skip != 0
        self._count += 1
        if skipped:
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


class Gestures:
    """A gesture begins when something is taken, and ends when nothing is held and all robots have come to rest.

    Undoing leads all robots back the way that they came, and pins again what was pinned; redoing leads them there once
    more. A robot that is not on that way any more (a sensor has moved it meanwhile) goes straight there by its motors.

    Args:
        robots: that are driven.
        devices: that let go of a robot which is led.
        rate: ticks a second.
        number: gives the next task its number.
    """

    def __init__(self, robots: Mapping[str, Driven], devices: Devices, rate: float, number: Callable[[], int]) -> None:
        self._robots, self._devices, self._number = robots, devices, number
        self._every = max(1, round(rate / _TRACED))
        self._ticks = 0
        self._done: list[Gesture] = []
        self._undone: list[Gesture] = []
        self._begun: tuple[Arrangement, Trace] | None = None
        self._then: Arrangement | None = None  # how things will be when undoing has ended

    @property
    def undo_count(self) -> int:
        """How many can be undone."""
        return len(self._done) + (self._begun is not None)

    @property
    def redo_count(self) -> int:
        """How many can be done again."""
        return len(self._undone)

    def begin(self) -> None:
        """Somebody does something; it belongs to the gesture that goes on, if one does."""
        if self._then is not None:  # undoing is cut short: it is done at once
            there, self._then = self._then, None
            for name, one in self._robots.items():
                one.motion = None
                if not one.hit(there.q[name]):
                    one.put(there.q[name])
            self._pin_again(there)
        if self._begun is None:
            trace = Trace(1.0 / _TRACED)
            trace.note(self._robots)
            self._begun = Arrangement.of(self._robots), trace

    def tick(self, holding: bool) -> None:
        """Another tick has passed.

        Args:
            holding: whether the hand holds something.
        """
        self._ticks += 1
        moving = any(one.motion for one in self._robots.values())
        if self._begun is not None and self._ticks % self._every == 0:
            self._begun[1].note(self._robots)
        if self._begun is not None and not holding and not moving:
            self._end()
        if self._then is not None and not moving:
            there, self._then = self._then, None
            self._pin_again(there)

    def undo(self) -> None:
        """The last gesture, which may still go on, is undone."""
        self._finish()
        if self._done:
            gesture = self._done.pop()
            self._undone.append(gesture)
            self._go(gesture, gesture.before, backwards=True)

    def redo(self) -> None:
        """The gesture that was undone last is done again."""
        self._finish()
        if self._undone:
            gesture = self._undone.pop()
            self._done.append(gesture)
            self._go(gesture, gesture.after, backwards=False)

    def _end(self) -> None:
        if self._begun is None:
            return
        before, trace = self._begun
        self._begun = None
        trace.note(self._robots)
        after = Arrangement.of(self._robots)
        if not after.same(before):
            self._done = [*self._done[1 - _MOST :], Gesture(before, after, trace)]
            self._undone = []

    def _finish(self) -> None:
        """Whatever goes on ends here."""
        if self._then is not None:
            self.begin()
            self._begun = None
        for one in self._robots.values():
            one.motion = None
        self._end()

    def _go(self, gesture: Gesture, there: Arrangement, backwards: bool) -> None:
        name = "undo" if backwards else "redo"
        for robot, one in self._robots.items():
            for held in tuple(one.holding(PIN)):
                one.release(held)
            goal, trace = there.q[robot], gesture.trace.passed.get(robot, [])
            if np.allclose(one.q, goal, atol=1e-9):
                continue
            self._devices.give_up_scripts(robot)
            way = [*(trace[::-1] if backwards else trace), goal]
            on_it = one.mechanism.distance(one.q, way[0]) < _ON_IT
            one.motion = Retrace(way, gesture.trace.period, name) if on_it else Way(one.mechanism, one.q, goal, name)
        self._then = there

    def _pin_again(self, there: Arrangement) -> None:
        for robot, pins in there.pins.items():
            for pinned in pins:
                self._robots[robot].pin_again(self._number(), pinned)
