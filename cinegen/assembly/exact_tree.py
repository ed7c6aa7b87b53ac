"""Placements of the bodies of a model in ball arithmetic, with rotation matrices and axes made exactly orthonormal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from flint import arb, arb_mat

from cinegen.arrays import Array
from cinegen.balls import axes_and_origin, combined, dot, frame, unit
from cinegen.joints import axis, translations

NEXT = ((0, 1, 2), (1, 2, 0), (2, 0, 1))


class ExactTree:
    """Placements of the bodies of a model.

    They are seen from the first joint behind a branch, as its placement is written. So placements of joints with the
    same rotation cancel exactly, and a linkage in a plane has no components across it, even if that plane is not one of
    the coordinates'.
    """

    def __init__(self, model: pin.Model, joints: Iterable[int], q: Array) -> None:
        self.joints = {j: ExactAxis(model.joints[j]) for j in joints}
        self.supports = [list(map(int, model.supports[j])) for j in range(model.njoints)]
        self._parents = list(map(int, model.parents))
        written = [pin.SE3(placement) for placement in model.jointPlacements]
        for j in range(1, model.njoints):
            if j not in self.joints:  # a free base, and the like, stays where it is
                data = model.joints[j].createData()
                model.joints[j].calc(data, q)
                written[j] = written[j] * data.M
        self._first = dict[int, pin.SE3]()
        for j in range(1, model.njoints):
            self._first.setdefault(self._parents[j], written[j])
        self._constant = [exact(placement) for placement in written]
        self._turned = dict[int, Any]()
        self._leading = [self.leading(parent, at) for parent, at in zip(self._parents, written, strict=True)]

    def leading(self, branch: int, placement: pin.SE3) -> arb_mat:
        """Return a placement on a branch's body, seen as all behind the branch is."""
        return relative(self._first.get(branch, pin.SE3.Identity()), placement)

    def recentre(self, ball: Sequence[int], angles: Array) -> None:
        """Let the angles of the three joints of a ball joint be 0 where they are the given ones (3,)."""
        first, second, third = (self.joints[j].step(arb(float(x))) for j, x in zip(ball, angles, strict=True))
        inner, outer = self._constant[ball[1]], self._constant[ball[2]]
        self._turned[ball[0]] = first * inner * second * outer * third * (inner * outer).inv()

    def placed(self, values: Mapping[int, arb]) -> Callable[[int, int], arb_mat]:
        """Return a function that returns the placement (4, 4) of a joint's body behind a branch, at joint values."""
        known: dict[tuple[int, int], arb_mat] = {}
        steps: dict[int, Any] = {}

        def placed(branch: int, joint: int) -> arb_mat:
            if (branch, joint) not in known:
                parent = self._parents[joint]
                if joint not in steps:
                    steps[joint] = self.joints[joint].step(values[joint]) if joint in self.joints else None
                before = self._leading[joint] if parent == branch else placed(branch, parent) * self._constant[joint]
                before = before * self._turned[joint] if joint in self._turned else before
                known[branch, joint] = before if steps[joint] is None else before * steps[joint]
            return known[branch, joint]

        return placed


class ExactAxis:
    """A revolute or prismatic joint's axis, made exactly a unit vector."""

    def __init__(self, joint: Any) -> None:
        direction = axis(joint)
        self.is_prismatic = translations(joint) == 1
        self._along = np.flatnonzero(direction).tolist()
        self.unit = unit([arb(float(x)) for x in direction])

    def along(self, axes: list[list[arb]]) -> list[arb]:
        """Return the axis for the axes of its body."""
        if len(self._along) == 1:
            return [self.unit[self._along[0]] * x for x in axes[self._along[0]]]
        return combined(axes, self.unit)

    def step(self, value: arb) -> arb_mat:
        """Return the displacement (4, 4) of the joint."""
        if self.is_prismatic:
            rows = [[int(i == j) for j in range(3)] + [self.unit[i] * value] for i in range(3)]
            return arb_mat([*rows, [0, 0, 0, 1]])
        s, c = value.sin_cos()
        if len(self._along) == 1:  # exact zeros stay exact
            i, j, k = NEXT[self._along[0]]
            s, rows = s * self.unit[i], [[0] * 4 for _ in range(4)]
            rows[i][i] = rows[3][3] = 1
            rows[j][j], rows[j][k], rows[k][j], rows[k][k] = c, -s, s, c
            return arb_mat(rows)
        x, y, z = self.unit
        v = 1 - c
        return arb_mat([
            [c + v * x * x, v * x * y - s * z, v * x * z + s * y, 0],
            [v * x * y + s * z, c + v * y * y, v * y * z - s * x, 0],
            [v * x * z - s * y, v * y * z + s * x, c + v * z * z, 0],
            [0, 0, 0, 1],
        ])  # fmt: skip


def exact(placement: pin.SE3) -> arb_mat:
    """Return a placement (4, 4) whose rotation is exactly one."""
    return frame(placement.rotation, placement.translation)


def relative(first: pin.SE3, second: pin.SE3) -> arb_mat:
    """Return the second placement seen from the first, with exact zeros where rotations or origins are the same."""
    shift = [arb(float(b)) - arb(float(a)) for a, b in zip(first.translation, second.translation, strict=True)]
    axes, _ = axes_and_origin(exact(first))
    if np.array_equal(first.rotation, second.rotation):
        turned = [[arb(int(i == j)) for j in range(3)] for i in range(3)]
    else:
        others, _ = axes_and_origin(exact(second))
        turned = [[dot(axis, other) for other in others] for axis in axes]
    rows = [[*row, dot(axis, shift)] for row, axis in zip(turned, axes, strict=True)]
    return arb_mat([*rows, [arb(0), arb(0), arb(0), arb(1)]])
