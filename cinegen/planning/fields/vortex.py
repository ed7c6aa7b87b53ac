"""Vortices: fields that turn around an obstacle instead of pushing away from it. C. De Medio and G. Oriolo, "Robot
obstacle avoidance using vortex fields", Advances in Robot Kinematics, Springer 1991, equation 4 and after it.

Around a point O of the plane the field is V = (-y, x) / (x^2 + y^2), the gradient of arctan(y / x), which is a
potential only locally: one turn around O adds 2 pi. Around any other shape it is tangent to the contours of the FIRAS
potential. These are lines of equal distance, so it is perpendicular to the normal n:

    V = m(d) w x n,

with d the distance, w the unit axis of turning, +z (counterclockwise) or -z in the plane. For a point n = p / d and m =
1/d make it equation 4.

How large is it? Of equation 4 the text says "inversely proportional to the square of its distance"; the formula has
1/r. We follow the formula: its primitive is the arctan that the paper draws, and 1/r^2 has none. It also agrees with
what the paper says of other shapes: "inversely proportional to the distance". Of a shape we take the distance to it, as
for the direction, not that to a point O within: only so does the field grow without bound toward all of the surface.

Where does it end? "In the range of influence of the obstacle", which is d_r of the FIRAS potential. There 1/d would
drop from 1/d_r to 0. So the modulus is 1/d - 1/d_r: the same near the obstacle, continuous at the end, and the very
bracket of the FIRAS potential. 1/d with the drop is there as well, to be compared.

What it is not: a gradient. Its curl is m' + m / rho, with rho the radius of the contour: it vanishes for 1/d around a
point, where rho = d, and not along a flat side. It has no divergence, wherever the distance is smooth, for any m and
any w that is constant: it is the flow of something incompressible. On the medial axis of a shape that is not convex n
jumps, and so does the field.

Does it keep a point from hitting? It has no part along n. The attraction alone approaches, with |a| sin(alpha), while
the vortex, discarded by the same sine, goes round with s m(d) sin(alpha). As long as alpha is at most a right angle,
their ratio makes d at least d_0 exp(-|a| l / s) after a length l along the contour (for m = 1/d): it never vanishes,
but gets small unless the strength s is large against the attraction times the way round. That is the paper's "proper
choice of the helicoid slope"; a stated clearance is not the field's business.

In space the axis w has to be chosen, and `turning` chooses it: see there. Then w x n is what the definition gives. It
is shorter than 1 where n is not perpendicular to w, and vanishes where n is along w: on a sphere no tangent field
vanishes nowhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.planning.fields.nearness import apart, closeness
from cinegen.planning.fields.parameter import FieldError, positive, vector

Array = NDArray[np.float64]


class Modulus(Enum):
    """How a vortex depends on the distance d to the obstacle, for d < d_r; it is 0 farther away."""

    ENDED = "1/d - 1/d_r"
    """Continuous: what is used."""
    INVERSE = "1/d"
    """As printed: drops to 0 at d_r."""


@dataclass(frozen=True)
class Vortex:
    """The vortex of an obstacle of any shape, as a velocity: it is added to the attraction.

    The paper adds the potential U_v and goes down: then U_v falls along V, as -s arctan(y / x) does along
    equation 4.

    Attributes:
        strength: s, J: by how much the local potential of a point's vortex falls for each radian.
        reach: d_r, m: its range.
        modulus: how it depends on the distance.

    Raises:
        FieldError: the strength or the reach is not above 0.
    """

    strength: float
    reach: float
    modulus: Modulus = Modulus.ENDED

    def __post_init__(self) -> None:
        positive("the strength of a vortex", self.strength)
        positive("the reach of a vortex", self.reach)

    def size(self, distances: ArrayLike) -> Array:
        """(m,) s m(d) in N at distances (m,), m; nan at contact."""
        if self.modulus is Modulus.ENDED:
            return self.strength * closeness(distances, self.reach)
        d = apart(distances)
        return np.asarray(self.strength * np.where(d >= self.reach, 0.0, 1.0 / d))

    def velocity(self, distances: ArrayLike, normals: ArrayLike, axis: ArrayLike) -> Array:
        """(m, 3) s m(d) w x n, N; nan at contact.

        Args:
            distances: (m,) from the obstacle, m.
            normals: (m, 3) unit vectors n from the nearest point of the obstacle.
            axis: (3,) or (m, 3) unit vectors w, about which it turns.
        """
        across = np.cross(np.asarray(axis, dtype=float), np.asarray(normals, dtype=float))
        return np.asarray(self.size(distances)[..., None] * across)


@dataclass(frozen=True, eq=False)
class PointVortex:
    """Equation 4: the vortex of a point in the plane (in space, of a line along z), with its local potential.

    Attributes:
        centre: (3,) O, m; its z does not matter.
        strength: J; below 0 it turns clockwise. 1 is equation 4.
        cut: rad; the potential jumps by 2 pi times the strength on the ray from O that is turned by so much from x.

    Raises:
        FieldError: the centre, the strength or the cut is not finite.
    """

    centre: Array
    strength: float = 1.0
    cut: float = -math.pi

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", vector("the centre of a vortex", self.centre))
        for what, value in (("strength", self.strength), ("cut", self.cut)):
            if not math.isfinite(value):
                raise FieldError(f"the {what} of a point's vortex is {value!r}; give a finite number")

    def value(self, points: ArrayLike) -> Array:
        """(m,) J: the strength times the angle of points (m, 3) about O, from `cut` up to a turn more; nan at O."""
        x, y, r = self._about(points)
        angle = self.cut + np.mod(np.arctan2(y, x) - self.cut, 2.0 * math.pi)
        return np.where(np.isnan(r), np.nan, self.strength * angle)

    def gradient(self, points: ArrayLike) -> Array:
        """(m, 3) N: the strength times (-y, x, 0) / (x^2 + y^2) at points (m, 3); continuous across the cut, nan at
        O."""
        x, y, r = self._about(points)
        return np.asarray((self.strength / r**2)[..., None] * np.stack([-y, x, np.zeros_like(x)], axis=-1))

    def _about(self, points: ArrayLike) -> tuple[Array, Array, Array]:
        """x and y of points from O, and their distance, nan at O."""
        offset = np.asarray(points, dtype=float) - self.centre
        x, y = offset[..., 0], offset[..., 1]
        return x, y, apart(np.hypot(x, y))
