"""The loops of a Pinocchio model as equations: residual and Jacobian of all joints that were cut."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, Indices
from cinegen.joints import axis, kinematic_data, step_scale, supporting_columns, translations
from cinegen.loops.thresholds import NEAR_SINGULAR
from raff2urdf.coupling import Coupling, coupled_scales
from raff2urdf.loops.length import cut_screws, moments
from raff2urdf.raff.document import LoopKind
from raff2urdf.residual import ROWS, loop_residual

LARGE = 64
"""Velocities of a cluster of loops (`cinegen.loops.clusters`) beyond which it is factored block by block."""

_ON_AXIS = 1e-9  # rad, characteristic lengths: what is nearer is on an axis

_COMPONENTS = {
    LoopKind.RIGID: ("x", "y", "z", "rx", "ry", "rz"),
    LoopKind.PRISMATIC: ("x", "y", "rx", "ry", "rz"),
    LoopKind.REVOLUTE: ("x", "y", "z", "rx", "ry"),
    LoopKind.BALL: ("x", "y", "z"),
}


@dataclass(frozen=True, slots=True)
class LoopConstraint:
    """The closure of a loop: a joint that was cut.

    Attributes:
        name: such as `link5-link11`.
        kind: of the joint: its two ends coincide up to the motion that it allows.
        first: the node that carries the first end.
        second: the node that carries the second end.
        first_placement: the first end in its node's frame, m.
        second_placement: the second end in its node's frame, m.
    """

    name: str
    kind: LoopKind
    first: str
    second: str
    first_placement: pin.SE3
    second_placement: pin.SE3

    def __repr__(self) -> str:
        return f"<LoopConstraint {self.name}: {self.kind.name.lower()}, {self.rows} rows>"

    @property
    def rows(self) -> int:
        """Number of its equations."""
        return ROWS[self.kind]

    @property
    def components(self) -> tuple[str, ...]:
        """The component of each row, in the first end's axes: x, y, z (lengths), rx, ry, rz (angles)."""
        return _COMPONENTS[self.kind]


