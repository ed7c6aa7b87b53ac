"""Results: the assembly modes of a platform on six legs, with an account of all complex solutions, and certificates.

Certificates are those of the six leg equations in ball arithmetic. Near a reported placement (R0, t0) all others are t
and R = R0 C, with C the rotation whose unit quaternion is (1, w) up to a factor. The equation of a leg of length l from
a to b, |R b + t - a|^2 = l^2, times 1 + w.w, is a polynomial:

    (1 + w.w) (b.b + d.d - l^2) + 2 c.((1 - w.w) b + 2 w x b + 2 (w.b) w) = 0,    d = t - a,    c = R0^T d
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from cinegen.arrays import Array, Integers
from cinegen.balls import axes_and_origin, combined, cross, dot, frame, minus, precise
from cinegen.krawczyk import Certificate, Values, certify, distinct

if TYPE_CHECKING:
    from flint import arb


def certificates(
    base: Array, platform: Array, lengths: Array, placements: Array, coincident: Integers
) -> tuple[Certificate | None, ...]:
    """Return the certificate of each placement (n, 4, 4): None where it can't be certified, as where several coincide,
    or where it is not distinct from one before it.

    Args:
        base: (6, 3) points, exact numbers.
        platform: (6, 3) points, exact numbers.
        lengths: (6,) of the legs, exact numbers.
        placements: (n, 4, 4).
        coincident: (n,) how many solutions coincide in each.
    """
    legs = base, platform, lengths
    which = zip(placements, coincident.tolist(), strict=True)
    return distinct(_certified(*legs, placement) if count == 1 else None for placement, count in which)


def _certified(base: Array, platform: Array, lengths: Array, placement: Array) -> tuple[Certificate, list[arb]] | None:
    """Return the certificate of a placement (4, 4), and the platform's points in the base."""
    from flint import arb

    with precise():
        axes, _ = axes_and_origin(frame(placement[:3, :3], np.zeros(3)))
        rows = [list(row) for row in zip(*axes, strict=True)]
        feet, points = ([[arb(float(x)) for x in point] for point in some] for some in (base, platform))
        squares = [arb(float(length)) ** 2 for length in lengths]
        size = float(lengths.max())

        def turned(b: list[arb], w: list[arb]) -> list[arb]:
            """Return (1 + w.w) C b."""
            part = 1 - dot(w, w)
            return [part * x + 2 * (y + dot(w, b) * z) for x, y, z in zip(b, cross(w, b), w, strict=True)]

        def evaluate(box: Sequence[arb], derive: bool) -> Values:
            t, w = list(box[:3]), list(box[3:])
            out, norm = Values([], [], []), dot(w, w)
            for a, b, square in zip(feet, points, squares, strict=True):
                d, along = minus(t, a), dot(w, b)
                c = combined(rows, d)
                reached, apart = turned(b, w), dot(b, b) + dot(d, d) - square
                out.residual.append(((1 + norm) * apart + 2 * dot(c, reached)) / size**2)
                if derive:
                    by_t = [2 * (1 + norm) * x + 2 * y for x, y in zip(d, combined(axes, reached), strict=True)]
                    inner, normal, tilt = dot(c, b), cross(b, c), dot(c, w)
                    by_w = [
                        2 * z * (apart - 2 * inner) + 4 * (n + along * x + tilt * y)
                        for x, y, z, n in zip(c, b, w, normal, strict=True)
                    ]
                    out.jacobian.append([x / size**2 for x in (*by_t, *by_w)])
            return out

        centre = np.append(placement[:3, 3], np.zeros(3))
        found = certify(evaluate, centre, np.array([size] * 3 + [0.5] * 3), 6)
        if found is None:
            return None
        certificate, box = found
        t, w = box[:3], box[3:]
        corners = (combined(axes, [x / (1 + dot(w, w)) for x in turned(b, w)]) for b in points)
        return certificate, [x + y for corner in corners for x, y in zip(corner, t, strict=True)]


@dataclass(frozen=True)
class SolutionCounts:
    """Numbers of all complex solutions: each is real, complex, infinite or lost.

    Attributes:
        real: real solutions, each with its multiplicity.
        complex: solutions that are not real.
        infinite: solutions at infinity.
        multiple: how many of the real and complex ones coincide with others, or lie where joints are locked.
        lost: solutions of which nothing is known.
    """

    real: int = 0
    complex: int = 0
    infinite: int = 0
    multiple: int = 0
    lost: int = 0

    @property
    def total(self) -> int:
        """Number of solutions."""
        return self.real + self.complex + self.infinite + self.lost


@dataclass(frozen=True, eq=False)
class NearestPlacement:
    """The placement nearest to leg lengths with which the platform can't be assembled.

    Attributes:
        placement: (4, 4) where the sum of squared length errors has its smallest known minimum.
        errors: (6,) length of each leg there minus the required one.
    """

    placement: Array
    errors: Array


@dataclass(frozen=True, eq=False)
class PlatformModes:
    """All placements of a platform in the base frame for six leg lengths.

    Where legs let the platform move, on a curve of configurations, placements are the points of it that were found.

    Attributes:
        placements: (n, 4, 4).
        coincident: (n,) how many solutions coincide in each: 1 for a regular one.
        counts: of all complex solutions: 40, or 16 if legs meet in pairs on the platform.
        complete: whether these are all modes: no solution was lost, and no curve of configurations is possible.
        method: how they were computed, and what is not excluded.
        closest: if there is no mode, the nearest placement.
        legs: points of base and platform (6, 3) and lengths (6,) that certificates are computed of.
        almost_surely: whether `complete` holds with probability one only: general lengths leave fewer solutions than
            the theorem allows, and their number was found from a random start.
    """

    placements: Array
    coincident: Integers
    counts: SolutionCounts
    complete: bool
    method: str
    closest: NearestPlacement | None = None
    legs: tuple[Array, Array, Array] | None = None
    almost_surely: bool = False

    def __repr__(self) -> str:
        worth = ", all with probability one" if self.almost_surely else ", proved to be all" if self.complete else ""
        return f"<PlatformModes: {len(self.placements)}{worth}>"

    @property
    def proved(self) -> bool:
        """True if it is proved that these are all modes."""
        return self.complete and not self.almost_surely

    @cached_property
    def certificates(self) -> tuple[Certificate | None, ...]:
        """Proofs, of each placement, that it exists, is real, is the only one near it, and differs from the others;
        None where there is none. Lengths are divided by the longest leg's, not by a characteristic length."""
        if self.legs is None:
            return (None,) * len(self.placements)
        return certificates(*self.legs, self.placements, self.coincident)

    @property
    def certified(self) -> int:
        """Number of placements with a certificate."""
        return sum(certificate is not None for certificate in self.certificates)
