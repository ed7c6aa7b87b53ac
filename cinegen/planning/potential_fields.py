"""Potentials that repel from obstacles: FIRAS, spherical and elliptical, in plain numpy.

Points are (m, 3), m, in one frame; a single point (3,) works as well. What moves in a plane has z = 0. Potentials are
in J and gradients in N, of forces that act on nothing: only their ratios matter.

- O. Khatib, "Real-time obstacle avoidance for manipulators and mobile robots", The International Journal of Robotics
  Research 5(1), 1986 (FIRAS).
- R. Volpe and P. Khosla, "Artificial potentials with elliptical isopotential contours for obstacle avoidance", 26th
  IEEE Conference on Decision and Control, 1987; "Manipulator control with superquadric artificial potential functions:
  theory and experiments", IEEE Transactions on Systems, Man, and Cybernetics 20(6), 1990 (elliptical).
- C. De Medio and G. Oriolo, "Robot obstacle avoidance using vortex fields", Advances in Robot Kinematics, Springer
  1991, equation 2 (spherical) and equation 3 (FIRAS).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.collision.errors import PlanningError
from cinegen.planning._kernels.superquadric import CONTACT, find_contours, prepare_contours

Array = NDArray[np.float64]

_TINY = 1e-300


class FieldError(PlanningError):
    """An invalid parameter of a field; the message names it, and the valid values."""


def require_positive(name: str, value: float) -> None:
    """Raise FieldError unless the value is a finite number above 0."""
    if not (math.isfinite(value) and value > 0.0):
        raise FieldError(f"{name} is {value!r}; give a finite number above 0")


def finite_vector(name: str, value: ArrayLike) -> Array:
    """Return a read-only copy (3,); raise FieldError unless it is three finite numbers."""
    given = np.array(value, dtype=float)
    if given.shape != (3,) or not np.isfinite(given).all():
        raise FieldError(f"{name} is {value!r}; give three finite numbers")
    given.setflags(write=False)
    return given


def nan_at_contact(distances: ArrayLike) -> Array:
    """Return distances (m,), m; NaN at contact (up to 1e-12 m) and below, where no field is defined."""
    d = np.asarray(distances, dtype=float)
    return np.where(d > CONTACT, d, np.nan)


def closeness(distances: ArrayLike, reach: float) -> Array:
    """Return 1/d - 1/d_r (m,), 1/m, for distances d < d_r; 0 beyond and NaN at contact.

    The bracket of the FIRAS potential (equation 3): continuous, and unbounded toward the obstacle.
    """
    return np.maximum(1.0 / nan_at_contact(distances) - 1.0 / reach, 0.0)


@dataclass(frozen=True)
class Firas:
    """FIRAS potential: U_f = k/2 (1/d - 1/d_r)^2 for 0 < d < d_r, and 0 beyond. It and its gradient are continuous.

    It needs only the distance and the normal, so it fits an obstacle of any shape. Along a flat side its contours are
    flat at every distance: there the total field has local minima.

    Attributes:
        strength: k, J m^2.
        reach: d_r, m: range of influence.

    Raises:
        FieldError: the strength or the reach is not a finite number above 0.
    """

    strength: float
    reach: float

    def __post_init__(self) -> None:
        require_positive("the strength of a FIRAS potential", self.strength)
        require_positive("the reach of a FIRAS potential", self.reach)

    def value(self, distances: ArrayLike) -> Array:
        """Return the potential (m,), J, at distances (m,), m; infinite at contact."""
        value = 0.5 * self.strength * closeness(distances, self.reach) ** 2
        return np.where(np.isnan(value), np.inf, value)

    def gradient(self, distances: ArrayLike, normals: ArrayLike) -> Array:
        """Return -k (1/d - 1/d_r) / d^2 n (m, 3), N; NaN at contact.

        Args:
            distances: (m,) from the obstacle, m.
            normals: (m, 3) unit vectors from the nearest point of the obstacle: the gradient of the distance.
        """
        slope = -self.strength * closeness(distances, self.reach) / nan_at_contact(distances) ** 2
        return np.asarray(slope[..., None] * np.asarray(normals, dtype=float))


@dataclass(frozen=True)
class Spherical:
    """Spherical potential: U_r1 = k / d^(2 gamma), which is equation 2 for a point.

    "Potential (2) can be easily modified for the case of obstacles with center in A and maximum radius r, by letting it
    go to infinity at a distance r from A": d is the distance from the ball around the obstacle. Its contours have a
    higher curvature than those of the attraction, so one such obstacle creates no minimum; but the whole ball is
    forbidden, also around a long rod. The potential has no range: it decreases, and never ends.

    Attributes:
        strength: k, J m^(2 gamma).
        exponent: gamma; the larger, the faster the potential decreases.

    Raises:
        FieldError: the strength or the exponent is not a finite number above 0.
    """

    strength: float
    exponent: float = 1.0

    def __post_init__(self) -> None:
        require_positive("the strength of a spherical potential", self.strength)
        require_positive("the exponent of a spherical potential", self.exponent)

    def value(self, distances: ArrayLike) -> Array:
        """Return the potential (m,), J, at distances (m,) from the ball, m; infinite at contact."""
        value = self.strength / nan_at_contact(distances) ** (2.0 * self.exponent)
        return np.where(np.isnan(value), np.inf, value)

    def gradient(self, distances: ArrayLike, normals: ArrayLike) -> Array:
        """Return -2 gamma k / d^(2 gamma + 1) n (m, 3), N; NaN at contact.

        Args:
            distances: (m,) from the ball, m.
            normals: (m, 3) unit vectors from the nearest point of the ball.
        """
        double = 2.0 * self.exponent
        slope = -double * self.strength / nan_at_contact(distances) ** (double + 1.0)
        return np.asarray(slope[..., None] * np.asarray(normals, dtype=float))


@dataclass(frozen=True, eq=False)
class Elliptical:
    """Volpe and Khosla's potential, U_r2 = A e^(-alpha K) / K, of the dimensionless pseudo-distance K from a box.

    The contour K is the superquadric, with the longest half edge a among the half edges h_i (b, c the others),

        sum_i (h_i / a)^2 |x_i / h_i|^(2n) = (1 + K)^(2n),    n = 1 / (1 - e^(-beta K)).

    On the box K = 0 and n is infinite: the contour is the box itself. Far away n = 1, where the factors (h_i / a)^2
    make it a circle (in space a sphere) of radius a (1 + K). In between it is roughly an ellipse. The exponent belongs
    to the contour, not to the point, so K is the root of an equation; each point lies on one contour only if beta
    ln(sum_i (h_i / a)^2) < 2, which is required.

    The original papers were not available: the formulas are as others report them, and only their consequences are
    tested. Taken from the reports: the contours of a rectangle with these factors and this n, and the avoidance
    potential A e^(-alpha K) / K. In space one n serves all directions, where the papers allow two; and the decays of
    the exponent, beta, and of the potential, alpha, are two numbers.

    Near a long side the contours have a lower curvature than those of the attraction, and the total field has a local
    minimum in front of a rod: figure 1 of De Medio and Oriolo 1991.

    Attributes:
        centre: (3,) of the box, m.
        half: (3,) half its edges, m. Infinite along at most two axes: a prism, which is a rectangle in the plane.
        strength: A, J.
        decay: alpha, of the potential.
        rounding: beta, of the contours: the larger, the closer to the box they become ellipses.
        axes: (3, 3) rotation; its columns are the directions of the box's edges.

    Raises:
        FieldError: the box is invalid, a number is not above 0, or contours would intersect.
    """

    centre: Array
    half: Array
    strength: float = 1.0
    decay: float = 1.0
    rounding: float = 1.0
    axes: Array = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", finite_vector("the centre of an elliptical potential", self.centre))
        for name in ("half", "axes"):
            values = np.array(getattr(self, name), dtype=float)
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        if self.half.shape != (3,) or not (self.half > 0.0).all() or not np.isfinite(self.half).any():
            raise FieldError(
                f"half the edges of a box are {self.half}; give three lengths above 0, one at least finite"
            )
        if self.axes.shape != (3, 3) or not np.allclose(self.axes.T @ self.axes, np.eye(3), atol=1e-6):
            raise FieldError("the axes of a box are not perpendicular unit vectors; give a rotation (3, 3)")
        prepare_contours()
        for name in ("strength", "decay", "rounding"):
            require_positive(f"the {name} of an elliptical potential", getattr(self, name))
        shares = math.log(float(self._shares.sum()))
        if self.rounding * shares >= 2.0:
            raise FieldError(
                f"the rounding of an elliptical potential is {self.rounding:g}: contours of this box would intersect; "
                f"give less than {2.0 / shares:.3g}"
            )

    def pseudo_distance(self, points: ArrayLike) -> Array:
        """Return K (m,) at points (m, 3): 0 on the box and inside."""
        logs = self._logs(self._local(points))
        k = np.empty(logs.shape[:-1])
        find_contours(np.ascontiguousarray(logs.reshape(-1, 3)), self._shares, float(self.rounding), k.reshape(-1))
        return k

    def value(self, points: ArrayLike) -> Array:
        """Return the potential (m,), J, at points (m, 3); infinite at contact and inside."""
        k = nan_at_contact(self.pseudo_distance(points))
        value = self.strength * np.exp(-self.decay * k) / k
        return np.where(np.isnan(value), np.inf, value)

    def gradient(self, points: ArrayLike) -> Array:
        """Return the gradient (m, 3), N, at points (m, 3); NaN at contact and inside."""
        k = nan_at_contact(self.pseudo_distance(points))
        slope = -self.strength * np.exp(-self.decay * k) * (self.decay * k + 1.0) / k**2
        return np.asarray(slope[..., None] * self._pseudo_distance_gradient(points, k))

    def _pseudo_distance_gradient(self, points: ArrayLike, k: Array) -> Array:
        """Return the gradient of K (m, 3), by the implicit function theorem."""
        local = self._local(points)
        logs = self._logs(local)
        n = self._order(np.maximum(k, CONTACT))
        terms = self._shares * np.exp(2.0 * n[..., None] * (logs - logs.max(axis=-1, keepdims=True)))
        terms = terms / terms.sum(axis=-1, keepdims=True)  # each axis's part of the n-norm
        flat = (local == 0.0) | np.isinf(self.half)
        along = np.where(flat, 0.0, terms / np.where(flat, 1.0, local))
        # derivative by K of the log of the n-norm of the point less that of its contour
        by_n = ((terms * logs).sum(axis=-1) - np.log1p(k)) / n
        by_k = by_n * -self.rounding * np.exp(-self.rounding * k) * n**2 - 1.0 / (1.0 + k)
        return np.asarray(along @ self.axes.T / -by_k[..., None])

    def _order(self, k: Array) -> Array:
        """Return n (m,)."""
        return np.asarray(-1.0 / np.expm1(-self.rounding * k))

    def _local(self, points: ArrayLike) -> Array:
        """Return points (m, 3) in the box's frame."""
        return np.asarray((np.asarray(points, dtype=float) - self.centre) @ self.axes)

    def _logs(self, local: Array) -> Array:
        """Return log |x_i / h_i| (m, 3); very low, but finite, in the middle and along infinite edges."""
        return np.log(np.maximum(np.abs(local) / self.half, _TINY))

    @property
    def _shares(self) -> Array:
        """Return (h_i / a)^2 (3,); 0 along infinite edges."""
        finite = np.isfinite(self.half)
        return np.where(finite, (np.where(finite, self.half, 0.0) / self.half[finite].max()) ** 2, 0.0)
