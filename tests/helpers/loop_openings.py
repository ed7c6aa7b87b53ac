"""The screw matrix of a mechanism's loops, in numpy: in closed form, and from Pinocchio's Jacobians."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg import fractional_matrix_power
from scipy.sparse.csgraph import connected_components

import cinegen
from raff2urdf.raff.document import LoopKind

Array = NDArray[np.float64]

_FREE = {LoopKind.RIGID: (), LoopKind.PRISMATIC: (2,), LoopKind.REVOLUTE: (5,), LoopKind.BALL: (3, 4, 5)}


def pin_screws(pins: Array, home: Array) -> Array:
    """Return that (3, n) of one loop in a plane, of the pins (n, 2) of its joints: rotations, and their moments about
    the middle of all, divided by the pins' root mean square distance from it at home."""
    rods = (pins - pins.mean(axis=0)) / np.sqrt(((home - home.mean(axis=0)) ** 2).sum() / len(home))
    return np.stack([np.ones(len(pins)), rods[:, 1], -rods[:, 0]])


class Openings:
    """The ends of a mechanism's loops, for joint velocities and velocities of the joints that were cut."""

    def __init__(self, mechanism: cinegen.Mechanism) -> None:
        assert not mechanism.couplings
        self.mechanism, self.model = mechanism, mechanism.model
        self.cut = [(k, c) for k, loop in enumerate(mechanism.loops) for c in _FREE[loop.kind]]
        nv = self.model.nv
        self.scale = np.append(mechanism.scale, [mechanism.length if c < 3 else 1.0 for _, c in self.cut])
        self.signs = np.zeros((len(mechanism.loops), nv + len(self.cut)))
        for k, loop in enumerate(mechanism.loops):
            for node, sign in ((loop.first, -1.0), (loop.second, 1.0)):
                for j in self.model.supports[self._frame(node).parentJoint]:
                    self.signs[k, self.model.joints[j].idx_v : self.model.joints[j].idx_v + self.model.nvs[j]] += sign
        for i, (k, _) in enumerate(self.cut):
            self.signs[k, nv + i] = -1.0  # moves the first end
        home, screws = self._moved(mechanism.q_home)
        # of each velocity the joint that carries its axis, and of balls their own point
        bodies = np.repeat(range(self.model.njoints), list(self.model.nvs)).tolist()
        bodies += [self._frame(mechanism.loops[k].first).parentJoint for k, _ in self.cut]
        balls = {
            nv + i: self._first_end(home, k).translation
            for i, (k, _) in enumerate(self.cut)
            if mechanism.loops[k].kind is LoopKind.BALL
        }
        self.cluster = connected_components(self.signs @ self.signs.T)[1]
        self.lengths, self.points = [], []
        for c in range(self.cluster.max() + 1):
            joints = [j for j in np.flatnonzero(self.signs[self.cluster == c].any(axis=0)) if screws[3:, j].any()]
            axes = [(np.cross(screws[3:, j], screws[:3, j]), screws[3:, j]) for j in joints]
            across = [np.eye(3) - np.outer(w, w) for _, w in axes]
            right = sum(m @ point for m, (point, _) in zip(across, axes, strict=True))
            near = np.mean([home[bodies[j]].translation for j in joints], axis=0)
            centre = near + np.linalg.lstsq(sum(across), right - sum(across) @ near, rcond=1e-4)[0]
            self.lengths.append(np.sqrt(np.mean([np.sum(np.cross(w, p - centre) ** 2) for p, w in axes])))
            # of axes the points nearest to their centre
            nearest = [balls.get(j, p + w * (w @ (centre - p))) for j, (p, w) in zip(joints, axes, strict=True)]
            self.points.append([(bodies[j], home[bodies[j]].actInv(p)) for j, p in zip(joints, nearest, strict=True)])

    def matrix(self, q: Array) -> Array:
        """Return (6 loops, nv + cut) at q (nq,): the velocities with which the ends of loops part, each loop cut open,
        in characteristic lengths of its cluster and rad; loops that share joints are distributed evenly."""
        placements, screws = self._moved(q)
        twists = self.signs[:, None, :] * (screws * self.scale)
        for twist, c in zip(twists, self.cluster, strict=True):
            centre = np.mean([placements[body].act(point) for body, point in self.points[c]], axis=0)
            twist[:3] = (twist[:3] + np.cross(twist[3:], centre[:, None], axis=0)) / self.lengths[c]
        mixed = np.zeros_like(twists)
        for c in range(self.cluster.max() + 1):
            members = np.flatnonzero(self.cluster == c)
            squares = self.signs[members] @ self.signs[members].T
            mix = np.linalg.det(squares) ** (0.5 / len(members)) * fractional_matrix_power(squares, -0.5)
            mixed[members] = np.einsum("lm,mrk->lrk", mix, twists[members])
        return mixed.reshape(-1, len(self.scale))

    def _moved(self, q: Array) -> tuple[list[pin.SE3], Array]:
        """Return where joints are, and the twists (6, nv + cut) in the world of unit velocities."""
        data = self.model.createData()
        pin.computeJointJacobians(self.model, data, q)
        placements = [placement.copy() for placement in data.oMi]
        cut = [self._first_end(placements, k).toActionMatrix()[:, c] for k, c in self.cut]
        return placements, np.column_stack([data.J, *cut])

    def _first_end(self, placements: list[pin.SE3], k: int) -> pin.SE3:
        loop = self.mechanism.loops[k]
        frame = self._frame(loop.first)
        return placements[frame.parentJoint] * frame.placement * loop.first_placement

    def _frame(self, node: str) -> pin.Frame:
        return self.model.frames[self.mechanism.frame_id(node)]


def jacobian_by(mechanism: cinegen.Mechanism, q: Array, node: str, joints: Sequence[str]) -> Array:
    """Return (6, joints) how joints move a node in its own axes, while the others follow as the loops ask."""
    columns = [mechanism.v_index(name) for name in joints]
    moving, follow = np.setdiff1d(np.arange(mechanism.model.nv), columns), np.zeros((mechanism.model.nv, len(columns)))
    follow[columns, range(len(columns))] = 1.0
    if mechanism.is_constrained:
        loops = mechanism.structure.system.evaluate(q)[1]  # of dimensionless velocities
        led = np.linalg.pinv(loops[:, moving], rcond=1e-9) @ (loops / mechanism.scale)[:, columns]
        follow[moving] = -mechanism.scale[moving, None] * led
    return np.asarray(mechanism.jacobian(q, node) @ follow)
