"""Batch evaluation of a node: placement, Jacobian and singular values at many configurations (`evaluate`,
`BatchEvaluator`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError
from cinegen.ik._kernels.batch import measure_all
from cinegen.ik._kernels.memory import BatchMemory
from cinegen.jit.compiled import prepare
from cinegen.jit.foreign import frame_of
from cinegen.jit.one_thread import OneThread, in_one_thread
from cinegen.joints import supporting_columns
from cinegen.loops.setup import actuate, set_up, set_up_screws
from cinegen.loops.thresholds import CORRECTION
from cinegen.model import Mechanism
from raff2urdf.errors import counted

_TOLERANCE = 1e-11  # rad or lengths: largest loop residual
_STRIDE = 0.3  # rad or lengths: largest step of a joint, so that the assembly mode stays the same


@dataclass(frozen=True, eq=False)
class Evaluations:
    """Evaluations of a node at `count` configurations; NaN where the loops could not be closed.

    Attributes:
        q: (count, nq) configurations, loops closed.
        placements: (count, 4, 4) pose of the node in the world, m.
        jacobians: (count, 6, actuated) velocity of the node in its own axes, m/s above rad/s, by the velocities of the
            actuated joints, in the order of `mechanism.actuated`; infinite or NaN where they do not determine it
            (type 2 singularity).
        singular_values: (count, .) dimensionless singular values of the task in the null space of the loops, largest
            first (type 1).
        closure: (count,) largest loop residual, rad or characteristic lengths.
        passive_sigma: (count,) smallest dimensionless singular value of the passive joints in the loops' screw matrix
            (type 2); NaN unless a `BatchEvaluator` computes it.
    """

    q: Array
    placements: Array
    jacobians: Array
    singular_values: Array
    closure: Array
    passive_sigma: Array

    def __repr__(self) -> str:
        return f"<Evaluations: {counted(len(self.q), 'configuration')}, {int(np.isfinite(self.closure).sum())} closed>"


def evaluate(
    mechanism: Mechanism, node: str, values: ArrayLike, translation: int = 3, rotation: int = 3
) -> Evaluations:
    """Evaluate a node at many positions of the actuated joints.

    Loops are closed along the straight path of the actuated joints from home to the first positions, and from each to
    the next, so that the assembly mode stays that of home. After positions where they can't be closed, the path begins
    at the last ones where they could. Actuated joints alone move the node: a floating base stays at home.

    Args:
        mechanism: mechanism.
        node: base, link or frame.
        values: (count, actuated) positions, rad and m, in the order of `mechanism.actuated`.
        translation: number of translations of the node that count for its singular values, 0 to 3, in its own axes;
            see `FrameTask.translation`.
        rotation: number of rotations that count.

    Raises:
        UnknownNameError: no such node.
        CinegenError: values has a wrong shape.
    """
    positions = np.ascontiguousarray(values, dtype=float)
    if positions.ndim != 2 or positions.shape[1] != len(mechanism.actuated):
        raise CinegenError(
            f"values must be (count, {len(mechanism.actuated)}), one for each actuated joint of {mechanism.name}, "
            f"not {positions.shape}"
        )
    return BatchEvaluator(mechanism, node, translation, rotation).follow(positions)


class BatchEvaluator(OneThread):
    """Evaluates a node of a mechanism at many configurations, batch after batch. For one thread at a time.

    Args:
        mechanism: mechanism.
        node: base, link or frame.
        translation: number of translations of the node that count for its singular values, 0 to 3, in its own axes;
            see `FrameTask.translation`.
        rotation: number of rotations that count.
        balls: names of joints, by threes, that stand for a ball joint each: they count as balls.
        passive_sigma: whether the smallest singular value of the passive joints is computed.
        whole: whether all of `Evaluations` is computed; else placements and Jacobians are empty, (count, 0, 0), and
            only the smallest singular value is there, as the last: that is faster.

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
        passive_sigma: bool = False,
        whole: bool = True,
    ) -> None:
        self._measure = prepare(measure_all, BatchMemory)
        self.mechanism, self._whole = mechanism, whole
        model, frame = mechanism.model, mechanism.model.frames[mechanism.frame_id(node)]
        fixed = 6 if mechanism.floating else 0
        self._memory = memory = set_up(BatchMemory(), mechanism.structure.system, mechanism.cluster_ranks, fixed)
        actuate(memory, [mechanism.v_index(joint) for joint in mechanism.actuated])
        self._actuated = [mechanism.q_index(joint) for joint in mechanism.actuated]
        memory.tolerance, memory.longest_stride, memory.most_added = _TOLERANCE, _STRIDE, CORRECTION
        mobility = memory.n - memory.rank
        columns = mechanism.structure.passive_columns
        if passive_sigma and 0 < mechanism.structure.passive_rank == len(columns):
            set_up_screws(memory, mechanism.structure.screws)
            passive = mechanism.structure.screws.passive
        else:
            passive = columns[:0]
        memory.resize(
            mobility=mobility, wide=max(memory.n, 6), wide_system=mobility + 6, passive=len(passive), balls=len(balls),
            width=min(translation + rotation, mobility),
        )  # fmt: skip
        memory.translation, memory.rotation, memory.is_whole = translation, rotation, int(whole)
        memory.joint, memory.node_offset[:] = frame.parentJoint, frame_of(frame.placement)
        memory.moved_by[:] = supporting_columns(model, frame.parentJoint)[fixed:]
        memory.passive_column[:] = passive - fixed
        memory.ball_dof[:] = np.reshape([mechanism.v_index(name) - fixed for three in balls for name in three], (-1, 3))

    @in_one_thread
    def follow(self, values: Array, start: Array | None = None) -> Evaluations:
        """Evaluate at positions of the actuated joints, one after the other, as `evaluate` does.

        Args:
            values: (count, actuated) positions, rad and m.
            start: (nq,) configuration with closed loops where the path begins; home unless given.
        """
        if not self.mechanism.is_constrained:
            configurations = np.tile(self.mechanism.q_home, (len(values), 1))
            configurations[:, self._actuated] = values
            return self.at(configurations)
        self._memory.resize(count=len(values))
        self._memory.is_given, self._memory.q[:] = 0, self.mechanism.q_home if start is None else start
        self._memory.point_at("values", np.ascontiguousarray(values))
        return self._run()

    @in_one_thread
    def at(self, configurations: Array) -> Evaluations:
        """Evaluate at configurations (count, nq), loops closed or not."""
        self._memory.resize(count=len(configurations))
        self._memory.is_given = 1
        self._memory.point_at("configurations", np.ascontiguousarray(configurations))
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
