"""Certificates of a platform's placements: its six leg equations in ball arithmetic.

Near a reported placement (R0, t0) all others are t and R = R0 C, with C the rotation whose unit quaternion is (1, w) up
to a factor. The equation of a leg of length l from a to b, |R b + t - a|^2 = l^2, times 1 + w.w, is a polynomial:

    (1 + w.w) (b.b + d.d - l^2) + 2 c.((1 - w.w) b + 2 w x b + 2 (w.b) w) = 0,    d = t - a,    c = R0^T d
"""

from __future__ import annotations

from collections.abc import Sequence
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
