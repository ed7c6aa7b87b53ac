"""Mass, centre and inertia matrix of bodies, and which numbers no body can have."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from raff2urdf.arrays import Array

ROUNDED = 1e-6
"""By what part of the largest principal moment rounded numbers may break the rules that moments of inertia obey."""


@dataclass(frozen=True)
class Inertia:
    """Mass, centre and inertia matrix of a body, in the body's own axes.

    Attributes:
        mass: kg.
        centre: (3,) of mass, m.
        matrix: (3, 3) inertia matrix about the centre, kg m2; its products are -integral of x y dm, as in URDF.
    """

    mass: float = 0.0
    centre: Array = field(default_factory=lambda: np.zeros(3))
    matrix: Array = field(default_factory=lambda: np.zeros((3, 3)))

    @property
    def second(self) -> Array:
        """Second moments of mass (3, 3) about the centre, integral of x x^T dm, kg m2."""
        return np.asarray(0.5 * np.trace(self.matrix) * np.eye(3) - self.matrix)

    @classmethod
    def from_second(cls, mass: float, centre: Array, second: Array) -> Inertia:
        """Return the inertia of a body from its second moments of mass (3, 3) about the centre."""
        return cls(mass, centre, np.asarray(np.trace(second) * np.eye(3) - second))

    def in_frame(self, placement: Array) -> Inertia:
        """Return the inertia in another frame, in which the body's own is at `placement` (4, 4)."""
        rotation = placement[:3, :3]
        matrix = rotation @ self.matrix @ rotation.T
        return Inertia(self.mass, rotation @ self.centre + placement[:3, 3], (matrix + matrix.T) / 2.0)

    def __add__(self, other: Inertia) -> Inertia:
        """Return the inertia of both bodies together, by the parallel axes theorem."""
        mass = self.mass + other.mass
        if mass <= 0.0:
            return Inertia(0.0, self.centre, self.matrix + other.matrix)
        apart = other.centre - self.centre
        steiner = self.mass * other.mass / mass * (apart @ apart * np.eye(3) - np.outer(apart, apart))
        return Inertia(mass, self.centre + other.mass / mass * apart, self.matrix + other.matrix + steiner)

    def share(self, part: float) -> Inertia:
        """Return the inertia of a part of the body with the same distribution of mass."""
        return Inertia(part * self.mass, self.centre, part * self.matrix)

    def at_least(self, mass: float, moment: float) -> Inertia:
        """Return the inertia with at least this mass (kg) and moment about every axis through the centre (kg m2)."""
        lacking = max(0.0, moment - float(np.linalg.eigvalsh(self.matrix)[0]))
        return Inertia(max(self.mass, mass), self.centre, self.matrix + lacking * np.eye(3))

    @property
    def largest(self) -> float:
        """The largest number: of kg, m and kg m2."""
        return float(max(abs(self.mass), np.abs(self.centre).max(), np.abs(self.matrix).max()))

    def why_unphysical(self) -> str | None:
        """Return the rule that the numbers break, which those of every body obey; None if they may be a body's.

        The mass is not negative, and without mass there are no moments. The principal moments are not negative, and
        none is larger than the sum of the two others, up to `ROUNDED`. Point masses, rods and plates obey both.
        """
        a, b, c = np.linalg.eigvalsh(self.matrix).tolist()
        tolerance = ROUNDED * max(abs(a), abs(c))
        if self.mass < 0.0:
            return f"its mass is negative, {self.mass:.6g} kg"
        if self.mass == 0.0 and max(abs(a), abs(c)) > 0.0:
            return f"it has moments of inertia, up to {max(abs(a), abs(c)):.6g} kg m2, but no mass: state its mass"
        if a < -tolerance:
            return f"a principal moment of inertia is negative, {a:.6g} kg m2"
        if a + b < c - tolerance:
            return f"a principal moment of inertia, {c:.6g} kg m2, exceeds the sum of the others, {a:.6g} and {b:.6g}"
        return None


def sum_of(bodies: Iterable[Inertia]) -> Inertia:
    """Return the inertia of several bodies together."""
    total = Inertia()
    for body in bodies:
        total = body + total if total.mass <= 0.0 else total + body
    return total
