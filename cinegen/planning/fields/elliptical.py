"""Volpe and Khosla's potential, whose contours are the box near it and circles far away.

R. Volpe and P. Khosla, "Artificial potentials with elliptical isopotential contours for obstacle avoidance", 26th IEEE
Conference on Decision and Control, 1987; "Manipulator control with superquadric artificial potential functions: theory
and experiments", IEEE Transactions on Systems, Man, and Cybernetics 20(6), 1990.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.planning._kernels.superquadric import CONTACT, find_contours, prepare_contours
from cinegen.planning.fields.parameter import FieldError, positive, vector

Array = NDArray[np.float64]

_NOTHING = 1e-300


@dataclass(frozen=True, eq=False)
class Elliptical:
    """U_r2 = A e^(-alpha K) / K of the pseudo-distance K from a box: 0 on it, and without unit.

    The contour K is the superquadric, with the longest half edge a among the half edges h_i (b, c the others),

        sum_i (h_i / a)^2 |x_i / h_i|^(2n) = (1 + K)^(2n),    n = 1 / (1 - e^(-beta K)).

    On the box K = 0 and n is infinite: the contour is the box itself. Far away n = 1, where the factors (h_i / a)^2
    make it a circle (in space a sphere) of radius a (1 + K). In between it is an ellipse, more or less. The exponent
    belongs to the contour, not to the point, so K is the root of an equation; each point lies on one contour only if
    beta ln(sum_i (h_i / a)^2) < 2, which is asked for.

    The papers were not at hand: these formulas are as others report them, and only their consequences are tested. What
    is taken: the contours of a rectangle with these factors and this n, and the avoidance
    potential A e^(-alpha K) / K. In space one n serves all directions, where they allow two; and the decays of the
    exponent, beta, and of the potential, alpha, are two numbers.

    Near a long side the contours bend less than those of the attraction, and the total field has a minimum in front of
    a rod: figure 1 of De Medio and Oriolo 1991.

    Attributes:
        centre: (3,) of the box, m.
        half: (3,) half its edges, m. Infinite along at most two axes: a prism, which is a rectangle in the plane.
        strength: A, J.
        decay: alpha, of the potential.
        rounding: beta, of the contours: the greater, the closer to the box they become ellipses.
        axes: (3, 3) rotation; its columns are the box's edges.

    Raises:
        FieldError: the box is none, a number is not above 0, or contours would meet.
    """

    centre: Array
    half: Array
    strength: float = 1.0
    decay: float = 1.0
    rounding: float = 1.0
    axes: Array = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", vector("the centre of an elliptical potential", self.centre))
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
        positive("the strength of an elliptical potential", self.strength)
        positive("the decay of an elliptical potential", self.decay)
        positive("the rounding of an elliptical potential", self.rounding)
        shares = math.log(float(self._shares.sum()))
        if self.rounding * shares >= 2.0:
            raise FieldError(
                f"the rounding of an elliptical potential is {self.rounding:g}: contours of this box would meet; "
                f"give less than {2.0 / shares:.3g}"
            )

    def pseudo_distance(self, points: ArrayLike) -> Array:
        """(m,) K at points (m, 3), from 0 on the box; 0 in it."""
        logs = self._logs(self._local(points))
        k = np.empty(logs.shape[:-1])
        find_contours(np.ascontiguousarray(logs.reshape(-1, 3)), self._shares, float(self.rounding), k.reshape(-1))
        return k

    def value(self, points: ArrayLike) -> Array:
        """(m,) J, at points (m, 3); infinite at contact and inside."""
        k = self.pseudo_distance(points)
        k = np.where(k > CONTACT, k, np.nan)
        value = self.strength * np.exp(-self.decay * k) / k
        return np.where(np.isnan(value), np.inf, value)

    def gradient(self, points: ArrayLike) -> Array:
        """(m, 3) N, at points (m, 3); nan at contact and inside."""
        k = self.pseudo_distance(points)
        k = np.where(k > CONTACT, k, np.nan)
        slope = -self.strength * np.exp(-self.decay * k) * (self.decay * k + 1.0) / k**2
        return np.asarray(slope[..., None] * self._normals(points, k))

    def _normals(self, points: ArrayLike, k: Array) -> Array:
        """(m, 3) the gradient of K, from its equation by the implicit function theorem."""
        local = self._local(points)
        logs = self._logs(local)
        terms = self._terms(logs, k)
        flat = (local == 0.0) | np.isinf(self.half)
        along = np.where(flat, 0.0, terms / np.where(flat, 1.0, local))
        return np.asarray(along @ self.axes.T / -self._slope(logs, k)[..., None])

    def _terms(self, logs: Array, k: Array) -> Array:
        """(m, 3) what each axis contributes to the n-norm, as parts of 1."""
        n = self._order(np.maximum(k, CONTACT))[..., None]
        terms = self._shares * np.exp(2.0 * n * (logs - logs.max(axis=-1, keepdims=True)))
        return np.asarray(terms / terms.sum(axis=-1, keepdims=True))

    def _slope(self, logs: Array, k: Array) -> Array:
        """(m,) how the log of the n-norm of a point less that of its contour changes with K."""
        n = self._order(np.maximum(k, CONTACT))
        by_n = ((self._terms(logs, k) * logs).sum(axis=-1) - np.log1p(k)) / n
        return np.asarray(by_n * -self.rounding * np.exp(-self.rounding * k) * n**2 - 1.0 / (1.0 + k))

    def _order(self, k: Array) -> Array:
        """(m,) n."""
        return np.asarray(-1.0 / np.expm1(-self.rounding * k))

    def _local(self, points: ArrayLike) -> Array:
        """(m, 3) points in the box's frame."""
        return np.asarray((np.asarray(points, dtype=float) - self.centre) @ self.axes)

    def _logs(self, local: Array) -> Array:
        """(m, 3) log |x_i / h_i|; very low, but finite, in the middle and along what is infinite."""
        return np.log(np.maximum(np.abs(local) / self.half, _NOTHING))

    @property
    def _shares(self) -> Array:
        """(3,) (h_i / a)^2; 0 along what is infinite."""
        finite = np.isfinite(self.half)
        return np.where(finite, (np.where(finite, self.half, 0.0) / self.half[finite].max()) ** 2, 0.0)
