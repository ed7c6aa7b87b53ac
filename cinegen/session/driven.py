"""One robot of a session: where it stands, what holds its nodes, and how it moves in a tick."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik import FrameTask, Solver, Step
from cinegen.model import Mechanism
from cinegen.session.motion import Motion

Array = NDArray[np.float64]

HAND, PIN, SENSOR = "hand", "pin", "sensor"
"""Who holds a node."""


@dataclass(eq=False)
class Held:
    """A task, and who holds it.

    Attributes:
        number: its own in the session.
        task: of the robot's solver; its target is as seen from where the robot stands.
        who: `HAND`, `PIN` or `SENSOR`.
        label: what people call it.
        scripted: whether a script leads it.
    """

    number: int
    task: FrameTask
    who: str
    label: str
    scripted: bool = False


@dataclass(frozen=True)
class Pinned:
    """What is needed to pin a node again."""

    node: str
    at: pin.SE3
    target: pin.SE3
    translation: int
    rotation: int
    weight: float


class Driven:
    """A robot that is driven.

    Args:
        name: in the session.
        solver: that moves it.

    Attributes:
        base: where it stands: the placement of its own world in the session's.
        home: (nq,) where it goes when it is sent home: where it begins.
        held: what holds its nodes, in the order it was taken.
        motion: what moves it instead of them; None: they do.
        step: the last one of the solver.
    """

    def __init__(self, name: str, solver: Solver) -> None:
        self.name, self.solver = name, solver
        self.mechanism: Mechanism = solver.mechanism
        self.base = pin.SE3.Identity()
        self.home = solver.q
        self.held: list[Held] = []
        self.motion: Motion | None = None
        self._reported = 0  # messages of the solver's exception log
        self.step: Step = self.solver.step()

    @property
    def q(self) -> Array:
        """(nq,) where it is."""
        return self.solver.q

    def placement(self, node: str) -> pin.SE3:
        """Of a node, in the session's world."""
        return self.base * self.mechanism.placement(self.solver.q, node)

    # --- what holds it -------------------------------------------------------------------------------------------

    def take(
        self,
        number: int,
        node: str,
        who: str,
        label: str,
        at: pin.SE3 | None = None,
        freedoms: tuple[int, int] = (3, 3),
    ) -> Held:
        """Somebody holds a node, at a place on it, where it is."""
        task = self.solver.add_task(node, translation=freedoms[0], rotation=freedoms[1], offset=at)
        held = Held(number, task, who, label)
        self.held.append(held)
        return held

    def release(self, held: Held) -> None:
        """It is held no more."""
        self.held.remove(held)
        self.solver.remove_task(held.task)

    def holding(self, who: str, node: str | None = None) -> Iterator[Held]:
        """What somebody holds, of a node or all."""
        for held in tuple(self.held):
            if held.who == who and node in (None, held.task.node):
                yield held

    @property
    def pins(self) -> tuple[Pinned, ...]:
        """What is pinned, as values."""
        return tuple(
            Pinned(p.node, p.offset.copy(), self.base * p.target, p.translation, p.rotation, p.weight)
            for p in (held.task for held in self.holding(PIN))
        )

    def pin_again(self, number: int, pinned: Pinned) -> Held:
        """Pins a node again."""
        held = self.take(number, pinned.node, PIN, "pin", pinned.at, (pinned.translation, pinned.rotation))
        held.task.weight = pinned.weight
        self.aim(held, pinned.target)
        return held

    def aim(self, held: Held, target: pin.SE3) -> None:
        """What is held should be there, in the session's world."""
        held.task.target = self.base.actInv(target)

    # --- motion --------------------------------------------------------------------------------------------------

    def stand(self, base: pin.SE3) -> None:
        """It stands there now. What holds it stays where it is in the session's world."""
        moved = base.actInv(self.base)
        self.base = base
        for held in self.held:
            if held.task.is_valid():
                held.task.target = moved * held.task.target

    def tick(self, dt: float) -> str:
        """Moves it on by a tick. Returns what there is to tell people; mostly nothing."""
        trouble = self._advance(dt)
        messages = self.solver.exception_log.messages
        if len(messages) == self._reported:
            return trouble
        new, self._reported = messages[self._reported :], len(messages)
        return "; ".join([trouble] * bool(trouble) + new)

    def _advance(self, dt: float) -> str:
        if self.motion is None:
            self.step = self.solver.step()
            return ""
        motion = self.motion
        q = motion.advance(dt)
        if q is None:
            self.motion = None
            return f"{self.name}: {motion.trouble}" if motion.trouble else ""
        hit = self.hit(q)
        if hit:
            motion.halt(self.q, hit)
        else:
            self.put(q)
        return ""

    def hit(self, q: Array) -> str:
        """What would be hit on the straight way to q (nq,), in words; empty if nothing is."""
        return ""

    def put(self, q: Array) -> None:
        """It is at q (nq,), loops closed, at once; what holds it holds it there."""
        if not np.array_equal(q, self.solver.q):
            self.solver.q = q
            for held in self.held:
                held.task.target = self.mechanism.placement(q, held.task.node) * held.task.offset
        self.step = self.solver.step()

    def status(self) -> tuple[str, str]:
        """Of the last tick: its name, and words for people."""
        step, motion = self.step, self.motion
        if motion is not None:
            return motion.name.upper(), motion.trouble or _DOING.get(motion.name, motion.name)
        name = step.status.name
        if name == "AT_LIMIT":
            return name, f"at limit: {', '.join(step.saturated[:3])}" if step.saturated else "at limit"
        if name == "OUT_OF_REACH":
            metres, turn = (max(parts) for parts in zip(*step.errors, strict=True))
            far = f"{1000.0 * metres:.3g} mm" if metres > 1e-3 * self.mechanism.length else f"{math.degrees(turn):.3g}°"
            return name, f"out of reach by {far}"
        return name, _WORDS[name]


_WORDS = {
    "BAD_TARGET": "a target makes no sense",
    "REFUSED": "the loops can't follow",
    "SINGULAR": "near a singularity",
    "FOLLOWING": "following",
    "IDLE": "free",
    "DETOUR": "finding another way",
    "BARRED": "held off",
}
_DOING = {
    "motors": "led by its motors",
    "home": "on its way home",
    "visit": "on its way there",
    "undo": "going back",
    "redo": "going again",
}
