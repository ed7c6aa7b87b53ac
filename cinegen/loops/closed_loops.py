"""A mechanism's loops through Pinocchio's constraint models: residual and Jacobian of all joints that were cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.joints import supporting_columns
from raff2urdf.document import LoopKind
from raff2urdf.loops import ROWS, gap

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Loop:
    """A joint that was cut.

    Attributes:
        name: such as `link5-link11`.
        kind: which joint it was; the ends coincide up to its freedoms.
        first: the node that carries the first end.
        second: the node that carries the second end.
        first_placement: the first end seen from its node.
        second_placement: the second end seen from its node.
    """

    name: str
    kind: LoopKind
    first: str
    second: str
    first_placement: pin.SE3
    second_placement: pin.SE3

    @property
    def rows(self) -> int:
        """How many equations it adds."""
        return ROWS[self.kind]

    @property
    def components(self) -> tuple[str, ...]:
        """What each of its rows says, in the first end's axes."""
        return {
            LoopKind.RIGID: ("x", "y", "z", "rx", "ry", "rz"),
            LoopKind.PRISMATIC: ("x", "y", "rx", "ry", "rz"),
            LoopKind.REVOLUTE: ("x", "y", "z", "rx", "ry"),
            LoopKind.BALL: ("x", "y", "z"),
        }[self.kind]


class ClosedLoops:
    """All loops of a model as the equations c(q) = 0: a `raff2urdf.closure.LoopSystem`.

    Without unit: lengths are divided by the characteristic length, and so are the steps of prismatic joints and
    of a free base's translation. Not for two threads at once: it keeps Pinocchio's scratch data.

    Args:
        model: the tree.
        loops: the joints that were cut.
        anchors: for each loop, of its two ends: joint and placement on that joint.
        length: the characteristic length, m.
        scale: (nv,) what one dimensionless step is in q: metres for a slide, 1 for an angle.
    """

    def __init__(
        self,
        model: pin.Model,
        loops: Sequence[Loop],
        anchors: Sequence[tuple[int, pin.SE3, int, pin.SE3]],
        length: float,
        scale: Array,
    ) -> None:
        self.model, self.loops, self.length, self.scale = model, tuple(loops), length, scale
        self.anchors = anchors
        self.data = model.createData()
        self.rows = sum(loop.rows for loop in loops)
        self._constraints: list[Any] = [pin.FrameAnchorConstraintModel(model, *anchor) for anchor in anchors]
        self._datas = [constraint.createData() for constraint in self._constraints]
        columns = [[supporting_columns(model, anchor[end]) for end in (0, 2)] for anchor in anchors]
        self._moving = [np.flatnonzero(first != second) for first, second in columns]

    def with_kinds(self, kinds: Sequence[LoopKind]) -> ClosedLoops:
        """The same loops, closed by other kinds of joints."""
        loops = [replace(loop, kind=kind) for loop, kind in zip(self.loops, kinds, strict=True)]
        return ClosedLoops(self.model, loops, self.anchors, self.length, self.scale)

    def integrate(self, q: Array, step: Array) -> Array:
        """The configuration reached from q (nq,) by a dimensionless step (nv,)."""
        return np.asarray(pin.integrate(self.model, q, step * self.scale))

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Residual c (rows,) and its exact derivative (rows, nv) by the dimensionless step, at q (nq,)."""
        residual, jacobian = np.empty(self.rows), np.zeros((self.rows, self.model.nv))
        if self.model.nv == 0:  # Pinocchio would crash
            pin.forwardKinematics(self.model, self.data, q)
        else:
            pin.computeJointJacobians(self.model, self.data, q)
        row = 0
        for loop, constraint, data, moving in zip(
            self.loops, self._constraints, self._datas, self._moving, strict=True
        ):
            constraint.calc(self.model, self.data, data)  # without it the Jacobian is silently wrong
            part, derivative = gap(loop.kind, data.c1Mc2.homogeneous, self.length)
            # Pinocchio's: the twist of the second end relative to the first, in the first's axes, at its origin
            twist = (
                np.asarray(constraint.jacobian(self.model, self.data, data)).reshape(6, -1) if moving.size else _NONE
            )
            rows = slice(row, row + loop.rows)
            residual[rows] = part
            jacobian[rows, moving] = derivative @ (twist[:, moving] * self.scale[moving])
            row += loop.rows
        return residual, jacobian

    def gaps(self, q: Array) -> list[float]:
        """The largest residual of each loop, without unit."""
        parts = np.split(self.evaluate(q)[0], np.cumsum([loop.rows for loop in self.loops])[:-1])
        return [float(np.abs(part).max()) for part in parts] if self.loops else []


_NONE = np.zeros((6, 0))
