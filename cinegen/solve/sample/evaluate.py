"""`evaluate`: placement, Jacobian and singular values of a node, for many values of the motors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.errors import CinegenError
from cinegen.kernel.memory import address
from cinegen.kernel.thresholds import CORRECTION
from cinegen.model import Mechanism
from cinegen.model.memory import put_motors
from cinegen.solve.kernel import memory as m
from cinegen.solve.sample import kernel
from cinegen.solve.sample.kernel import measure_closed, measure_next, prepare_sample, work_size
from cinegen.solve.solver import Solver

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
        singular_values: (count, .) of the pull on what the loops leave, without unit, largest first (type 1).
        closure: (count,) the largest loop residual, rad or characteristic lengths.
    """

    q: Array
    placements: Array
    jacobians: Array
    singular_values: Array
    closure: Array


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
        translation: how many translations of the node count for its singular values, 0 to 3, in its own axes (`Pull`).
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
    return _Sampler(mechanism, node, translation, rotation).evaluate(given)


class _Sampler(Solver):
    """A solver that is led by its motors."""

    def __init__(self, mechanism: Mechanism, node: str, translation: int, rotation: int) -> None:
        prepare_sample()
        super().__init__(mechanism, dt=1.0)
        self.pull(node, None, translation, rotation, axes=node)
        self._arrange()
        self._rows = min(translation + rotation, int(self._table[m.N]) - mechanism.loop_rank)

    def evaluate(self, values: Array) -> Evaluations:
        """See the function."""
        mechanism, model, data = self.mechanism, self._model, self._data
        count, motors = len(values), len(mechanism.actuated)
        done = Evaluations(
            np.full((count, model.nq), np.nan),
            np.full((count, 4, 4), np.nan),
            np.full((count, 6, motors), np.nan),
            np.full((count, self._rows), np.nan),
            np.full(count, np.nan),
        )
        n = int(self._table[m.N])
        places = [mechanism.q_index(joint) for joint in mechanism.actuated]
        put_motors(self._memory, [mechanism.v_index(joint) for joint in mechanism.actuated], places)
        settings = self._memory.arrays["settings"]
        settings[m.TOLERANCE], settings[m.STRIDE], settings[m.ASTRAY] = _TOLERANCE, _STRIDE, CORRECTION
        anchor, work = np.zeros(model.nq), np.zeros(work_size(n, n - mechanism.loop_rank))
        todo = np.zeros(kernel.SIZE, dtype=np.int64)
        todo[kernel.COUNT], todo[kernel.WIDTH] = count, self._rows
        results = (done.q, done.placements, done.jacobians, done.singular_values, done.closure)
        todo[kernel.VALUES :] = [address(array) for array in (values, anchor, work, *results)]
        table, evaluate, trial = self._table, self._evaluate, self._trial
        if not mechanism.loops:
            done.q[:] = mechanism.q_home
            done.q[:, places] = values
            done.closure[:] = 0.0
            for q in done.q:
                evaluate(model, data, q)
                measure_next(table, todo)
            return done
        trial[:] = self._q
        evaluate(model, data, trial)
        while measure_closed(table, todo):
            if self._curved is not None:
                self._integrate(*self._curved)
            evaluate(model, data, trial)
        return done
