"""The screw matrix of a mechanism's loops: what their singular values are taken of.

The rows by which loops are closed depend on which joints were cut, and where. Those of this matrix do not. Its columns
are the velocities of all joints, those of the cut joints included; a joint of a loop takes part with its whole unit
twist, linear velocity (divided by a length) above angular velocity, six rows for each loop:

    K = W S,    S = sum over joints of the loop of +- twist_i,    W = det(B B^T)^(1/2l) (B B^T)^(-1/2)

B (l, columns) has 1, -1 or 0 where a velocity takes part in a loop, forwards, backwards or not. Other joints to cut
give other loops T B, with an integral matrix T of determinant +-1, and W T has the singular values of W: so has K those
of the mechanism. For a single loop W is 1. Velocities of K's null space keep all loops closed, and the singular values
of other motions are the velocities, joint by joint, with which loops come apart, distributed evenly.

Twists are those of one point for each cluster of loops, divided by one length: the mean of the points of the axes that
are nearest to the axes' centre at home, and the spread of the cluster's own axes (`raff2urdf.loops.length`). Both
belong to the mechanism, too, and a small loop on a large robot is measured by its own size.

Rows of couplings are no twists. A locked gear holds its wheel whatever their ratio is, and shafts between them don't
matter: only the space that the rows span does. So below K are the rows (S S^T)^(-1/2) C, but for a rotation of them, of
the couplings' derivatives C by the columns that count: all, or those of the passive joints. S is C, with the steepest
slopes of curves (`ClosedLoops.coupling_slopes`). So the singular values of linear couplings without loops are 1, or 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, Bools, Indices
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.clusters import clusters
from raff2urdf.closure import RANK
from raff2urdf.loops.length import centre, cut_screws, moments, scale_of, spread
from raff2urdf.raff.document import LoopKind


class AxisPoint(NamedTuple):
    """A point of a joint's axis, or of a ball joint.

    Attributes:
        joint: index of the joint of the model that carries it.
        point: (3,) where it is on that joint, m.
        share: its weight in the mean.
    """

    joint: int
    point: Array
    share: float


class LoopScrews:
    """The screw matrix of a mechanism's loops and couplings.

    Args:
        system: the loops; its scratch data is used.
        q_home: (nq,) with closed loops.
        passive: columns of the passive joints.
        balls: names of joints, by threes, that represent a ball joint each.

    Attributes:
        cut: number of velocities of the joints that were cut; their columns are the last ones.
        scale: (nv + cut,) size of one dimensionless step.
        signs: (loops, nv + cut) B.
        mix: (loops, loops) W.
        passive: columns of the passive joints, and of those that were cut.
        coupling_mix: (couplings, couplings) (S S^T)^(-1/2) of the passive joints' columns.
        coupling_rank: number of independent rows of couplings in these.
        cluster_of: (loops,) index of each loop's cluster.
        lengths: by which linear velocities are divided, m, for each cluster.
        points: of the axes, for each cluster.
    """

    def __init__(
        self, system: ClosedLoops, q_home: Array, passive: Indices, balls: Iterable[Sequence[str]] = ()
    ) -> None:
        model, count, nv = system.model, len(system.loops), system.model.nv
        system.evaluate(q_home)
        screws = system.screws()
        turning: Bools = np.any(screws[3:] != 0.0, axis=0)
        owner = np.concatenate(  # of each column: a joint of the model, or a loop
            [
                np.repeat(np.arange(model.njoints), list(model.nvs)),
                np.repeat(model.njoints + np.arange(count), system.cut_dof),
            ]
        )
        for joints in balls:
            first, *others = [model.getJointId(joint) for joint in joints]
            owner[np.isin(owner, others)] = first
            screws[:, owner == first] = cut_screws(LoopKind.BALL, system.data.oMi[first].homogeneous)
        carriers = [*range(model.njoints), *(anchor[0] for anchor in system.anchors)]
        self.cut = sum(system.cut_dof)
        self.passive = np.concatenate([passive, np.arange(nv, nv + self.cut)])
        self._whole_mix = _orthonormal(system.coupling_slopes)[0]
        self.coupling_mix, self.coupling_rank = _orthonormal(system.coupling_slopes[:, passive])
        self.scale = np.concatenate([system.scale, np.where(turning[nv:], 1.0, system.length)])
        self.signs = np.zeros((count, nv + self.cut))
        for i, signs in enumerate(system.signs):
            self.signs[i, :nv] = signs
            self.signs[i, owner == model.njoints + i] = -1.0
        self.mix, self.cluster_of = np.zeros((count, count)), np.zeros(count, dtype=np.intp)
        self.lengths, self.points = list[float](), list[list[AxisPoint]]()
        for c, cluster in enumerate(clusters(system)):
            loops = list(cluster.loops)
            self.cluster_of[loops] = c
            self.mix[np.ix_(loops, loops)] = _mix(self.signs[loops])
            columns = np.flatnonzero(self.signs[loops].any(axis=0) & turning)
            placements = {k: system.data.oMi[carriers[k]] for k in owner[columns].tolist()}
            near = np.mean([pose.translation for pose in placements.values()], axis=0) if placements else np.zeros(3)
            about = centre(screws[:, columns], near)
            self.lengths.append(scale_of(spread(screws[:, columns], about), system.length))
            points = []
            for k, placement in placements.items():
                selected = columns[owner[columns] == k]
                point = placement.actInv(centre(screws[:, selected], about))
                points.append(AxisPoint(carriers[k], np.array(point), len(selected) / len(columns)))
            self.points.append(points)

    def matrix(self, system: ClosedLoops, jacobian: Array) -> Array:
        """Return K (6 loops + couplings, nv + cut), dimensionless.

        Args:
            system: the loops, whose data has the placements and Jacobians.
            jacobian: (rows, nv) what `system` evaluates there.
        """
        return self._matrix(system, jacobian, self._whole_mix)

    def passive_rows(self, jacobian: Array) -> Array:
        """Return the Jacobian (rows, nv) of loops and couplings with the rows of couplings as in `passive_matrix`."""
        first = len(jacobian) - len(self.coupling_mix)
        return np.vstack([jacobian[:first], self.coupling_mix @ jacobian[first:]])

    def passive_matrix(self, system: ClosedLoops, jacobian: Array) -> Array:
        """Return the columns (6 loops + couplings, .) of `passive` in K, likewise; rows of couplings by these alone."""
        return self._matrix(system, jacobian, self.coupling_mix)[:, self.passive]

    def _matrix(self, system: ClosedLoops, jacobian: Array, coupling_mix: Array) -> Array:
        count, couplings = len(system.loops), len(system.couplings)
        screws, of_loops = system.screws() * self.scale, np.zeros((count, 6, len(self.scale)))
        for c, (length, points) in enumerate(zip(self.lengths, self.points, strict=True)):
            about, loops = np.zeros(3), np.flatnonzero(self.cluster_of == c)
            for joint, point, share in points:
                about += share * system.data.oMi[joint].act(point)
            scaled = screws.copy()
            scaled[:3] = moments(screws, about) / length
            taking_part = self.signs[loops][:, None, :] * scaled
            of_loops[loops] = np.einsum("lm,mrk->lrk", self.mix[np.ix_(loops, loops)], taking_part)
        whole = np.zeros((6 * count + couplings, len(self.scale)))
        whole[: 6 * count] = of_loops.reshape(6 * count, len(self.scale))
        whole[6 * count :, : system.model.nv] = coupling_mix @ jacobian[system.rows - couplings :]
        return whole


def _orthonormal(slopes: Array) -> tuple[Array, int]:
    """Return (S S^T)^(-1/2) of S (rows, columns), and its rank; combinations of rows that are 0 stay what they are."""
    lengths = np.linalg.norm(slopes, axis=1)
    lengths[lengths == 0.0] = 1.0
    u, sigma, _ = np.linalg.svd(slopes / lengths[:, None])
    known = np.ones(len(slopes))
    number = int(np.count_nonzero(sigma > RANK))
    known[:number] = sigma[:number]
    return np.asarray((u / known) @ u.T / lengths), number


def _mix(signs: Array) -> Array:
    """Return W of loops whose joints take part as signs (loops, columns) state."""
    if not len(signs):
        return np.zeros((0, 0))
    squares, vectors = np.linalg.eigh(signs @ signs.T)
    squares = np.maximum(squares, 1e-9)  # a loop without joints
    return np.asarray((vectors / np.sqrt(squares)) @ vectors.T * np.exp(np.log(squares).mean() / 2.0))
