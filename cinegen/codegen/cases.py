"""Cases that Python has computed, with which generated code is tested."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.arrays import Array
from cinegen.codegen.inverse import TOLERANCE, InverseKinematics
from cinegen.codegen.program import Function
from cinegen.errors import ClosureError
from cinegen.ik import Solver
from cinegen.jit.foreign import frame_of
from cinegen.model import ForwardKinematics, Mechanism

_COUNT = 20
_TICKS = 60


Cases = dict[str, NDArray[Any]]
"""Arrays by names; those of functions that are not tested are missing.

actuated: (n, actuated) values of the actuated joints, one after the other.
forward: (n, nq) configurations to which they lead.
frames: (n, 12 nodes) frames of all nodes there: three axes, then the origin, m.
open: (n, nq) configurations with open loops.
closed: (n, nq) those to which they are closed.
targets: (ticks, tasks, 12) targets of each tick, as frames.
ticked: (ticks, nq) configurations after it.
reached: (ticks, tasks, 12) frames of the nodes of the tasks there.
statuses: (ticks,) its status.
aims: (n, tasks, 12) targets of inverse kinematics, as frames.
solved: (n, nq) configurations that are found, each the first start for the next target; the one before where none is
    found.
found: (n,) whether one is found. Rounding may change how many iterations that takes: these are not compared.
"""


def recorded(
    mechanism: Mechanism,
    solver: Solver,
    functions: Iterable[Function],
    inverse: InverseKinematics | None = None,
    seed: int = 0,
) -> Cases:
    """Return cases about the home configuration.

    Args:
        mechanism: mechanism.
        solver: a solver of it, at home, with its tasks; it moves.
        functions: what is tested.
        inverse: its inverse kinematics, where this is one of them.
        seed: seed of the random cases.
    """
    cases, rng, functions = Cases(), np.random.default_rng(seed), set(functions)
    if Function.FORWARD in functions:
        values, configurations = _moved(mechanism, rng, 0.2)
        frames = [_frames(mechanism.placement(q, node) for node in mechanism.nodes).ravel() for q in configurations]
        cases = _arrays(actuated=values, forward=configurations, frames=frames)
    if Function.CLOSE in functions:
        cases |= _closed(mechanism, rng)
    if Function.TICK in functions:
        cases |= _ticked(mechanism, solver, rng)
    if inverse is not None:
        cases |= _solved(mechanism, solver, inverse, rng)
    return {name: values for name, values in cases.items() if values.size}


def _arrays(**lists: list[Any]) -> Cases:
    return {name: np.array(values) for name, values in lists.items()}


def _moved(mechanism: Mechanism, rng: np.random.Generator, most: float) -> tuple[list[Array], list[Array]]:
    """Return random values of the actuated joints, by up to `most` rad or lengths from home, and where they lead."""
    motion, names = ForwardKinematics(mechanism), mechanism.actuated
    home = np.array([mechanism.q_home[mechanism.q_index(name)] for name in names])
    sizes = np.array([mechanism.scale[mechanism.v_index(name)] for name in names])
    values, configurations = list[Array](), list[Array]()
    for _ in range(_COUNT):
        actuated = home + most * sizes * rng.uniform(-1.0, 1.0, len(names))
        try:
            configurations.append(motion.move(dict(zip(names, actuated.tolist(), strict=True))))
        except ClosureError:
            continue
        values.append(actuated)
    return values, configurations


def _closed(mechanism: Mechanism, rng: np.random.Generator) -> Cases:
    opened, closed = list[Array](), list[Array]()
    for _ in range(_COUNT):
        step = 0.05 * mechanism.scale * rng.uniform(-1.0, 1.0, mechanism.model.nv)
        if mechanism.floating:
            step[:6] = 0.0
        q = mechanism.integrate(mechanism.q_home, step)
        try:
            closed.append(mechanism.close(q))
        except ClosureError:
            continue
        opened.append(q)
    return _arrays(open=opened, closed=closed)


def _ticked(mechanism: Mechanism, solver: Solver, rng: np.random.Generator) -> Cases:
    targets, ticked, reached, statuses = list[Array](), list[Array](), list[Array](), list[int]()
    begins = [task.target.copy() for task in solver.frame_tasks]
    directions = rng.uniform(-1.0, 1.0, (len(begins), 6))
    for tick in range(_TICKS):
        part = 0.2 * np.sin(2.0 * np.pi * tick / _TICKS)
        for task, begin, direction in zip(solver.frame_tasks, begins, directions, strict=True):
            moved = part * direction * np.repeat([mechanism.length, 1.0], 3)
            turned = begin.rotation @ pin.exp3(moved[3:])
            task.target = pin.SE3(turned, begin.translation + moved[:3])
        targets.append(_frames(task.target for task in solver.frame_tasks))
        step = solver.step()
        ticked.append(step.q)
        reached.append(_frames(mechanism.placement(step.q, task.node) for task in solver.frame_tasks))
        statuses.append(list(type(step.status)).index(step.status))
    return _arrays(targets=targets, ticked=ticked, reached=reached, statuses=statuses)


def _frames(poses: Iterable[pin.SE3]) -> Array:
    return np.array([frame_of(pose).ravel() for pose in poses])


def _solved(mechanism: Mechanism, solver: Solver, inverse: InverseKinematics, rng: np.random.Generator) -> Cases:
    """Record targets that configurations near home reach, and some that are far out of reach."""
    q, aims, solved, results = mechanism.q_home, list[Array](), list[Array](), list[int]()
    for i, goal in enumerate(_moved(mechanism, rng, 0.3)[1]):
        targets = [mechanism.placement(goal, task.node) * task.offset for task in solver.frame_tasks]
        if i % 5 == 4:
            for target in targets:
                target.translation += 100.0 * mechanism.length * rng.uniform(0.5, 1.0, 3)
        solution, _ = inverse.find(targets, q, TOLERANCE)
        q = q if solution is None else solution
        aims.append(_frames(targets))
        solved.append(q)
        results.append(int(solution is not None))
    return _arrays(aims=aims, solved=solved, found=results)
