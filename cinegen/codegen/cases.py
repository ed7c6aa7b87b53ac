"""Cases that Python has computed, with which generated code is tested."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.codegen.program import Function
from cinegen.errors import ClosureError
from cinegen.ik import Solver
from cinegen.jit.foreign import frame_of
from cinegen.model import ForwardKinematics, Mechanism

Array = NDArray[np.float64]

_COUNT = 20
_TICKS = 60


@dataclass
class Cases:
    """Attributes:
    actuated: (n, actuated) values of the actuated joints, one after the other.
    forward: (n, nq) configurations to which they lead.
    frames: (n, nodes, 4, 3) frames of all nodes there: three axes, then the origin, m.
    open: (n, nq) configurations with open loops.
    closed: (n, nq) those to which they are closed.
    targets: (ticks, tasks, 4, 3) targets of each tick, as frames.
    ticked: (ticks, nq) configurations after it.
    statuses: (ticks,) its status.
    sigma: singular values of the tasks after the last one, by evaluation.
    """

    actuated: Array = field(default_factory=lambda: np.zeros((0, 0)))
    forward: Array = field(default_factory=lambda: np.zeros((0, 0)))
    frames: Array = field(default_factory=lambda: np.zeros((0, 0, 4, 3)))
    open: Array = field(default_factory=lambda: np.zeros((0, 0)))
    closed: Array = field(default_factory=lambda: np.zeros((0, 0)))
    targets: Array = field(default_factory=lambda: np.zeros((0, 0, 4, 3)))
    ticked: Array = field(default_factory=lambda: np.zeros((0, 0)))
    statuses: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))


def recorded(mechanism: Mechanism, solver: Solver, functions: Iterable[Function], seed: int = 0) -> Cases:
    """Return cases about the home configuration.

    Args:
        mechanism: mechanism.
        solver: a solver of it, at home, with its tasks; it moves.
        functions: what is tested.
        seed: seed of the random cases.
    """
    cases, rng, functions = Cases(), np.random.default_rng(seed), set(functions)
    if Function.FORWARD in functions:
        _record_forward(cases, mechanism, rng)
    if Function.CLOSE in functions:
        _record_close(cases, mechanism, rng)
    if Function.TICK in functions:
        _record_ticks(cases, mechanism, solver, rng)
    return cases


def _record_forward(cases: Cases, mechanism: Mechanism, rng: np.random.Generator) -> None:
    motion, names = ForwardKinematics(mechanism), mechanism.actuated
    home = np.array([mechanism.q_home[mechanism.q_index(name)] for name in names])
    sizes = np.array([mechanism.scale[mechanism.v_index(name)] for name in names])
    values, found = list[Array](), list[Array]()
    for _ in range(_COUNT):
        given = home + 0.2 * sizes * rng.uniform(-1.0, 1.0, len(names))
        try:
            found.append(motion.move(dict(zip(names, given.tolist(), strict=True))))
        except ClosureError:
            continue
        values.append(given)
    cases.actuated, cases.forward = np.reshape(values, (len(values), -1)), np.reshape(found, (len(found), -1))
    cases.frames = np.array([[frame_of(mechanism.placement(q, node)) for node in mechanism.nodes] for q in found])


def _record_close(cases: Cases, mechanism: Mechanism, rng: np.random.Generator) -> None:
    opened, closed = list[Array](), list[Array]()
    for _ in range(_COUNT):
        step = 0.05 * mechanism.scale * rng.uniform(-1.0, 1.0, mechanism.model.nv)
        if mechanism.floating:
            step[:6] = 0.0
        given = mechanism.integrate(mechanism.q_home, step)
        try:
            closed.append(mechanism.close(given))
        except ClosureError:
            continue
        opened.append(given)
    cases.open, cases.closed = np.array(opened), np.array(closed)


def _record_ticks(cases: Cases, mechanism: Mechanism, solver: Solver, rng: np.random.Generator) -> None:
    targets, found, statuses = list[Array](), list[Array](), list[int]()
    begins = [task.target.copy() for task in solver.tasks]
    directions = rng.uniform(-1.0, 1.0, (len(begins), 6))
    for tick in range(_TICKS):
        part = 0.2 * np.sin(2.0 * np.pi * tick / _TICKS)
        for task, begin, direction in zip(solver.tasks, begins, directions, strict=True):
            moved = part * direction * np.repeat([mechanism.length, 1.0], 3)
            turned = begin.rotation @ pin.exp3(moved[3:])
            task.target = pin.SE3(turned, begin.translation + moved[:3])
        targets.append(np.array([frame_of(task.target) for task in solver.tasks]))
        step = solver.step()
        found.append(step.q)
        statuses.append(list(type(step.status)).index(step.status))
    cases.targets, cases.ticked, cases.statuses = np.array(targets), np.array(found), np.array(statuses)
