"""The vortex field of an obstacle, in plain numpy: its modulus and its weight, with the derivation of all of it.

C. De Medio and G. Oriolo, "Robot obstacle avoidance using vortex fields", Advances in Robot Kinematics, Springer 1991,
equation 4 and the text after it. The compiled field (`cinegen.planning._kernels.vortex`) is tested against this module;
`cinegen.planning.vortices` chooses the axis of rotation.

**Field.** Around a point O of the plane the field is V = (-y, x) / (x^2 + y^2), the gradient of arctan(y / x), which is
a potential only locally: one revolution around O adds 2 pi. Around any other shape it is tangent to the contours of the
FIRAS potential. These are lines of equal distance, so the field is perpendicular to the outward normal n:

    V = m(d) w x n,

with d the distance and w the unit axis of rotation, +z (counterclockwise) or -z in the plane. For a point n = p / d and
m = 1/d give equation 4.

**Modulus.** The paper's text calls equation 4 "inversely proportional to the square of its distance", but the formula
has 1/r. This module follows the formula: its primitive is the arctan that the paper draws, and 1/r^2 has none. It also
agrees with the text on other shapes: "inversely proportional to the distance". For a shape, d is the distance to the
shape, not to a point within, so that the field grows without bound toward the whole surface. "In the range of influence
of the obstacle" is d < d_r, the range of the FIRAS potential. There 1/d would drop from 1/d_r to 0, so the modulus is
1/d - 1/d_r: continuous, and the bracket of the FIRAS potential.

**Not a gradient.** The curl of V is m' + m / rho, with rho the radius of the contour: it vanishes for 1/d around a
point, where rho = d, and not along a flat side. The divergence is 0 wherever the distance is smooth, for any m and any
constant w. On the medial axis of a shape that is not convex n is discontinuous, and so is the field.

**Clearance.** The field has no part along n, so it does not keep a point from contact. The attraction alone approaches
with |a| sin(alpha), while the vortex, discarded by the same sine, moves along the contour with s m(d) sin(alpha). As
long as alpha is at most a right angle, d is at least d_0 exp(-|a| l / s) after a length l along the contour (for m =
1/d): it never vanishes, but is small unless the strength s is large. A guaranteed clearance is the task of
`cinegen.planning.clearance_barrier`.

**Weight** (figure 4). Let alpha be the angle from the vortex v to the attraction a. "As the robot circumvents the
obstacle, this angle decreases till zero. At the point Q where this happens, the vortex field can be discarded, since
the QG line is free." The field is "multiplied by sin(alpha), so to approach zero with continuity as the scissors
close". Along a flat side the angle grows beyond a right angle before it closes at the corner; nothing here depends on
its decrease.

In the plane v is perpendicular to n. Measured from v toward the obstacle, that is toward -n, the unit attraction is
cos(alpha) v - sin(alpha) n. So -n.a / |a| = sin(alpha), with its sign: positive as long as the attraction points into
the obstacle, negative beyond Q. The paper's weight, ended at Q, is max(0, -n.a / |a|). In space the attraction also has
a part b perpendicular to n and v. Then sin(alpha)^2 = (n.a)^2 + (b.a)^2 (for |a| = 1) does not vanish at Q, and the
paper's weight is discontinuous there. max(0, -n.a / |a|) is continuous, and still right: a convex obstacle lies behind
the plane through its nearest point perpendicular to n, and where n.a >= 0 the line to the goal does not go behind that
plane.

A vortex with this weight never stops a point: where a + weight V = 0, the part along n, which is n.a, is 0; so the
weight is 0; so a is 0, which is the goal. A vortex that is not discarded does stop it, where V = -a.

**Axis.** In the plane only the sense is free: +z or -z. In space a direction tau selects along which side of the
obstacle the robot moves. With the outward normal n, the axis is

    w = n x tau / |n x tau|,

so that w x n is the part of tau that is tangent to the contours where the vortex starts. The axis is kept as long as
the obstacle obstructs the motion, and the field is w x n as n changes. If everything lies in a plane, w is +z or -z and
w x n is the paper's tangent. No other axis does what a vortex is for: w must be perpendicular to n for the field to
have its full modulus where it starts. Later on |w x n| is less than 1 where n is not perpendicular to w, and 0 where n
is along w: on a sphere no tangent field vanishes nowhere.

Related work also chooses a direction and derives the axis from it. J. Singh, H. Stephanou and J. Wen, "Real-time robot
motion control with circulatory fields", IEEE International Conference on Robotics and Automation, 1996, use artificial
currents on surfaces whose magnetic fields bend the path. S. Haddadin, R. Belder and A. Albu-Schäffer, "Dynamic motion
planning for robots in partially unknown environments", 18th IFAC World Congress, 2011, do so in space. A. Ataka, H.-K.
Lam and K. Althoefer, "Reactive magnetic-field-inspired navigation method for robots in unknown convex 3-D
environments", IEEE Robotics and Automation Letters 3(4), 2018, derive the current from the robot's own motion: that is
the shorter side. M. Becker, T. Lilge, M. Müller and S. Haddadin, "Circular fields and predictive multi-agents for
online global trajectory planning", IEEE Robotics and Automation Letters 6(2), 2021, simulate agents with several axes
and take the best.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from firas import closeness
from numpy.typing import ArrayLike, NDArray

from cinegen.collision import PlanningError

Array = NDArray[np.float64]


class FieldError(PlanningError):
    """An invalid parameter of a field; the message names it, and the valid values."""


def require_positive(name: str, value: float) -> None:
    """Raise FieldError unless the value is a finite number above 0."""
    if not (math.isfinite(value) and value > 0.0):
        raise FieldError(f"{name} is {value!r}; give a finite number above 0")


@dataclass(frozen=True)
class Vortex:
    """Vortex of an obstacle of any shape, as a velocity that is added to the attraction.

    The paper adds the potential U_v and descends: then U_v falls along V, as -s arctan(y / x) does along equation 4.

    Attributes:
        strength: s, J: decrease of the local potential of a point's vortex for each radian.
        reach: d_r, m: range of influence.

    Raises:
        FieldError: the strength or the reach is not a finite number above 0.
    """

    strength: float
    reach: float

    def __post_init__(self) -> None:
        require_positive("the strength of a vortex", self.strength)
        require_positive("the reach of a vortex", self.reach)

    def modulus(self, distances: ArrayLike) -> Array:
        """Return s m(d) (m,), N, at distances (m,), m; NaN at contact."""
        return self.strength * closeness(distances, self.reach)

    def velocity(self, distances: ArrayLike, normals: ArrayLike, axis: ArrayLike) -> Array:
        """Return s m(d) w x n (m, 3), N; NaN at contact.

        Args:
            distances: (m,) from the obstacle, m.
            normals: (m, 3) unit vectors n from the nearest point of the obstacle.
            axis: (3,) or (m, 3) unit vectors w, axes of rotation.
        """
        tangent = np.cross(np.asarray(axis, dtype=float), np.asarray(normals, dtype=float))
        return np.asarray(self.modulus(distances)[..., None] * tangent)


def facing(attractions: ArrayLike, normals: ArrayLike) -> Array:
    """Return the weight of a vortex, max(0, -n.a / |a|) (m,), in [0, 1]; 0 at the goal.

    Args:
        attractions: (m, 3) a, of any unit.
        normals: (m, 3) outward unit normals n of the obstacle.
    """
    a = np.asarray(attractions, dtype=float)
    size = np.linalg.norm(a, axis=-1, keepdims=True)
    unit = a / np.where(size > 0.0, size, 1.0)
    return np.asarray(np.maximum(-(unit * np.asarray(normals, dtype=float)).sum(axis=-1), 0.0))
