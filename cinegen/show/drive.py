"""Mechanisms that move in a page after a script, in real time."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from cinegen.model import Mechanism
from cinegen.sense import Path, fitted
from cinegen.show.page import Page
from cinegen.show.scene import Scene
from cinegen.solve import Pull, Solver, Step

FRAMES = 60  # a second
TICKS = 4  # of the solver in a frame


@dataclass(slots=True)
class Driven:
    """A mechanism, the solver that moves it, and the path that its node is pulled along."""

    mechanism: Mechanism
    solver: Solver
    path: Path
    pull: Pull
    step: Step | None = None

    @classmethod
    def along(cls, mechanism: Mechanism, shape: str, node: str | None = None) -> Driven:
        """A mechanism whose node (its end unless named) will follow a shape."""
        path = fitted(mechanism, node or mechanism.end, shape)
        solver = Solver(mechanism, 1.0 / (FRAMES * TICKS))
        return cls(mechanism, solver, path, solver.pull(path.node, path.home, rotation=path.rotation))


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
            for name, one in driven.items():
                for tick in range(TICKS):
                    one.pull.target = one.path.target((frame * TICKS + tick) * dt)
                    one.step = one.solver.step()
                scene.show(name, one.solver.q)
                scene.target(name, one.path.node, one.pull.target)
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