class ClosedLoops:
    """All loops and couplings of a model as the equations c(q) = 0: a `raff2urdf.closure.KindedLoops`.

    Everything is dimensionless: lengths are divided by the characteristic length, and so are the steps of prismatic
    joints and of a free base's translation. For one thread at a time: it keeps Pinocchio's scratch data.

    Args:
        model: the tree.
        loops: the joints that were cut.
        length: characteristic length, m.
        couplings: equations between joints; their rows are below those of the loops.

    Attributes:
        coupling_sizes: factors that make the couplings' residuals dimensionless: see `raff2urdf.coupling`.
        coupling_slopes: (couplings, nv) their derivatives by the dimensionless step, of curves the steepest.
        scale: (nv,) size of one dimensionless step: `length` (m) for translations, 1 rad for rotations; more for
            joints that only drive others, see `raff2urdf.coupling.coupled_scales`.
        anchors: for each loop, of its two ends: the joint that carries it (index), and its placement on that joint.
        kinds: of the loops.
        cut_dof: for each loop, degrees of freedom of the joint that was cut.
        constraint_rows: for each loop, and then each coupling, indices of its equations.
        columns: for each loop, and then each coupling, indices of the velocities that change it.
        signs: for each loop (nv,) 1 for velocities that move its second end, -1 for those that move its first, else 0.
        sizes: for each loop, of the velocities that change it: these signs times `scale`.
        rows: number of equations.
        data: Pinocchio's, with the placements and Jacobians of the joints at the last evaluated q.
        held: columns of joints that do not move: none here, see `cinegen.loops.held_loops`.
        rest: (nq,) configuration of joints that no loop moves.
    """

    held: Indices = np.zeros(0, dtype=np.intp)

    def __init__(
        self, model: pin.Model, loops: Sequence[LoopConstraint], length: float, couplings: Sequence[Coupling] = ()
    ) -> None:
        self.model, self.loops, self.length, self.couplings = model, tuple(loops), length, tuple(couplings)
        self.scale = step_scale(model, length)
        self.anchors = [
            (*_anchor(model, loop.first, loop.first_placement), *_anchor(model, loop.second, loop.second_placement))
            for loop in self.loops
        ]
        self.data = kinematic_data(model)
        self.rest = np.asarray(pin.neutral(model))
        self.kinds = [loop.kind for loop in self.loops]
        self.cut_dof = [6 - loop.rows for loop in self.loops]
        self.rows = sum(loop.rows for loop in self.loops) + len(self.couplings)
        names = dict.fromkeys(joint for coupling in self.couplings for joint in coupling.terms)
        self._coupled = {name: model.joints[model.getJointId(name)] for name in names}
        lower, upper = model.lowerPositionLimit, model.upperPositionLimit
        self._limits = {name: (lower[joint.idx_q], upper[joint.idx_q]) for name, joint in self._coupled.items()}
        alone, outermost = self._scales_of(names), self._outermost(names)
        scales = coupled_scales(self.couplings, alone, outermost, self._limits)
        if screws := self._screws(alone, scales):
            scales = coupled_scales(self.couplings, alone, [*outermost, *screws], self._limits)
        for name, joint in self._coupled.items():
            self.scale[joint.idx_v] = scales[name]
        self._set_coupling_sizes(scales)
        supports = [[supporting_columns(model, joint) for joint in anchor[::2]] for anchor in self.anchors]
        self.signs = signs = [second - first for first, second in supports]
        coupled = [[self._coupled[name].idx_v for name in coupling.terms] for coupling in self.couplings]
        self.columns = [np.array(columns, dtype=np.intp) for columns in [*map(np.flatnonzero, signs), *coupled]]
        heights = [*(loop.rows for loop in self.loops), *[1] * len(self.couplings)]
        self.constraint_rows = np.split(np.arange(self.rows), np.cumsum(heights, dtype=int)[:-1]) if heights else []
        self.sizes = [sign[sign != 0.0] * self.scale[sign != 0.0] for sign in signs]

    def _set_coupling_sizes(self, scales: Mapping[str, float]) -> None:
        self.coupling_sizes = [coupling.size(scales, self._limits) or 1.0 for coupling in self.couplings]
        self.coupling_slopes = np.zeros((len(self.couplings), self.model.nv))
        for row, coupling, size in zip(self.coupling_slopes, self.couplings, self.coupling_sizes, strict=True):
            for name, slope in coupling.slopes(scales, self._limits).items():
                row[self._coupled[name].idx_v] = slope / size

    def _scales_of(self, names: Iterable[str]) -> dict[str, float]:
        return {name: float(self.scale[self._coupled[name].idx_v]) for name in names}

    def _outermost(self, names: Iterable[str]) -> list[str]:
        """Return the joints behind which there are no other joints and no ends of loops."""
        ends = {joint for anchor in self.anchors for joint in anchor[::2]}
        alone = {name: list(self.model.subtrees[self._coupled[name].id]) for name in names}
        return [name for name, behind in alone.items() if len(behind) == 1 and behind[0] not in ends]

    def _screws(self, alone: Mapping[str, float], scales: Mapping[str, float]) -> list[str]:
        """Return the revolute joints that alone drive others by screws of fine pitch, and behind which everything is on
        their axis: their rotation displaces nothing. Measured as 1 rad, their motion would seem nearly singular.

        Args:
            alone: scales without couplings.
            scales: those with the joints that only drive others.
        """
        screws = list[str]()
        for coupling in self.couplings:
            if any(scales[name] > alone[name] for name in coupling.terms):
                continue
            slopes = coupling.slopes(alone, self._limits)
            for name, slope in slopes.items():
                driven = max((abs(s) for other, s in slopes.items() if other != name), default=0.0)
                if driven > abs(slope) / NEAR_SINGULAR > 0.0 and self._is_coaxial(name):
                    screws.append(name)
        return screws

    def _is_coaxial(self, name: str) -> bool:
        """Return whether a revolute joint carries only joints, nodes and ends of loops on its own axis."""
        model, data, turning = self.model, self.data, self._coupled[name]
        if translations(turning):
            return False
        pin.forwardKinematics(model, data, pin.neutral(model))
        behind, on = list(model.subtrees[turning.id]), data.oMi[turning.id]
        way, points = on.rotation @ axis(turning), list[Array]()
        for j in behind:
            if model.joints[j].nq != 1 or model.joints[j].nv != 1:
                return False
            if np.linalg.norm(np.cross(data.oMi[j].rotation @ axis(model.joints[j]), way)) > _ON_AXIS:
                return False
            points += [] if translations(model.joints[j]) else [data.oMi[j].translation]
        frames = [(frame.parentJoint, frame.placement) for frame in model.frames if frame.type == pin.FrameType.BODY]
        ends = [end for a, on_a, b, on_b in self.anchors for end in ((a, on_a), (b, on_b))]
        points += [(data.oMi[j] * placed).translation for j, placed in (*frames, *ends) if j in behind]
        off = [float(np.linalg.norm(np.cross(point - on.translation, way))) for point in points]
        return max(off, default=0.0) <= _ON_AXIS * self.length

    def with_kinds(self, kinds: Sequence[LoopKind]) -> ClosedLoops:
        """Return the same loops, closed by other kinds of joints."""
        loops = [replace(loop, kind=kind) for loop, kind in zip(self.loops, kinds, strict=True)]
        return ClosedLoops(self.model, loops, self.length, self.couplings)

    def with_moved(self, steps: Mapping[int, tuple[Array, Array]]) -> ClosedLoops:
        """Return the same loops, some loops' ends moved by placements (4, 4) in their own axes."""
        loops = list(self.loops)
        for i, (first, second) in steps.items():
            loops[i] = replace(
                loops[i],
                first_placement=loops[i].first_placement * pin.SE3(first),
                second_placement=loops[i].second_placement * pin.SE3(second),
            )
        return ClosedLoops(self.model, loops, self.length, self.couplings)

    @property
    def ends(self) -> list[tuple[str, str]]:
        """Names of the nodes at both ends of each loop."""
        return [(loop.first, loop.second) for loop in self.loops]

    def placements(self, q: Array) -> list[Array]:
        """Return the placement (4, 4) of each loop's second end in its first, at q (nq,); m."""
        pin.forwardKinematics(self.model, self.data, q)
        ends = [(self.data.oMi[a] * on_a, self.data.oMi[b] * on_b) for a, on_a, b, on_b in self.anchors]
        return [first.actInv(second).homogeneous for first, second in ends]

    def integrate(self, q: Array, step: Array) -> Array:
        """Return the configuration (nq,) reached from q (nq,) by a dimensionless step (nv,)."""
        return np.asarray(pin.integrate(self.model, q, step * self.scale))

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Return the residual c (rows,) and its exact derivative (rows, nv) by the dimensionless step, at q (nq,)."""
        if self.model.nv == 0:  # Pinocchio would crash
            pin.forwardKinematics(self.model, self.data, q)
        else:
            pin.computeJointJacobians(self.model, self.data, q)
        return self.evaluate_placed(q)

    def drift(self, q: Array, v: Array) -> Array:
        """Return (dJ/dt) v (rows,), the dimensionless accelerations with which loops open if no joint accelerates.

        With the twists V_1, V_2 of a loop's ends and their rates A_1, A_2, all in the world, the twist of the second
        end relative to the first, seen from the first, changes by A_2 - A_1 - V_1 x (V_2 - V_1). The derivative of the
        residual by it does not change on the closed set.

        Args:
            q: (nq,) closed.
            v: (nv,) m/s and rad/s, loops kept closed.
        """
        data, rates = self.data, [np.zeros(0)]
        pin.forwardKinematics(self.model, data, q, v, np.zeros(self.model.nv))
        for loop, (first, on_first, second, on_second) in zip(self.loops, self.anchors, strict=True):
            v1, v2, a1, a2 = (
                data.oMi[j].act(moves[j]) if j else pin.Motion.Zero()
                for moves in (data.v, data.a)
                for j in (first, second)
            )
            end = data.oMi[first] * on_first
            by_twist = loop_residual(loop.kind, end.actInv(data.oMi[second] * on_second).homogeneous, self.length)[1]
            rates.append(by_twist @ end.actInv(a2 - a1 - v1.cross(v2 - v1)).vector)
        for coupling, size in zip(self.couplings, self.coupling_sizes, strict=True):
            bend = 0.0
            for name, coefficients in coupling.terms.items():
                joint, powers = self._coupled[name], enumerate(coefficients[1:], 2)
                bend += v[joint.idx_v] ** 2 * sum(k * (k - 1) * c * q[joint.idx_q] ** (k - 2) for k, c in powers)
            rates.append(np.array([bend / size]))
        return np.concatenate(rates)

    def screws(self) -> Array:
        """Return the unit twists (6, nv + .) of all velocities, and then of the joints that were cut, for what is in
        `data`: the velocity of the point at the world's origin above the angular velocity; m and rad."""
        cut = [
            cut_screws(loop.kind, (self.data.oMi[anchor[0]] * anchor[1]).homogeneous)
            for loop, anchor in zip(self.loops, self.anchors, strict=True)
        ]
        return np.hstack([np.asarray(self.data.J).reshape(6, -1), *cut])

    def cut_rates(self) -> Array:
        """Return the velocities (., nv) of the joints that were cut, by the dimensionless step, for what is in `data`;
        dimensionless. Loops of clusters with more than `LARGE` velocities are left out."""
        columns, rates = np.asarray(self.data.J).reshape(6, -1), [np.zeros((0, self.model.nv))]
        for i in self._measured:
            loop, (joint, placement, *_) = self.loops[i], self.anchors[i]
            screws = cut_screws(loop.kind, (self.data.oMi[joint] * placement).homogeneous)
            twists = columns * (self.signs[i] * self.scale)
            if loop.kind is LoopKind.PRISMATIC:
                point = (self.data.oMi[joint] * placement).translation
                rates.append(screws[:3].T @ moments(twists, point) / self.length)
            else:
                rates.append(screws[3:].T @ twists[3:])
        return np.vstack(rates)

    @cached_property
    def _measured(self) -> list[int]:
        """Loops whose cut joints' velocities are measured, too."""
        groups = linked(self.columns)
        return [i for members, columns in groups if len(columns) <= LARGE for i in members if i < len(self.loops)]

    def evaluate_placed(self, q: Array) -> tuple[Array, Array]:
        """Return the same for the placements and the Jacobians of the joints at q that are in `data`."""
        residual, jacobian, row = np.empty(self.rows), np.zeros((self.rows, self.model.nv)), 0
        columns, placements = np.asarray(self.data.J).reshape(6, -1), self.data.oMi
        for loop, anchor, moving, sizes in zip(self.loops, self.anchors, self.columns, self.sizes, strict=False):
            first, second = placements[anchor[0]] * anchor[1], placements[anchor[2]] * anchor[3]
            c, by_twist = loop_residual(loop.kind, first.actInv(second).homogeneous, self.length)
            rows = slice(row, row + loop.rows)
            residual[rows] = c
            # the twist of the second end relative to the first, in the first's axes, at its origin
            jacobian[rows, moving] = by_twist @ first.toActionMatrixInverse() @ columns[:, moving] * sizes
            row += loop.rows
        if self.couplings:
            values = {name: float(q[joint.idx_q]) for name, joint in self._coupled.items()}
        for coupling, size in zip(self.couplings, self.coupling_sizes, strict=True):
            lack, slopes = coupling.evaluate(values)
            residual[row] = lack / size
            for name, slope in slopes.items():
                column = self._coupled[name].idx_v
                jacobian[row, column] = slope / size * self.scale[column]
            row += 1
        return residual, jacobian


def _anchor(model: pin.Model, node: str, placement: pin.SE3) -> tuple[int, pin.SE3]:
    frame = model.frames[model.getFrameId(node, pin.FrameType.BODY)]
    return frame.parentJoint, frame.placement * placement


def linked(constraints: Sequence[Indices]) -> list[tuple[list[int], Indices]]:
    """Return constraints, by their indices, and columns in groups: those of two groups share no column.

    Args:
        constraints: columns of each.
    """
    groups: list[tuple[list[int], set[int]]] = []
    for i, columns in enumerate(constraints):
        members, together, apart = [i], set(columns.tolist()), []
        for group in groups:
            if group[1].isdisjoint(together):
                apart.append(group)
            else:
                members, together = group[0] + members, group[1] | together
        groups = [*apart, (sorted(members), together)]
    return [
        (members, np.array(sorted(columns), dtype=np.intp))
        for members, columns in sorted(groups, key=lambda group: group[0])
    ]
