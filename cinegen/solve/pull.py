"""A pull: a node that follows a pose (the paper's sensor constraint), and the equations it adds."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from raff2urdf.loops import log, swing

Array = NDArray[np.float64]


@dataclass(eq=False)
class Pull:
    """Made by `Solver.pull`; `target` and `weight` may be set anew at any time.

    Attributes:
        node: which follows.
        target: where it should be, in the world.
        translation: how many translations it holds: 3 all; 2 in the plane of the target's x and y; 1 along x; 0 none.
        rotation: how many rotations it holds: 3 all; 2 the direction of z; 1 the turn about the target's z; 0 none.
        weight: of this pull's equations where several can't all be met.
    """

    node: str
    target: pin.SE3
    translation: int = 3
    rotation: int = 3
    weight: float = 1.0
    frame: int = field(default=0, repr=False)

    @property
    def rows(self) -> int:
        """How many equations it adds."""
        return self.translation + self.rotation

    def finite(self) -> bool:
        """Whether target and weight are numbers that can be followed."""
        return bool(np.isfinite(self.target.homogeneous).all() and np.isfinite(self.weight) and self.weight > 0.0)

    def equations(self, placement: pin.SE3, jacobian: Array) -> tuple[Array, Array]:
        """What is left to do, and how the joints do it.

        Origin and orientation are led apart, so that the origin goes straight to its target.

        Args:
            placement: where the node is.
            jacobian: (6, nv) of the node, in its own frame.

        Returns:
            error (rows,), m and rad, and (rows, nv): to first order a joint step s with J s = error ends the error.
        """
        errors, rows = [], []
        to_target = self.target.rotation.T @ placement.rotation  # the node's axes seen from the target
        if self.translation == 3:
            errors.append(placement.rotation.T @ (self.target.translation - placement.translation))
            rows.append(jacobian[:3])
        elif self.translation:
            held = slice(0, self.translation)
            errors.append((self.target.rotation.T @ (self.target.translation - placement.translation))[held])
            rows.append((to_target @ jacobian[:3])[held])
        if self.rotation == 2:
            away, by_omega = swing(to_target[:, 2])
            errors.append(-away)
            rows.append(by_omega @ to_target @ jacobian[3:])
        elif self.rotation:
            held = slice(3 - self.rotation, 3)
            errors.append(log(to_target.T)[held])
            rows.append(jacobian[3:][held])
        if not errors:
            return np.zeros(0), jacobian[:0]
        return np.concatenate(errors), np.vstack(rows)
