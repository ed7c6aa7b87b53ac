"""Numbers of a URDF in the units of a RAFF file, the shortest that read back to the same."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.inertia import Inertia
from raff2urdf.raff.document import (
    UNITS_PER_METRE,
    Document,
    DriveKind,
    JointType,
    RaffDrive,
    RaffInertial,
    RaffLink,
    RaffParameters,
)
from raff2urdf.raff.kleinfinger import Kleinfinger, transform
from raff2urdf.tree import joint_units, kleinfinger
from raff2urdf.urdf2raff.frames import TIDY, tidy

LIMIT_TOLERANCE = 1e-10
"""Largest change of a limit (m or rad) by `tidy`: larger than that of other numbers (`TIDY`), since less depends on
it."""


class FileUnits:
    """Units of a RAFF file.

    Attributes:
        document: without robots, in these units.
        per_metre: units of length in a metre.
    """

    def __init__(self, units: str) -> None:
        self.document, self.per_metre = Document("", units=units), UNITS_PER_METRE[units]

    def inertial(self, body: Inertia) -> RaffInertial:
        """Return the inertia of a node in the file's units."""
        xx, xy, xz, yy, yz, zz = (self.restored(moment, 2) for moment in body.matrix[np.triu_indices(3)].tolist())
        x, y, z = (self.restored(x, 1) for x in body.centre.tolist())
        return RaffInertial(float(body.mass), (x, y, z), (xx, yy, zz), (xy, xz, yz))

    def restored(self, value: float, power: int) -> float:
        """Return the shortest number in the file's units that reads back to a value in powers of m, if there is one."""

        def back(number: float) -> float:
            for _ in range(power):
                number = self.document.metres(number)
            return number

        return shortest(value, value * self.per_metre**power, back)

    def written(self, parameters: Kleinfinger) -> tuple[RaffParameters, Array]:
        """Return parameters in the file's units, and the placement (4, 4) that they have once they are read back."""
        lengths = {word: self.tidied(getattr(parameters, word), True) for word in ("r", "d", "epsilon")}
        angles = {word: self.tidied(getattr(parameters, word), False) for word in ("theta", "alpha", "gamma")}
        written = RaffParameters(**lengths, **angles)
        return written, transform(kleinfinger(self.document, written))

    def tidied(self, value: float, length: bool, tolerance: float = TIDY) -> float:
        """Convert a length (m) or an angle (rad) to the file's units, without its last digits."""
        if length:
            return tidy(value * self.per_metre, tolerance * self.per_metre)
        return tidy(math.degrees(value), math.degrees(tolerance))

    def shifted(self, allowed: tuple[float, float], offset: float, length: bool) -> tuple[float, float]:
        """Return limits (rad, m) that are moved by an offset, in the file's units."""
        low, high = (self.tidied(limit + offset, length, LIMIT_TOLERANCE) for limit in allowed)
        return low, high

    def drive(self, follower: RaffLink, link: RaffLink, powers: Sequence[float]) -> RaffDrive:
        """Return what a link adds to the joint that follows.

        Args:
            follower: the link that follows.
            link: the link that drives.
            powers: coefficients of the driving joint's variable (rad, m) and its powers.
        """
        if len(powers) > 1:
            followed, driving = (joint_units(self.document, moving, 1.0) for moving in (follower, link))
            numbers = tuple(rounded(c * driving**power / followed) for power, c in enumerate(powers, 1))
            return RaffDrive(link.number, DriveKind.POLYNOMIAL, numbers)
        if follower.type is link.type:
            return RaffDrive(link.number, DriveKind.RATIO, (powers[0],))
        radius = (powers[0] if follower.type is JointType.PRISMATIC else 1.0 / powers[0]) * self.per_metre
        numbers_of = {DriveKind.RADIUS: rounded(radius), DriveKind.LEAD: rounded(radius * math.tau)}
        kind = min(numbers_of, key=lambda kind: len(repr(numbers_of[kind])))  # the one that was meant is rounder
        return RaffDrive(link.number, kind, (numbers_of[kind],))


def shortest(value: float, near: float, back: Callable[[float], float]) -> float:
    """Return the shortest number next to `near` that reads back to a value; `near` if there is none."""
    rounded = [float(f"{near:.{digits}g}") + 0.0 for digits in (14, 15, 16, 17)]
    for number in (*rounded, math.nextafter(near, math.inf), math.nextafter(near, -math.inf)):
        if back(number) == value:
            return number
    return near


def rounded(value: float) -> float:
    """Return a number without its last digits, which conversions of units change."""
    return float(f"{value:.14g}")
