"""The screw matrix of a mechanism's loops, in numpy: in closed form, and by differences of Pinocchio's placements."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg import fractional_matrix_power
from scipy.sparse.csgraph import connected_components

import cinegen
from raff2urdf.raff.document import LoopKind

Array = NDArray[np.float64]

_STEP = 1e-5  # rad, characteristic lengths
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
        self.owner = [k for k, loop in enumerate(mechanism.loops) for _ in _FREE[loop.kind]]
        self.free = [c for loop in mechanism.loops for c in _FREE[loop.kind]]
        nv, length = self.model.nv, mechanism.length
        self.scale = np.append(mechanism.scale, [length if c < 3 else 1.0 for c in self.free])
        self.signs = np.zeros((len(mechanism.loops), nv + len(self.free)))
        for k, loop in enumerate(mechanism.loops):
            for node, sign in ((loop.first, -1.0), (loop.second, 1.0)):
                for j in self.model.supports[self._frame(node).parentJoint]:
                    self.signs[k, self.model.joints[j].idx_v : self.model.joints[j].idx_v + self.model.nvs[j]] += sign
        self.signs[self.owner, nv + np.arange(len(self.free))] = -1.0
        home = self._placements(mechanism.q_home)
        axes = self._axes(home)
        self.cluster = connected_components(self.signs @ self.signs.T)[1]
        self.lengths, self.points = [], []
        for c in range(self.cluster.max() + 1):
            own = [(*axes[j], j) for j in np.flatnonzero(self.signs[self.cluster == c].any(axis=0)) if axes[j]]
            across = [np.eye(3) - np.outer(w, w) for _, w, _, _ in own]
            right = sum(m @ point for m, (point, *_) in zip(across, own, strict=True))
            near = np.mean([home[body].translation for *_, body, _ in own], axis=0)
            centre = near + np.linalg.lstsq(sum(across), right - sum(across) @ near, rcond=1e-4)[0]
            self.lengths.append(np.sqrt(np.mean([np.sum(np.cross(w, p - centre) ** 2) for p, w, *_ in own])))
            # of axes the points nearest to their centre, of balls their own point
            balls = [j >= nv and mechanism.loops[self.owner[j - nv]].kind is LoopKind.BALL for *_, j in own]
            nearest = [
                (p if ball else p + w * (w @ (centre - p)), body)
                for (p, w, body, _), ball in zip(own, balls, strict=True)
            ]
            self.points.append([(body, home[body].actInv(p)) for p, body in nearest])

    def matrix(self, q: Array) -> Array:
        """Return (6 loops, nv + cut) at q (nq,): the velocities with which the ends of loops part, each loop cut open,
        in characteristic lengths of its cluster and rad; loops that share joints are distributed evenly."""
        here, columns = self._placements(q), np.eye(len(self.scale))
        twists = np.zeros((len(self.signs), 6, len(self.scale)))
        for j, column in enumerate(columns):
            ahead, behind = (self._gaps(q, side * _STEP * column * self.scale) for side in (1.0, -1.0))
            for k, loop in enumerate(self.mechanism.loops):
                end = self._end(here, loop.second, loop.second_placement)
                twist = end.act(pin.log6(behind[k].inverse() * ahead[k]))
                c = self.cluster[k]
                centre = np.mean([here[body].act(point) for body, point in self.points[c]], axis=0)
                v = twist.linear + np.cross(twist.angular, centre)
                twists[k, :, j] = np.append(v / self.lengths[c], twist.angular) / (2.0 * _STEP)
        found = np.zeros_like(twists)
        for c in range(self.cluster.max() + 1):
            own = np.flatnonzero(self.cluster == c)
            squares = self.signs[own] @ self.signs[own].T
            mix = np.linalg.det(squares) ** (0.5 / len(own)) * fractional_matrix_power(squares, -0.5)
            found[own] = np.einsum("lm,mrk->lrk", mix, twists[own])
        return found.reshape(-1, len(self.scale))

    def _gaps(self, q: Array, step: Array) -> list[pin.SE3]:
        """Return where each loop's second end is, seen from its first, after joints have moved by a step."""
        nv = self.model.nv
        moved, gaps = self._placements(pin.integrate(self.model, q, step[:nv])), []
        for k, loop in enumerate(self.mechanism.loops):
            cut = np.zeros(6)
            for i, c in enumerate(self.free):
                cut[c] += step[nv + i] * (self.owner[i] == k)
            # the cut joint moves the second end by as much as joints on its first side, seen from its own axes
            first = self._end(moved, loop.first, loop.first_placement) * pin.exp6(pin.Motion(cut))
            gaps.append(first.inverse() * self._end(moved, loop.second, loop.second_placement))
        return gaps

    def _axes(self, home: list[pin.SE3]) -> list[tuple[Array, Array, int] | None]:
        """Return for each velocity a point and the direction of its axis of rotation at home, and the joint that
        carries it; None for translations."""
        data, axes = self.model.createData(), list[Any]()
        pin.computeJointJacobians(self.model, data, self.mechanism.q_home)
        for column, j in zip(data.J.T, np.repeat(range(self.model.njoints), list(self.model.nvs)), strict=True):
            v, w = np.split(column, 2)
            axes.append((np.cross(w, v), w, int(j)) if w.any() else None)
        for k, c in zip(self.owner, self.free, strict=True):
            loop = self.mechanism.loops[k]
            end, body = self._end(home, loop.first, loop.first_placement), self._frame(loop.first).parentJoint
            axes.append((end.translation, end.rotation[:, c - 3], body) if c >= 3 else None)
        return axes

    def _frame(self, node: str) -> pin.Frame:
        return self.model.frames[self.mechanism.frame_id(node)]

    def _placements(self, q: Array) -> list[pin.SE3]:
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, q)
        return [placement.copy() for placement in data.oMi]

    def _end(self, placements: list[pin.SE3], node: str, placement: pin.SE3) -> pin.SE3:
        frame = self._frame(node)
        return placements[frame.parentJoint] * frame.placement * placement


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
