"""Loops of a mechanism some of whose joints are locked: the equations of the mechanism in which they are fixed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.loops.closed_loops import ClosedLoops, LoopConstraint
from raff2urdf.coupling import Coupling


class HeldLoops(ClosedLoops):
    """`ClosedLoops` without the columns of some joints: they are zero, and no step moves these joints.

    Args:
        model: the tree.
        loops: the joints that were cut.
        length: characteristic length, m.
        couplings: equations between joints.
        held: columns of the joints that are locked.
        q: (nq,) configuration in which they are locked.
    """

    def __init__(
        self,
        model: pin.Model,
        loops: Sequence[LoopConstraint],
        length: float,
        couplings: Sequence[Coupling],
        held: Sequence[int],
        q: Array,
    ) -> None:
        super().__init__(model, loops, length, couplings)
        self.held = np.array(sorted(held), dtype=np.intp)
        self._free = np.ones(model.nv)
        self._free[self.held] = 0.0
        for joint in list(model.joints)[1:]:
            if joint.nv and joint.idx_v in held:
                self.rest[joint.idx_q : joint.idx_q + joint.nq] = q[joint.idx_q : joint.idx_q + joint.nq]
        self.signs = [sign * self._free for sign in self.signs]
        self.columns = [columns[self._free[columns] != 0.0] for columns in self.columns]
        self.sizes = [sign[sign != 0.0] * self.scale[sign != 0.0] for sign in self.signs]
        values = {name: float(q[joint.idx_q]) for name, joint in self._coupled.items() if joint.idx_v in held}
        self.couplings = tuple(_without(coupling, values) for coupling in self.couplings)
        self._set_coupling_sizes(self._scales_of(self._coupled))

    def integrate(self, q: Array, step: Array) -> Array:
        """Return the configuration (nq,) reached by the part of a step (nv,) that moves no locked joint."""
        return super().integrate(q, step * self._free)

    def evaluate_placed(self, q: Array) -> tuple[Array, Array]:
        """Return residual and Jacobian; the columns of locked joints are zero."""
        residual, jacobian = super().evaluate_placed(q)
        return residual, jacobian * self._free

    def screws(self) -> Array:
        """Return the unit twists; those of locked joints are zero."""
        screws = super().screws()
        screws[:, self.held] = 0.0
        return screws


def _without(coupling: Coupling, values: Mapping[str, float]) -> Coupling:
    """Return a coupling whose joints of known values are part of its constant."""
    left = {name: terms for name, terms in coupling.terms.items() if name not in values}
    known = replace(coupling, terms={name: terms for name, terms in coupling.terms.items() if name in values})
    return replace(coupling, terms=left, constant=-known.evaluate(values)[0])
