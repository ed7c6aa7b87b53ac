"""Mechanisms that move in a page, in real time: after a script, until a person takes them in hand."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from cinegen.model import Mechanism
from cinegen.sense import Path, fitted
from cinegen.show.hand import Hand
from cinegen.show.page import Page
from cinegen.show.scene import Scene
from cinegen.solve import Pull, Solver, Step

FRAMES = 60  # a second
TICKS = 4  # of the solver in a frame


@dataclass(slots=True)
class Driven:
    """A mechanism, the solver that moves it, and the path that its node is pulled along until a hand takes a part.

    Attributes:
        mechanism: which.
        solver: that moves it.
        path: that its node follows; given up when a hand has taken a part. None where it stands still until then.
        pull: that leads it: along the path, or after the hand; None if it is left alone.
        hand: that holds it.
        step: the last one.
    """

    mechanism: Mechanism
    solver: Solver
    path: Path | None = None
    pull: Pull | None = None
    hand: Hand | None = None
    step: Step | None = None

    @classmethod
    def still(cls, mechanism: Mechanism) -> Driven:
        """A mechanism that stands at home until a hand takes it."""
        return cls(mechanism, Solver(mechanism, 1.0 / (FRAMES * TICKS)))

    @classmethod
    def along(cls, mechanism: Mechanism, shape: str, node: str | None = None) -> Driven:
        """A mechanism whose node (its end unless named) will follow a shape."""
        path = fitted(mechanism, node or mechanism.end, shape)
        solver = Solver(mechanism, 1.0 / (FRAMES * TICKS))
        return cls(mechanism, solver, path, solver.pull(path.node, path.home, rotation=path.rotation))

    def tick(self, time: float) -> None:
        """Moves it on, along its path as it is at a time (s), or after the hand."""
        if self.pull is not None:
            if self.hand is None and self.path is not None:
                self.pull.target = self.path.target(time)
            elif self.hand is not None and self.hand.target is not None:
                self.pull.target = pin.SE3(self.pull.target.rotation, np.array(self.hand.target))
        self.step = self.solver.step()

    def obey(self, hand: Hand | None) -> None:
        """Takes what a hand holds, or lets go of it."""
        before, self.hand = self.hand, hand
        if hand is not None and (before is None or (before.node, before.point) != (hand.node, hand.point)):
            self._release()
            self.pull = self.solver.pull(hand.node, rotation=0, at=np.array(hand.point))
        elif hand is None and before is not None:
            self._release()

    def _release(self) -> None:
        if self.pull is not None:
            self.solver.release(self.pull)
            self.pull = None


def drive(
    scene: Scene,
    driven: Mapping[str, Driven],
    seconds: float | None = None,
    report: Callable[[float, Mapping[str, Driven]], None] | None = None,
) -> None:
    """Moves mechanisms in a scene until the time is over, or for ever; returns on Ctrl-C.

    Args:
        scene: that shows them.
        driven: by their name in the scene.
        seconds: how long.
        report: called about once a second with the time and what moves.
    """
    begin = time.perf_counter()
    frame = 0
    dt = 1.0 / (FRAMES * TICKS)
    try:
        while seconds is None or frame < seconds * FRAMES:
            hands = scene.page.hands
            for name, one in driven.items():
                one.obey(hands.get(name))
                for tick in range(TICKS):
                    one.tick((frame * TICKS + tick) * dt)
                scene.show(name, one.solver.q)
                if one.pull is not None:
                    scene.target(name, "target", one.pull.target)
            frame += 1
            if report is not None and frame % FRAMES == 0:
                report(frame / FRAMES, driven)
            time.sleep(max(0.0, begin + frame / FRAMES - time.perf_counter()))
    except KeyboardInterrupt:
        pass


def page_of(mechanisms: Mapping[str, Mechanism]) -> tuple[Page, Scene]:
    """A page that shows mechanisms at home."""
    page = Page(", ".join(mechanisms))
    return page, Scene(page, mechanisms)
