"""`evaluate`: placement, Jacobian and singular values of a node, for many values of the motors; `Sampler` for more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.errors import CinegenError
from cinegen.ik._kernels.batch import measure_all
from cinegen.ik._kernels.memory import BatchMemory
from cinegen.jit.compiled import prepare
from cinegen.jit.foreign import frame_of
from cinegen.joints import supporting_columns
from cinegen.loops.arrays import actuate, set_up
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


class Sampler:
    """Evaluates a node of a mechanism at many configurations, batch after batch. Not for two threads at once.

    Args:
        mechanism: mechanism.
        node: base, link or frame.
        translation: number of translations of the node that count for its singular values, 0 to 3, in its own axes;
            see `FrameTask.translation`.
        rotation: number of rotations that count.
        balls: names of joints, by threes, that are written for a ball joint each: they count as balls.
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
        self._measure = prepare(measure_all, BatchMemory)
        self.mechanism, self._whole = mechanism, whole
        model, frame = mechanism.model, mechanism.model.frames[mechanism.frame_id(node)]
        fixed = 6 if mechanism.floating and node != mechanism.nodes[0] else 0
        self._memory = memory = set_up(BatchMemory(), mechanism.system, mechanism.loop_rank, fixed)
        actuate(memory, [mechanism.v_index(joint) for joint in mechanism.actuated])
        self._actuated = [mechanism.q_index(joint) for joint in mechanism.actuated]
        memory.tolerance, memory.longest_stride, memory.most_added = _TOLERANCE, _STRIDE, CORRECTION
        mobility = memory.n - memory.rank
        columns = mechanism.passive_columns
        passive = columns if second and 0 < mechanism.passive_rank == len(columns) else columns[:0]
        memory.resize(
            mobility=mobility, wide=max(memory.n, 6), wide_system=mobility + 6, passive=len(passive), balls=len(balls),
            width=min(translation + rotation, mobility),
        )  # fmt: skip
        memory.translation, memory.rotation, memory.is_whole = translation, rotation, int(whole)
        memory.joint, memory.node_offset[:] = frame.parentJoint, frame_of(frame.placement)
        memory.moved_by[:] = supporting_columns(model, frame.parentJoint)[fixed:]
        memory.passive_dof[:] = passive - fixed
        memory.ball_dof[:] = np.reshape([mechanism.v_index(name) - fixed for three in balls for name in three], (-1, 3))

    def led(self, values: Array, start: Array | None = None) -> Evaluations:
        """Evaluate at values of the actuated joints (count, actuated), loops closed from one to the next as `evaluate`
        does, from home, or from a configuration (nq,) whose loops are closed."""
        if not self.mechanism.loops:
            configurations = np.tile(self.mechanism.q_home, (len(values), 1))
            configurations[:, self._actuated] = values
            return self.at(configurations)
        self._memory.resize(count=len(values))
        self._memory.is_given, self._memory.q[:] = 0, self.mechanism.q_home if start is None else start
        self._memory.point_at("values", np.ascontiguousarray(values))
        return self._run()

    def at(self, configurations: Array) -> Evaluations:
        """Evaluate at configurations (count, nq), as they are."""
        self._memory.resize(count=len(configurations))
        self._memory.is_given = 1
        self._memory.point_at("given", np.ascontiguousarray(configurations))
        return self._run()

    def _run(self) -> Evaluations:
        memory, count = self._memory, self._memory.count
        memory.resize(whole=count if self._whole else 0)
        names = ("result_q", "placements", "jacobians", "singular_values", "closures", "passive_sigma")
        for name in names:
            memory.point_at(name, np.full(memory.shape(name), np.nan))
        self._measure(memory.handle)
        results = [getattr(memory, name) for name in names]
        if not self._whole:
            results[1:3] = [np.empty((count, 0, 0)), np.empty((count, 0, 0))]
        return Evaluations(*results)
