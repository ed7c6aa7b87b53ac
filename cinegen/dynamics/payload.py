"""`Payload`: what a node carries, and what acts on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.dynamics.errors import PayloadError

_PHYSICAL = 1e-9  # relative: a principal moment of inertia exceeds the sum of the others by no more


@dataclass(frozen=True, eq=False)
class Payload:
    """A rigid body on a node, and a wrench that its surroundings exert on it.

    Attributes:
        node: that carries it.
        mass: kg.
        centre: (3,) of mass, in the node's frame, m.
        inertia: (3, 3) about the centre of mass, in the node's axes, kg m^2; 0 for a point mass.
        wrench: (6,) force (N), then moment (N m), on the node at its origin.
        axes: of the wrench: the world's, or the node's, which rotate with it.

    Raises:
        PayloadError: a number is not finite or of the wrong shape, the mass is negative, or no body has that inertia.
    """

    node: str
    mass: float = 0.0
    centre: Sequence[float] | Array = (0.0, 0.0, 0.0)
    inertia: ArrayLike | None = None
    wrench: Sequence[float] | Array = (0.0,) * 6
    axes: Literal["world", "node"] = "world"

    def __post_init__(self) -> None:
        self._number("mass", self.mass, ())
        self._number("centre", self.centre, (3,))
        self._number("wrench", self.wrench, (6,))
        if self.mass < 0.0:
            raise PayloadError(f"the payload on '{self.node}' has a negative mass, {self.mass:g} kg")
        if self.axes not in ("world", "node"):
            raise PayloadError(f"the axes of a wrench on '{self.node}' are 'world' or 'node', not {self.axes!r}")
        if self.inertia is None:
            return
        inertia = self._number("inertia", self.inertia, (3, 3))
        if np.abs(inertia - inertia.T).max() > _PHYSICAL * np.abs(inertia).max():
            raise PayloadError(f"the inertia of the payload on '{self.node}' is not symmetric")
        first, second, third = np.linalg.eigvalsh(inertia)
        slack = _PHYSICAL * third
        if first < -slack or third > first + second + slack or (not self.mass and third > 0.0):
            raise PayloadError(
                f"no body has the inertia of the payload on '{self.node}': principal moments {first:.3g}, "
                f"{second:.3g}, {third:.3g} kg m^2, {self.mass:g} kg (none is negative, none exceeds the sum of the "
                "others, and none is there without mass)"
            )

    def _number(self, what: str, value: object, shape: tuple[int, ...]) -> Array:
        try:
            found = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            found = np.full(1, np.nan)
        if found.shape != shape or not np.isfinite(found).all():
            size = "a finite number" if not shape else f"{' x '.join(map(str, shape))} finite numbers"
            raise PayloadError(f"the {what} of the payload on '{self.node}' must be {size}, not {value!r:.60}")
        return found

    @property
    def body(self) -> pin.Inertia:
        """Mass, centre and inertia, in the node's frame."""
        inertia = np.zeros((3, 3)) if self.inertia is None else np.asarray(self.inertia, dtype=float)
        return pin.Inertia(float(self.mass), np.array(self.centre, dtype=float), inertia)
