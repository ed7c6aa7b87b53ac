"""`DrivenJoints`: joints that don't move a node, where couplings with those that do drive them.

With the moving joints at their values, a coupling of one other joint x is a polynomial p(x) = c: its real roots are all
values that the joint may have. Couplings are solved one after the other; those that remain, each with several joints,
have one solution if they are linear. Loops that joints in couplings belong to may have several: not all are computed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

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


class DrivenJoints:
    """Joints that don't move a node, and may be in couplings.

    Args:
        mechanism: the mechanism.
        idle: these joints, without locked ones.
        in_loops: all joints in loops.
        q: (nq,) a closed configuration.

    Attributes:
        staying: those that stay where they are: with the joints that move the node they determine the others. Of joints
            in couplings these are as few passive ones as possible.
        unexamined: names of couplings that may have solutions besides those of `configurations`.
        features: points that distinguish the values of joints of whose variables powers occur.
    """

    def __init__(self, mechanism: Mechanism, idle: Collection[str], in_loops: Collection[str], q: Array) -> None:
        self._mechanism = mechanism
        columns = {mechanism.v_index(name): name for name in sorted(idle, key=lambda name: name in mechanism.actuated)}
        coupled = {name for coupling in mechanism.couplings for name in coupling.terms}
        equations = mechanism.structure.system.evaluate(q)[1]
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
