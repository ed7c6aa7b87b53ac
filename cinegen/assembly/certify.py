"""`LoopEquations`: the loops of a mechanism, and the pose of a node, in ball arithmetic: for certificates.

The mechanism that is certified has the model's numbers, as exact doubles: placements, axes, locked joints' values,
coefficients of couplings. Only rotation matrices and axes are made exactly orthonormal, which changes them by rounding.

A loop has as many equations as its joint constrains DoF. With u1 and v2 axes of its two ends, and p1 and p2 their
origins, an equation is either of

    u1 . (p2 - p1) = 0          u1 . v2 = 0          u1 . v2 - v1 . u2 = 0

and signs of further products exclude ends that are opposed. The derivative by a revolute joint with axis a through p on
the second end's side is u1 . (a x (p2 - p)), a . (v2 x u1), and is reversed on the first end's side; a joint before the
branch of both moves no equation. Everything is seen from that branch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from flint import arb, arb_mat

from cinegen.arrays import Array
from cinegen.assembly.exact_tree import NEXT, ExactTree, exact
from cinegen.balls import axes_and_origin, combined, cross, dot, minus, precise
from cinegen.krawczyk import Certificate, Values, certify, distinct
from cinegen.model import Mechanism
from raff2urdf.raff.document import LoopKind

_AXES = (0, 1, 2)


class EndEquations(NamedTuple):
    """The constraints between two ends.

    Attributes:
        translations: the first end's axes along which their origins coincide.
        rotations: number of constrained rotations.
        about: the axis that both ends share if 2 rotations are constrained, or about which 1 is.
    """

    translations: tuple[int, ...] = _AXES
    rotations: int = 3
    about: int = 2


class BodyFeature(NamedTuple):
    """A point or a direction that distinguishes solutions: the joint whose body it is fixed in, and (3,) where, m."""

    joint: str
    is_direction: bool
    local: tuple[float, ...]


class Unknowns(NamedTuple):
    """The unknowns of a set of solutions.

    Attributes:
        joints: names of the joints whose values are unknown.
        rank: generic rank of the equations' derivatives by them; it is less than their number where joints may move
            without any effect, as those of a rod that rotates about itself.
        features: points and directions that distinguish solutions.
    """

    joints: tuple[str, ...]
    rank: int
    features: tuple[BodyFeature, ...]


_KINDS = {
    LoopKind.RIGID: EndEquations(),
    LoopKind.PRISMATIC: EndEquations(translations=(0, 1)),
    LoopKind.REVOLUTE: EndEquations(rotations=2),
    LoopKind.BALL: EndEquations(rotations=0),
}


class LoopEquations:
    """Equations of a mechanism's loops and couplings, and of the pose of a node.

    Args:
        mechanism: whose joints are revolute or prismatic; a free base stays where it is.
        unknowns: of the solutions.
        q: (nq,) the values of all other joints, rad and m.
        balls: names of three successive joints that are a ball joint: their angles count from a solution's orientation,
            so that no solution is at their gimbal lock.
        pose: a frame on a node, the pose that it is brought to, and what of it is constrained.
    """

    def __init__(
        self, mechanism: Mechanism, unknowns: Unknowns, q: Array, balls: Iterable[Sequence[str]] = (),
        pose: tuple[str, pin.SE3, pin.SE3, EndEquations] | None = None,
    ) -> None:  # fmt: skip
        model, self._rank = mechanism.model, unknowns.rank
        index = {name: int(model.getJointId(name)) for name in mechanism.joints}
        self._joints = [index[name] for name in unknowns.joints]
        self._index = np.array([mechanism.q_index(name) for name in unknowns.joints], dtype=np.intp)
        among = [[unknowns.joints.index(name) for name in ball if name in unknowns.joints] for ball in balls]
        self._balls = [columns for columns in among if len(columns) == 3]
        is_prismatic = [mechanism.is_prismatic(name) for name in unknowns.joints]
        self._units = np.where(is_prismatic, mechanism.length, 1.0)
        with precise():
            self._values = {j: arb(float(q[model.joints[j].idx_q])) for j in index.values()}
            self._tree = ExactTree(model, index.values(), q)
            self._closures = [
                _Closure(
                    self._tree, _end(mechanism, loop.first, loop.first_placement),
                    _end(mechanism, loop.second, loop.second_placement), _KINDS[loop.kind], mechanism.length,
                )
                for loop in mechanism.loops
            ]  # fmt: skip
            if pose is not None:  # loops that nothing of it moves stay as they are
                node, offset, target, constrained = pose
                self._closures = [closure for closure in self._closures if closure.signs.keys() & self._joints]
                ends = _End(0, (target,)), _end(mechanism, node, offset)
                self._closures.append(_Closure(self._tree, *ends, constrained, mechanism.length))
            self._couplings = [
                _Polynomials(
                    {index[joint]: [arb(float(c)) for c in row] for joint, row in coupling.terms.items()},
                    arb(float(coupling.constant)), arb(float(size)),
                )
                for coupling, size in zip(mechanism.couplings, mechanism.structure.system.coupling_sizes, strict=True)
                if pose is None or any(index[joint] in self._joints for joint in coupling.terms)
            ]  # fmt: skip
            self._features = [(index[f.joint], f.is_direction, [arb(x) for x in f.local]) for f in unknowns.features]

    def certificates(self, solutions: Iterable[Array], coincident: Iterable[int]) -> tuple[Certificate | None, ...]:
        """Return the certificate of each solution (nq,): None where it can't be certified, as where several coincide,
        or where it is not distinct from one before it."""
        return distinct(map(self._certified, solutions, coincident))

    def _certified(self, q: Array, count: int) -> tuple[Certificate, list[arb]] | None:
        """Return the certificate of a solution (nq,), and its features."""
        if count > 1:
            return None
        point = np.array(q[self._index])
        with precise():
            for columns in self._balls:
                self._tree.recentre([self._joints[k] for k in columns], point[columns])
                point[columns] = 0.0
        certified = certify(self.evaluate, point, self._units, self._rank)
        return None if certified is None else (certified[0], self._features_at(certified[1]))

    def evaluate(self, box: Sequence[arb], derive: bool) -> Values:
        """Return the equations over a box of the unknown joints' values, with derivatives if asked for."""
        values = {**self._values, **dict(zip(self._joints, box, strict=True))}
        placed, out, unknown = self._tree.placed(values), Values([], [], []), self._joints if derive else []
        for closure in self._closures:
            closure.write(self._tree, placed, unknown, out)
        for coupling in self._couplings:
            coupling.write(values, unknown, out)
        return out

    def _features_at(self, box: Sequence[arb]) -> list[arb]:
        """Return the coordinates of the features over a box of the unknown joints' values."""
        with precise():
            placed = self._tree.placed({**self._values, **dict(zip(self._joints, box, strict=True))})
            return [x for j, straight, local in self._features for x in _moved(placed(0, j), local, straight)]


