"""A pull: a node that follows a pose or a twist (the paper's sensor constraint), and the equations it adds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.memory import TARGET, address_of_copy
from cinegen.ik._kernels.pulls import FURTHEST
from raff2urdf.loops import log, log_derivative, swing

Array = NDArray[np.float64]


class Pull:
    """Made by `Solver.pull`; everything but the node may be set anew at any time, between two ticks.

    What can't be followed (a target that is no SE3 or not finite, a weight of 0 ...) is kept until it is set right, and
    the pull left out meanwhile: the tick's status says so.

    Attributes:
        node: which follows.
        at: what of it: a frame that is fixed on the node, as seen from it; the node's own unless another was asked for.
        axes: whose axes its rows are in: "target", "world", or the name of a node ("the node itself" is its own name).
        frame: Pinocchio's number of the node's frame.
    """

    def __init__(
        self,
        node: str,
        target: Any,
        translation: int = 3,
        rotation: int = 3,
        weight: float = 1.0,
        axes: str = "target",
        frame: int = 0,
        at: pin.SE3 | None = None,
    ) -> None:
        self.node, self.axes, self.frame = node, axes, frame
        self.at = pin.SE3.Identity() if at is None else at.copy()
        self.row: Array = np.zeros(m.PULL_WIDTH)  # of the solver's table, once it is there
        self.changed: Callable[[], None] = _nobody  # whom to tell that the number of rows is another
        self._wrong: dict[str, Any] = {}
        self._target = pin.SE3.Identity()
        self._special = False  # after a twist, or with something wrong
        self.row[m.VALID] = 1.0
        self.target = target
        self.translation, self.rotation, self.weight = translation, rotation, weight

    def __repr__(self) -> str:
        what = "twist" if self.twist is not None else "pose"
        return f"<Pull of {self.node} after a {what}: {self.translation} translations, {self.rotation} rotations>"

    @property
    def target(self) -> pin.SE3:
        """Where the node should be, in the world. May be changed in place; what is assigned is copied."""
        return self._wrong.get("target", self._target)

    @target.setter
    def target(self, target: pin.SE3) -> None:
        if type(target) is not pin.SE3:
            self._refuse("target", target)
            return
        self._target = target.copy()
        self.row[TARGET] = address_of_copy(self._target)
        if self._special:
            self.row[m.IS_TWIST] = 0.0
            self._accept("target")

    @property
    def twist(self) -> Array | None:
        """(6,) how fast the node should move, along `axes` ("target" means the node's own): m/s, then rad/s.

        None while a pose is followed: setting one ends the other. Nothing drifts in directions whose speed is 0.
        """
        return self.row[m.TWIST : m.TWIST + 6].copy() if self.row[m.IS_TWIST] else None

    @twist.setter
    def twist(self, twist: Any) -> None:
        try:
            given = np.asarray(twist, dtype=float).reshape(6)
            if not np.isfinite(given).all():
                raise ValueError
        except (TypeError, ValueError):
            self._refuse("target", twist)
            return
        self.row[m.TWIST : m.TWIST + 6] = given
        self.row[m.IS_TWIST] = 1.0
        self._accept("target")
        self._special = True

    @property
    def translation(self) -> int:
        """How many translations it holds: 3 all; 2 along the axes' x and y; 1 along x; 0 none."""
        return int(self._wrong.get("translation", self.row[m.TRANSLATION]))

    @translation.setter
    def translation(self, count: int) -> None:
        self._set("translation", m.TRANSLATION, count, _is_count)
        self.changed()

    @property
    def rotation(self) -> int:
        """How many rotations it holds: 3 all; 2 the direction of the axes' z; 1 the turn about it; 0 none."""
        return int(self._wrong.get("rotation", self.row[m.ROTATION]))

    @rotation.setter
    def rotation(self, count: int) -> None:
        self._set("rotation", m.ROTATION, count, _is_count)
        self.changed()

    @property
    def weight(self) -> float:
        """Of this pull's equations where several can't all be met; only proportions matter."""
        return float(self._wrong.get("weight", self.row[m.WEIGHT]))

    @weight.setter
    def weight(self, weight: float) -> None:
        self._set("weight", m.WEIGHT, weight, _is_weight)

    def _set(self, name: str, where: int, value: Any, makes_sense: Callable[[Any], bool]) -> None:
        try:
            good = makes_sense(value)
        except (TypeError, ValueError):
            good = False
        if good:
            self.row[where] = value
            self._accept(name)
        else:
            self._refuse(name, value)

    def _refuse(self, name: str, value: Any) -> None:
        self._wrong[name] = value
        self._special = True
        self.row[m.VALID] = 0.0

    def _accept(self, name: str) -> None:
        self._wrong.pop(name, None)
        self._special = bool(self._wrong)
        self.row[m.VALID] = 0.0 if self._wrong else 1.0

    def lies_in(self, row: Array) -> None:
        """Moves the pull's numbers into a row of a table."""
        row[:] = self.row
        self.row = row

    @property
    def rows(self) -> int:
        """How many equations it adds."""
        return self.translation + self.rotation

    def makes_sense(self) -> bool:
        """Whether target, freedoms and weight are what can be followed: they may have been set to anything."""
        return bool(self.row[m.VALID]) and bool(np.isfinite(self.target.homogeneous).all())

    # --- the equations, plainly ------------------------------------------------------------------------------------

    def errors(self, placement: pin.SE3, axes: Array | None = None) -> tuple[Array, Array]:
        """What is left to do: (translation,) in m and (rotation,) in rad, in the pull's axes.

        Args:
            placement: where the node is.
            axes: (3, 3) those axes in the world; the target's unless given.
        """
        axes = self.target.rotation if axes is None else axes
        way = np.clip(self.target.translation, -FURTHEST, FURTHEST) - placement.translation
        straight = axes.T @ way
        if self.rotation == 2:
            return straight[: self.translation], -swing(self._seen(placement, axes)[:, 2])[0]
        turn = log(self._seen(placement, axes).T) if self.rotation else np.zeros(3)
        return straight[: self.translation], turn[3 - self.rotation :]

    def equations(self, placement: pin.SE3, jacobian: Array, axes: Array | None = None) -> tuple[Array, Array]:
        """What is left to do, and how the joints do it.

        Origin and orientation are led apart, so that the origin goes straight to its target.

        Args:
            placement: where the node is.
            jacobian: (6, nv) of the node, in its own frame.
            axes: (3, 3) the pull's axes in the world; the target's unless given.

        Returns:
            error (rows,), m and rad, and (rows, nv): to first order a joint step s with J s = error ends the error,
            and error^T J is the exact gradient of half the error's square.
        """
        axes = self.target.rotation if axes is None else axes
        linear = axes.T @ placement.rotation @ jacobian[:3]
        angular = (self.target.rotation.T @ axes).T @ jacobian[3:]  # in the axes as the node carries them
        if self.rotation == 2:
            seen = self._seen(placement, axes)
            angular = swing(seen[:, 2])[1] @ seen @ angular
        elif self.rotation == 1:
            angular = log_derivative(log(self._seen(placement, axes).T)) @ angular
        straight, turn = self.errors(placement, axes)
        rows = np.vstack([linear[: self.translation], angular[len(angular) - self.rotation :]])
        return np.concatenate([straight, turn]), rows

    def _seen(self, placement: pin.SE3, axes: Array) -> Array:
        """The axes as the node carries them, seen from where they should be, (3, 3)."""
        return np.asarray(axes.T @ placement.rotation @ self.target.rotation.T @ axes)


def _nobody() -> None:
    """Nobody is to be told."""


def _is_count(value: Any) -> bool:
    return value in range(4)


def _is_weight(value: Any) -> bool:
    return bool(0.0 < value < np.inf)
