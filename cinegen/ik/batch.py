"""`evaluate`: placement, Jacobian and singular values of a node, for many values of the motors; `Sampler` for more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.errors import CinegenError
from cinegen.ik._kernels import batch as kernel
from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.batch import measure_closed, measure_given, measure_next, prepare_sample, work_size
from cinegen.ik.solver import Solver
from cinegen.loops._kernels.memory import address
from cinegen.loops.arrays import put_motors
from cinegen.loops.thresholds import CORRECTION
from cinegen.model import Mechanism

Array = NDArray[np.float64]

_TOLERANCE = 1e-11  # rad or lengths: loops are closed to this
_STRIDE = 0.3  # rad or lengths: a longer way of a joint is gone in parts, so that no branch is left


@dataclass(frozen=True, eq=False)
class Evaluations:
    """Of a node at each of (count,) configurations.

    Attributes:
        q: (count, nq) the configurations, loops closed; not a number where they could not be closed, as all else.
        placements: (count, 4, 4) of the node in the world, m.
        jacobians: (count, 6, motors) velocity of the node in its own axes, m/s above rad/s, by the motors' velocities,
            in the order of `mechanism.actuated`; infinite or not a number where they don't determine it (type 2).
        singular_values: (count, .) of the task on what the loops leave, without unit, largest first (type 1).
        closure: (count,) the largest loop residual, rad or characteristic lengths.
        second: (count,) the smallest singular value of the passive joints in the loops, without unit (type 2); not a
            number unless a `Sampler` was asked for it.
    """

    q: Array
    placements: Array
    jacobians: Array
    singular_values: Array
    closure: Array
    second: Array


def evaluate(
    mechanism: Mechanism, node: str, values: ArrayLike, translation: int = 3, rotation: int = 3
) -> Evaluations:
    """Evaluates a node for many values of the motors, one after the other.

    Loops are closed from one configuration to the next, along the straight way of the motors from home and on, so that
    the assembly mode stays that of home; where they can't be closed, the next is tried from the last that could.

    Args:
        mechanism: which.
        node: base, link or frame.
        values: (count, motors), rad and m, in the order of `mechanism.actuated`.
        translation: how many translations of the node count for its singular values, 0 to 3, in its own axes.
        rotation: how many rotations.

    Raises:
        UnknownNameError: no such node.
        CinegenError: values of another shape.
    """
    given = np.ascontiguousarray(values, dtype=float)
    if given.ndim != 2 or given.shape[1] != len(mechanism.actuated):
        raise CinegenError(
            f"values must be (count, {len(mechanism.actuated)}), one for each motor of {mechanism.name}, "
            f"not {given.shape}"
        )
    return Sampler(mechanism, node, translation, rotation).led(given)


class Sampler(Solver):
    """Evaluates a node of a mechanism at many configurations, batch after batch.

    Args:
        mechanism: which.
        node: base, link or frame.
        translation: how many translations of the node count for its singular values, 0 to 3, in its own axes.
        rotation: how many rotations.
        balls: joints, by threes, that are written for a ball joint each: they count as the balls that they are.
        second: whether the smallest singular value of the passive joints is wanted.
        whole: whether all of `Evaluations` is wanted; else its placements and Jacobians stay empty, (count, 0, 0), and
            of singular values only the smallest is there, as the last: that is quicker.

    Raises:
        UnknownNameError: no such node.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        node: str,
        translation: int = 3,
        rotation: int = 3,
        balls: Sequence[Sequence[str]] = (),
        second: bool = False,
        whole: bool = True,
    ) -> None:
        prepare_sample()
        super().__init__(mechanism, dt=1.0)
        self.add_task(node, None, translation, rotation, axes=node)
        self._write_tasks()
        n = int(self._table[m.N])
        self._rows = min(translation + rotation, n - mechanism.loop_rank)
        self._places = [mechanism.q_index(joint) for joint in mechanism.actuated]
        put_motors(self._memory, [mechanism.v_index(joint) for joint in mechanism.actuated], self._places)
        settings = self._memory.arrays["settings"]
        settings[m.TOLERANCE], settings[m.STRIDE], settings[m.ASTRAY] = _TOLERANCE, _STRIDE, CORRECTION
        self._anchor, self._work = np.zeros(mechanism.model.nq), np.zeros(work_size(n, n - mechanism.loop_rank))
        columns = mechanism.passive_columns
        wanted = second and 0 < mechanism.passive_rank == len(columns)
        self._passive = columns.astype(float) if wanted else np.zeros(0)
        at = [[mechanism.v_index(name) for name in three] for three in balls]
        self._balls = np.array(at, dtype=float).reshape(-1, 3)
        self._whole, self._one = whole, np.zeros((4, 4))
        self._second_work = np.zeros((int(self._table[m.ROWS]) + 2) * max(len(self._passive), 1))

    def led(self, values: Array, start: Array | None = None) -> Evaluations:
        """At values of the motors (count, motors), loops closed from one to the next as `evaluate` does, from home, or
        from a configuration (nq,) whose loops are closed."""
        model, data = self._model, self._data
        done, todo = self._empty(len(values)), self._todo(values)
        table, evaluate, trial = self._table, self._evaluate, self._trial
        self._point(todo, done)
        if not self.mechanism.loops:
            done.q[:] = self.mechanism.q_home
            done.q[:, self._places] = values
            done.closure[:] = 0.0
            for q in done.q:
                evaluate(model, data, q)
                measure_next(table, todo)
            return done
        trial[:] = self._q[:] = self.mechanism.q_home if start is None else start
        table[m.FACTORED] = table[m.ALIKE] = 0
        evaluate(model, data, trial)
        while measure_closed(table, todo):
            if self._curved is not None:
                self._integrate(*self._curved)
            evaluate(model, data, trial)
        return done

    def at(self, configurations: Array) -> Evaluations:
        """At configurations (count, nq), as they are."""
        model, data = self._model, self._data
        done, todo = self._empty(len(configurations)), self._todo(np.zeros((0, len(self._places))))
        table, evaluate, trial = self._table, self._evaluate, self._trial
        todo[kernel.COUNT] = len(configurations)
        self._point(todo, done)
        if not self.mechanism.loops:
            done.q[:], done.closure[:] = configurations, 0.0
        measure = measure_given if self.mechanism.loops else measure_next
        for q in configurations:
            trial[:] = q
            evaluate(model, data, trial)
            measure(table, todo)
        table[m.FACTORED] = 0
        return done

    def _empty(self, count: int) -> Evaluations:
        more = ((4, 4), (6, len(self._places))) if self._whole else ((0, 0), (0, 0))
        shapes = (self._model.nq,), *more, (self._rows,), (), ()
        return Evaluations(*(np.full((count, *shape), np.nan) for shape in shapes))

    def _todo(self, values: Array) -> NDArray[np.int64]:
        todo = np.zeros(kernel.SIZE, dtype=np.int64)
        todo[kernel.COUNT], todo[kernel.WIDTH] = len(values), self._rows
        todo[kernel.PASSIVE], todo[kernel.BALLS] = len(self._passive), len(self._balls)
        todo[kernel.VALUES], todo[kernel.WHOLE] = address(values), self._whole
        for name, array in (
            (kernel.ANCHOR, self._anchor), (kernel.WORK, self._work), (kernel.PASSIVE_COLUMNS, self._passive),
            (kernel.BALL_COLUMNS, self._balls), (kernel.SECOND_WORK, self._second_work),
        ):  # fmt: skip
            todo[name] = address(array)
        return todo

    def _point(self, todo: NDArray[np.int64], done: Evaluations) -> None:
        """Names where the results go."""
        placements = done.placements if self._whole else self._one
        results = (done.q, placements, done.jacobians, done.singular_values, done.closure, done.second)
        todo[kernel.Q : kernel.Q + len(results)] = [address(array) for array in results]