class _End(NamedTuple):
    """A frame on a body: the joint that moves the body, and placements from there on."""

    joint: int
    placements: tuple[pin.SE3, ...]


def _end(mechanism: Mechanism, node: str, placement: pin.SE3) -> _End:
    at = mechanism.model.frames[mechanism.frame_id(node)]
    return _End(int(at.parentJoint), (at.placement, placement))


class _Closure:
    """Two ends that coincide, up to the motion that is free.

    Attributes:
        signs: 1 for joints that move the second end only, -1 for the first.
    """

    def __init__(self, tree: ExactTree, first: _End, second: _End, constrained: EndEquations, length: float) -> None:
        chains = [tree.supports[end.joint] for end in (first, second)]
        common = [a for a, b in zip(*chains, strict=False) if a == b]
        self._branch = common[-1]
        self.signs = {j: -1 for j in chains[0][len(common) :]} | {j: 1 for j in chains[1][len(common) :]}
        self._constrained, self._length = constrained, arb(length)
        self._joints = [first.joint, second.joint]
        self._ends = [self._on(tree, end.joint, end.placements) for end in (first, second)]
        self._oriented = self._ends
        if constrained.rotations == 3:  # rotations that both ends end with cancel
            turns = [[pin.SE3(at.rotation, np.zeros(3)) for at in end.placements] for end in (first, second)]
            while all(turns) and np.array_equal(*(end[-1].rotation for end in turns)):
                turns = [end[:-1] for end in turns]
            ends = ((joint, turn or [pin.SE3.Identity()]) for joint, turn in zip(self._joints, turns, strict=True))
            self._oriented = [self._on(tree, joint, placements) for joint, placements in ends]

    def _on(self, tree: ExactTree, joint: int, placements: Sequence[pin.SE3]) -> arb_mat:
        """Return the placement of an end on its joint's body; behind the branch, if it is on the branch's body."""
        first, *others = placements
        placement = tree.leading(self._branch, first) if joint == self._branch else exact(first)
        for other in others:
            placement = placement * exact(other)
        return placement

    def write(
        self, tree: ExactTree, placed: Callable[[int, int], arb_mat], unknown: Sequence[int], out: Values
    ) -> None:
        """Append the equations for placements of the bodies, with derivatives by the unknown joints."""

        def both(ends: Sequence[arb_mat]) -> list[tuple[list[list[arb]], list[arb]]]:
            return [
                axes_and_origin(at if joint == self._branch else placed(self._branch, joint) * at)
                for joint, at in zip(self._joints, ends, strict=True)
            ]

        (first, p), (second, end) = both(self._ends)
        linear, rotations, about = self._constrained
        gap, ends, (i, j, k) = minus(end, p), first, NEXT[about]
        products = list[list[tuple[int, int]]]()  # of the ends' axes; the second of two is subtracted
        if rotations == 3:
            products, agree = [[(a, b), (b, a)] for a, b, _ in NEXT], [0, 1, 2]
        elif rotations:
            products, agree = ([[(j, i)], [(k, i)]], [i]) if rotations == 2 else ([[(j, k)]], [j])
        out.residual.extend(x / self._length for x in _along(first, gap, linear))
        if self._oriented is not self._ends:
            first, second = (axes for axes, _ in both(self._oriented))
        for terms in products:
            out.residual.append(_difference([dot(first[a], second[b]) for a, b in terms]))
        if rotations:
            out.positive.append(sum((dot(first[a], second[a]) for a in agree), start=0 * self._length))
        turns = [[cross(second[b], first[a]) for a, b in terms] for terms in products]
        turned = [turn[0] if len(turn) == 1 else minus(*turn) for turn in turns]
        columns = []
        zero = 0 * self._length
        for joint in unknown:
            if joint not in self.signs:
                columns.append([zero] * (len(linear) + len(products)))
                continue
            axes, origin = axes_and_origin(placed(self._branch, joint))
            step = tree.joints[joint]
            along = step.along(axes)
            tip = p if len(linear) == 3 and self.signs[joint] < 0 else end  # first's axes move with the first's joints
            velocity = along if step.is_prismatic else cross(along, minus(tip, origin))
            by = [x / self._length for x in _along(ends, velocity, linear)]
            by += [zero if step.is_prismatic else dot(along, turn) for turn in turned]
            columns.append(by if self.signs[joint] > 0 else [-x for x in by])
        out.jacobian.extend(map(list, zip(*columns, strict=True)))


