"""The elliptical potential of R. Volpe and P. Khosla, which repels from a box.

R. Volpe and P. Khosla, "Artificial potentials with elliptical isopotential contours for obstacle avoidance", 26th IEEE
Conference on Decision and Control, 1987; "Manipulator control with superquadric artificial potential functions: theory
and experiments", IEEE Transactions on Systems, Man, and Cybernetics 20(6), 1990. `enclosing_potentials.py` plans with
it, and `vortex_figures.py` draws it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from firas import CONTACT, nan_at_contact
from numba import types
from numpy.typing import ArrayLike, NDArray
from vortex_field import FieldError, require_positive

from cinegen.jit.compiled import compiled, entry, prepare

Array = NDArray[np.float64]

_TINY = 1e-300
_ROUNDS = 80  # at most, to find K
_SAME = 1e-14  # of K


def finite_vector(name: str, value: ArrayLike) -> Array:
    """Return a read-only copy (3,); raise FieldError unless it is three finite numbers."""
    vector = np.array(value, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise FieldError(f"{name} is {value!r}; give three finite numbers")
    vector.setflags(write=False)
    return vector


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
        prepare(find_contours, types.float64[:, ::1], types.float64[::1], types.float64, types.float64[::1])
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


@entry
def find_contours(logs: Array, shares: Array, rounding: float, k: Array) -> None:
    """Compute the root K of each point's equation by Newton's method, with bisection where that leaves the bracket.

    Args:
        logs: (m, 3) log |x_i / h_i|.
        shares: (3,) (h_i / a)^2.
        rounding: beta.
        k: (m,) becomes K; 0 on the box and in it.
    """
    all_shares = shares[0] + shares[1] + shares[2]
    for i in range(logs.shape[0]):
        largest = max(logs[i, 0], logs[i, 1], logs[i, 2])
        if largest <= 0.0 or _excess(logs[i], largest, shares, rounding, CONTACT)[0] <= 0.0:
            k[i] = 0.0
            continue
        low = 0.0
        high = math.sqrt(all_shares) * math.exp(largest) - 1.0  # a bound for every n: the largest term times all shares
        estimate = high
        for _ in range(_ROUNDS):
            excess, slope = _excess(logs[i], largest, shares, rounding, estimate)
            if excess > 0.0:
                low = estimate
            else:
                high = estimate
            before, estimate = estimate, estimate - excess / slope
            if not low < estimate < high:
                estimate = 0.5 * (low + high)
            if abs(estimate - before) <= _SAME * estimate:
                break
        k[i] = estimate


@compiled
def _excess(logs: Array, largest: float, shares: Array, rounding: float, k: float) -> tuple[float, float]:
    """Return the log of a point's n-norm less that of the contour K, positive beyond it; and its derivative by K, exact
    at the root, approximate elsewhere."""
    n = -1.0 / math.expm1(-rounding * max(k, CONTACT))
    total, mean = 0.0, 0.0
    for j in range(3):
        term = shares[j] * math.exp(2.0 * n * (logs[j] - largest))
        total += term
        mean += term * logs[j]
    norm = math.log1p(k)
    by_n = (mean / total - norm) / n
    slope = by_n * -rounding * math.exp(-rounding * k) * n * n - 1.0 / (1.0 + k)
    return largest + math.log(total) / (2.0 * n) - norm, slope
