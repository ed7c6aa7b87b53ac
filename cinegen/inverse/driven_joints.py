"""`DrivenJoints`: joints that don't move a node, where couplings with those that do drive them.

With the moving joints at their values, a coupling of one other joint x is a polynomial p(x) = c: its real roots are all
values that the joint may have. Couplings are solved one after the other; those that remain, each with several joints,
have one solution if they are linear. Loops that joints in couplings belong to may have several: not all are computed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

import numpy as np
from flint import acb_poly, arb

from cinegen.arrays import Array
from cinegen.assembly.certify import BodyFeature
from cinegen.errors import ClosureError
from cinegen.joints import axis
from cinegen.model import Mechanism
from raff2urdf import closure
from raff2urdf.coupling import Coupling, determining

_KNOWN = 1e-10  # rad, m: how exactly other joints are known
_SAME = 1e-6  # rad, m
_STILL = 1e-9  # steps of a joint for one of a joint that moves the node
_REVOLUTION = 2.0 * np.pi + 1e-6  # rad: between limits that are farther apart a joint makes more than one revolution


class DrivenJoints:
    """Joints that don't move a node, and may be in couplings.

    Args:
        mechanism: the mechanism.
        idle: these joints, without locked ones.
        in_loops: all joints in loops.
        samples: closed configurations (nq,).

    Attributes:
        staying: those that stay where they are: with the joints that move the node they determine the others. Of joints
            in couplings these are as few passive ones as possible.
        unexamined: names of couplings that may have solutions besides those of `configurations`.
        features: points that distinguish the values of joints of whose variables powers occur.
    """

    def __init__(
        self, mechanism: Mechanism, idle: Collection[str], in_loops: Collection[str], samples: Sequence[Array]
    ) -> None:
        self._mechanism = mechanism
        columns = {mechanism.v_index(name): name for name in sorted(idle, key=lambda name: name in mechanism.actuated)}
        coupled = {name for coupling in mechanism.couplings for name in coupling.terms}
        matrices = [mechanism.structure.system.evaluate(q)[1] for q in reversed(samples)]
        equations = max(matrices, key=lambda matrix: closure.rank(matrix[:, [*columns]]))  # a cam dwells at home
        dependent = closure.passive(equations, [*columns]) if columns else []
        others = np.delete(equations, [*columns], axis=1)
        moved = np.abs(np.linalg.pinv(equations[:, dependent]) @ others).max(axis=1, initial=0.0) > _STILL
        driven = {columns[k] for k, moves in zip(dependent, moved, strict=True) if moves or columns[k] in coupled}
        self.staying = tuple(name for name in mechanism.joints if name in idle and name not in driven)
        self._kept = tuple(name for name in mechanism.joints if name not in driven)
        self._solved = determining(mechanism.couplings, self._kept)
        known = {*self._kept, *(coupling.follower for coupling in self._solved)}
        self.unexamined = {
            coupling.name
            for coupling in mechanism.couplings
            for name, coefficients in coupling.terms.items()
            if (name in driven and name in in_loops) or (name not in known and len(coefficients) > 1)
        }
        bent = [c.follower for c in self._solved if len(c.terms[c.follower]) > 1]
        self.features = tuple(BodyFeature(name, False, self._beside_axis(name)) for name in bent)

    def remarks(self, moving: Iterable[str]) -> list[str]:
        """Return what solutions are without: parts of a sentence. `moving` are the joints that move the node."""
        remarks = list[str]()
        if self.features:
            bent = ", ".join(feature.joint for feature in self.features)
            remarks.append(f"; with all real roots of the polynomials by which couplings determine {bent}")
        if turning := ", ".join(self._turning(moving)):
            remarks.append(f"; revolutions of {turning}, after which driven joints are elsewhere, are not counted")
        if self.staying:
            remarks.append(f"; joints that do not move it stay where they are: {', '.join(self.staying)}")
        return remarks

    def _turning(self, moving: Iterable[str]) -> list[str]:
        """Return those of some joints that have room for more than one revolution, and displace by each what they
        drive: couplings pass it on to a slider, by a polynomial, or as a part of a revolution.

        Seen by derivatives at general values of all joints, where those of a polynomial are no whole numbers.
        """
        mechanism, rng = self._mechanism, np.random.default_rng(0)
        room = {name: mechanism.limits[name].upper - mechanism.limits[name].lower for name in moving}
        turning = [name for name, width in room.items() if width > _REVOLUTION and not mechanism.is_prismatic(name)]
        driven = [name for name in mechanism.joints if name not in self._kept]
        values = dict(zip(mechanism.joints, rng.normal(size=len(mechanism.joints)).tolist(), strict=True))
        slopes = [coupling.evaluate(values)[1] for coupling in mechanism.couplings]
        by_driven, by_turning = (
            np.array([[slope.get(name, 0.0) for name in some] for slope in slopes]).reshape(len(slopes), len(some))
            for some in (driven, turning)
        )
        ratios = np.linalg.pinv(by_driven) @ by_turning
        slides = np.array([mechanism.is_prismatic(name) for name in driven], dtype=bool)
        off = np.abs(ratios - np.where(slides[:, None], 0.0, np.rint(ratios))).max(axis=0, initial=0.0)
        return [name for name, part in zip(turning, off, strict=True) if part > _STILL]

    def _beside_axis(self, joint: str) -> tuple[float, ...]:
        """Return a point (3,) of a joint's body that every motion of the joint moves, m."""
        along = axis(self._mechanism.model.joints[self._mechanism.model.getJointId(joint)])
        beside = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
        return tuple((self._mechanism.length * beside / np.linalg.norm(beside)).tolist())

    def configurations(self, q: Array) -> tuple[list[Array], int, set[str]]:
        """Return all closed configurations (nq,) in which the other joints are as in q (nq,); the number of those that
        are lost in closing; and the names of couplings with roots that nearly coincide, which may be others."""
        mechanism, closed, lost, double = self._mechanism, list[Array](), 0, set[str]()
        if not mechanism.couplings:
            return [q], 0, double
        joints = {name for coupling in mechanism.couplings for name in coupling.terms}
        at = {name: mechanism.q_index(name) for name in joints}
        for values in self._values({name: float(q[k]) for name, k in at.items()}, double):
            start = mechanism.configuration({c.follower: values[c.follower] for c in self._solved}, q)
            try:
                end = mechanism.close(start, self._kept)
            except ClosureError:
                lost += 1
                continue
            if all(abs(end[at[c.follower]] - values[c.follower]) < _SAME for c in self._solved):
                closed.append(end)
            else:
                lost += 1
        return closed, lost, double

    def _values(self, values: dict[str, float], double: set[str], done: int = 0) -> Iterator[dict[str, float]]:
        """Yield all values of the joints that couplings determine, from the first `done` of them on."""
        if done == len(self._solved):
            yield values
            return
        coupling = self._solved[done]
        try:
            roots = _isolated(coupling, values)
        except ValueError:
            double.add(coupling.name)
            roots = [root.real for root in coupling.roots(coupling.follower, values) if root.imag == 0.0]
        for root in sorted(roots):
            yield from self._values({**values, coupling.follower: root}, double, done + 1)


def _isolated(coupling: Coupling, values: Mapping[str, float]) -> list[float]:
    """Return all real roots of a coupling by its follower (rad, m), proved with ball arithmetic: each ball has one root
    (F. Johansson, "Arb: efficient arbitrary-precision midpoint-radius interval arithmetic", IEEE Trans. Computers 66,
    2017). One that meets the real axis has a real root if its mirror image meets no other: the conjugate root is there.

    Raises:
        ValueError: roots coincide, as exactly as the values of the other joints are known.
    """
    lack, _ = coupling.evaluate({**values, coupling.follower: 0.0})
    balls = acb_poly([arb(lack, _KNOWN * (1.0 + abs(lack))), *coupling.terms[coupling.follower]]).roots()
    real = [ball for ball in balls if ball.imag.contains(0)]
    if any(ball.conjugate().overlaps(other) for ball in real for other in balls if other is not ball):
        raise ValueError(coupling.name)
    return [float(ball.real.mid()) for ball in real]