class _Polynomials(NamedTuple):
    """A coupling: coefficients of joints, by their indices, constant and size."""

    terms: Mapping[int, list[arb]]
    constant: arb
    size: arb

    def write(self, values: Mapping[int, arb], unknown: Sequence[int], out: Values) -> None:
        """Append the equation, with derivatives by the unknown joints."""
        residual, slopes = -self.constant, {}
        for joint, coefficients in self.terms.items():
            value, slope = 0 * self.constant, 0 * self.constant
            for c in reversed(coefficients):  # Horner's scheme
                slope = slope * values[joint] + value + c
                value = (value + c) * values[joint]
            residual, slopes[joint] = residual + value, slope
        out.residual.append(residual / self.size)
        out.jacobian.append([slopes.get(j, 0 * self.size) / self.size for j in unknown])


def _moved(placement: arb_mat, local: list[arb], is_direction: bool) -> list[arb]:
    """Return where a placement (4, 4) brings a point, or a direction."""
    axes, origin = axes_and_origin(placement)
    rotated = combined(axes, local)
    return rotated if is_direction else [a + b for a, b in zip(rotated, origin, strict=True)]


def _along(axes: list[list[arb]], vector: list[arb], which: Sequence[int]) -> list[arb]:
    """Return the components of a vector along some of three axes: those of the coordinates where it is all of them."""
    return vector if len(which) == 3 else [dot(axes[k], vector) for k in which]


def _difference(numbers: Sequence[arb]) -> arb:
    """Return the first of one or two numbers minus the second."""
    return numbers[0] if len(numbers) == 1 else numbers[0] - numbers[1]
