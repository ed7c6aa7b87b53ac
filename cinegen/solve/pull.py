"""A pull: a node that follows a pose (the paper's sensor constraint), and the equations it adds."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from raff2urdf.loops import log, log_derivative, swing

Array = NDArray[np.float64]


_FURTHEST = 1e100  # m: a target beyond is aimed at from here all the same, and no square overflows


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

    def makes_sense(self) -> bool:
        """Whether target, freedoms and weight are what can be followed: they may have been set to anything."""
        try:
            return bool(
                isinstance(self.target, pin.SE3)
                and np.isfinite(self.target.homogeneous).all()
                and self.translation in range(4)
                and self.rotation in range(4)
                and 0.0 < self.weight < np.inf
            )
        except (TypeError, ValueError):
            return False

    def errors(self, placement: pin.SE3) -> tuple[Array, Array]:
        """What is left to do: (translation,) in m and (rotation,) in rad.

        Three translations are in the node's own axes, fewer in the target's; rotations in the node's own.
        """
        way = np.clip(self.target.translation, -_FURTHEST, _FURTHEST) - placement.translation
        straight = placement.rotation.T @ way if self.translation == 3 else self.target.rotation.T @ way
        if self.rotation == 2:
            return straight[: self.translation], -swing(self._seen(placement)[:, 2])[0]
        turn = log(self._seen(placement).T) if self.rotation else np.zeros(3)
        return straight[: self.translation], turn[3 - self.rotation :]

    def equations(self, placement: pin.SE3, jacobian: Array) -> tuple[Array, Array]:
        """What is left to do, and how the joints do it.

        Origin and orientation are led apart, so that the origin goes straight to its target.

        Args:
            placement: where the node is.
            jacobian: (6, nv) of the node, in its own frame.

        Returns:
            error (rows,), m and rad, and (rows, nv): to first order a joint step s with J s = error ends the error,
            and error^T J is the exact gradient of half the error's square.
        """
        linear, angular = jacobian[:3], jacobian[3:]
        if self.translation < 3:
            linear = self._seen(placement) @ linear
        if self.rotation == 2:
            angular = swing(self._seen(placement)[:, 2])[1] @ self._seen(placement) @ angular
        elif self.rotation == 1:
            angular = log_derivative(log(self._seen(placement).T)) @ angular
        straight, turn = self.errors(placement)
        rows = np.vstack([linear[: self.translation], angular[len(angular) - self.rotation :]])
        return np.concatenate([straight, turn]), rows

    def _seen(self, placement: pin.SE3) -> Array:
        """The node's axes seen from the target, (3, 3)."""
        return np.asarray(self.target.rotation.T @ placement.rotation)
