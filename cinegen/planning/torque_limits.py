"""Limits of torque along a path of known geometry.

Along a path q(s), the torques of the actuated joints without friction are linear in the second derivative of s and the
square of the first one. Viscous friction d adds a term in the first one, and Coulomb friction f a constant one while
there is motion:

    tau = m(s) s'' + c(s) s'^2 + d(s) s' + f(s) + g(s),

with m(s) = tau(q, 0, dq/ds) - g(s), c(s) = tau(q, dq/ds, d2q/ds2) - g(s), g(s) = tau(q, 0, 0).

J. E. Bobrow, S. Dubowsky and J. S. Gibson, "Time-Optimal Control of Robotic Manipulators Along Specified Paths", Int.
J. Robotics Research 4, 1985. With loops, tau is that of the closed mechanism (`cinegen.dynamics`), as a function of the
derivatives of its actuated joints.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.dynamics import InverseDynamics, Payload
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.model import Mechanism
from cinegen.planning.singular_crossing import CrossingDynamics, crossings
from raff2urdf.quantities import FORCE, TORQUE, Dimension, shown

_INSIDE = 1.0 - 1e-6  # of a limit, which the samples then keep in spite of rounding
_CROSSING = "torques leave out the friction of joints: a singularity is crossed by a condition without it"
_AT = 1e-5  # weight up to which a point is at a singularity: torques are 0 / 0 there, up to rounding


class TorqueTerms(NamedTuple):
    """Torques relative to their limits, of a moving mechanism: (`inertial` s'' + `centrifugal` s'^2 + `viscous` s' +
    `dry` + `static`) / `weight`, with s' > 0.

    Attributes:
        inertial, centrifugal, viscous, dry, static: (..., joints).
        weight: (...,) 1, but less near a singularity of type 2 that is crossed, and 0 at it.
    """

    inertial: Array
    centrifugal: Array
    viscous: Array
    dry: Array
    static: Array
    weight: Array

    @property
    def has_pace(self) -> bool:
        """True if the motion can't be slowed down at will: a singularity is crossed, or torques do not hold the
        mechanism at rest everywhere."""
        slow = np.maximum(np.abs(self.static), np.abs(self.static + self.dry))
        return bool((self.weight < 1.0).any() or (slow >= _INSIDE).any())

    def scaled(self, factor: float) -> TorqueTerms:
        """Return these terms for limits that are smaller by a factor."""
        return TorqueTerms(*[*(factor * term for term in self[:-1]), self.weight])

    def used(self, growth: Array, square: Array) -> Array:
        """Return the torques (..., joints) relative to their limits at s'' and s'^2 (...,); NaN at singularities."""
        rate, still = np.sqrt(np.maximum(square, 0.0))[..., None], self.static
        moving = self.inertial * growth[..., None] + self.centrifugal * square[..., None] + self.viscous * rate + still
        moving = moving + np.where(rate > 0.0, self.dry, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.weight[..., None] > _AT, moving / self.weight[..., None], np.nan)


class TorqueLimits:
    """Limits of the torques and forces of a mechanism's actuated joints.

    Args:
        mechanism: any whose links have masses.
        payloads: bodies on nodes, and wrenches.
        efforts: limits, N m and N: one number for all actuated joints, or by joint name; those of the description
            unless given.
        gravity: (3,) acceleration, m/s^2, in the world; the mechanism's if None.
        crosses: whether paths may pass singularities of type 2, at a speed at which torques stay within their limits;
            else they are refused.

    Attributes:
        mechanism, crosses: as given.
        joints: actuated joints that have a limit.
        limits: their limits, N m and N.
        notes: what is left out of the torques: that of the file, and friction where singularities may be passed.

    Raises:
        UnknownNameError: no such joint or node.
        MassError: moving links have no mass.
        CinegenError: no actuated joint has a limit, or a limit is not positive.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        payloads: Sequence[Payload] = (),
        efforts: float | Mapping[str, float] | None = None,
        gravity: ArrayLike | None = None,
        crosses: bool = False,
    ) -> None:
        self.mechanism, self.crosses = mechanism, crosses
        self._dynamics = InverseDynamics(mechanism, payloads, gravity, friction=False)
        rubs = bool(mechanism.model.damping.any() or mechanism.model.upperDryFrictionLimit.any())
        self._resisting = InverseDynamics(mechanism, payloads, gravity) if rubs and not crosses else None
        self.notes = (*self._dynamics.notes, *([_CROSSING] if rubs and crosses else []))
        limits = _efforts(mechanism, efforts)
        limited = np.isfinite(limits)
        self.joints = tuple(name for name, has in zip(mechanism.actuated, limited, strict=True) if has)
        if not self.joints:
            raise CinegenError(
                f"{mechanism.name}: no actuated joint has a limit of torque or force: give them in the file "
                "('effort'), or as efforts"
            )
        if crosses and not limited.all():
            raise CinegenError(
                f"{mechanism.name}: to cross a singularity, all actuated joints need limits of torque or force: these "
                f"have none: {', '.join(name for name in mechanism.actuated if name not in self.joints)}"
            )
        self.limits, self._limited = limits[limited], np.flatnonzero(limited)

    def terms(self, q: Array, tangents: Array, bends: Array, nudge: ArrayLike = 0.0) -> TorqueTerms:
        """Return the torques along a path.

        Args:
            q: (..., nq) configurations with closed loops.
            tangents: (..., actuated) derivatives of the actuated joints by the path's parameter.
            bends: (..., actuated) their second derivatives.
            nudge: step of the path's parameter from each point to where friction counts, (..., 1): a joint that is at
                rest at an end of an interval moves within it.

        Raises:
            CinegenError: no torques of the actuated joints hold the mechanism at one of these configurations.
        """
        shape = tangents.shape[:-1]
        flat = q.reshape(-1, q.shape[-1])
        first, second = (rows.reshape(len(flat), -1) for rows in (tangents, bends))
        static = self._torques(flat, None, None)
        inertial = self._torques(flat, np.zeros_like(first), first) - static
        centrifugal = self._torques(flat, first, second) - static
        moving = np.reshape(tangents + np.asarray(nudge) * bends, first.shape)
        parts = inertial, centrifugal, *self._friction(flat, moving, second), static
        return TorqueTerms(*[*(part.reshape(*shape, -1) for part in parts), np.ones(shape)])

    def crossing_terms(self, driven: Mechanism, q: Array, tangents: Array, bends: Array) -> TorqueTerms:
        """Return the torques along a path that may pass singularities of type 2.

        Args:
            driven: the mechanism as `guided` returns it.
            q: (..., nq) configurations with closed loops.
            tangents: (..., guides) derivatives of the joints that drive it by the path's parameter.
            bends: (..., guides) their second derivatives.
        """
        dynamics, shape = CrossingDynamics(self._dynamics, driven), tangents.shape[:-1]
        flat = (rows.reshape(math.prod(shape), -1) for rows in (q, tangents, bends))
        terms = [dynamics.terms(*point) for point in zip(*flat, strict=True)]
        inertial, centrifugal, static, weight = (np.array(column) for column in zip(*terms, strict=True))
        parts = inertial, centrifugal, 0.0 * static, 0.0 * static, static  # without friction, see `notes`
        return TorqueTerms(*[*(part.reshape(*shape, -1) / self.limits for part in parts), weight.reshape(shape)])

    def crossings(self, driven: Mechanism, q_at: Callable[[float], Array], grid: Array) -> Array:
        """Return the parameters between those of a grid (n,) at which a path passes singularities of type 2."""
        dynamics = CrossingDynamics(self._dynamics, driven)
        return crossings(lambda s: dynamics.side(q_at(s)), grid)

    def of_samples(self, q: Array, rate: float) -> TorqueTerms:
        """Return the torques at samples (n, nq), `rate` a second, of a motion from rest to rest at s' = s'' = 1: those
        of inertia as `inertial`. Velocities and accelerations are finite differences."""
        at = [self.mechanism.q_index(name) for name in self.mechanism.actuated]
        padded = np.vstack([q[:1, at], q[:, at], q[-1:, at]])
        v = 0.5 * rate * (padded[2:] - padded[:-2])
        a = rate**2 * (padded[2:] - 2.0 * padded[1:-1] + padded[:-2])
        static = self._torques(q, None, None)
        moving = self._torques(q, v, a) - static
        return TorqueTerms(moving, np.zeros_like(static), *self._friction(q, v, a), static, np.ones(len(q)))

    def excess(self, q: Array, rate: float) -> float:
        """Return the factor by which samples (n, nq) of a motion from rest to rest, `rate` a second, must be slower to
        obey the limits; 0 where they may even be at any speed.

        Raises:
            CinegenError: a joint exceeds its limit even at rest.
        """
        terms = self.of_samples(q, rate)
        self.check_static(terms.static)
        sign, steady = np.where(terms.inertial + terms.viscous > 0.0, 1.0, -1.0), terms.dry + terms.static
        room = np.maximum(_INSIDE - sign * steady, 1e-300)
        # Slower by f they need inertial / f^2 + viscous / f; what helps is left out.
        inertial, viscous = (np.maximum(sign * term, 0.0) for term in (terms.inertial, terms.viscous))
        factors = (viscous + np.sqrt(viscous**2 + 4.0 * inertial * room)) / (2.0 * room)
        within = np.abs(terms.inertial + terms.viscous + steady) <= _INSIDE
        return float(np.where(within, np.minimum(factors, 1.0), factors).max(initial=0.0))

    def largest(self, q: Array, rate: float) -> Array:
        """Return the largest torque (joints,) of each joint at samples (n, nq), `rate` a second, relative to its
        limit."""
        terms = self.of_samples(q, rate)
        moving = terms.inertial + terms.viscous + terms.dry + terms.static
        return np.asarray(np.abs(moving).max(axis=0, initial=0.0))

    def text(self, largest: Array) -> str:
        """Return the largest torques (joints,), relative to their limits, for users."""
        i = int(largest.argmax())
        limit = shown(float(self.limits[i]), self._dimension(i), 4)
        others = ", no other joint more of its own" if len(self.joints) > 1 else ""
        return f"{self.joints[i]} needs at most {100.0 * largest[i]:.0f} % of its {limit}{others}"

    def check_static(self, static: Array, where: str = "on this path") -> None:
        """Raise a `CinegenError` if a torque at rest (..., joints), relative to its limit, exceeds it."""
        flat = np.abs(static.reshape(-1, static.shape[-1]))
        worst = int(flat.max(axis=0, initial=0.0).argmax())
        most = float(flat[:, worst].max(initial=0.0))
        if most >= _INSIDE:
            kind, limit = self._dimension(worst), float(self.limits[worst])
            raise CinegenError(
                f"{self.mechanism.name}: {self.joints[worst]} needs {shown(most * limit, kind, 4)} to hold the "
                f"mechanism at rest {where}, and its limit is {shown(limit, kind, 4)}"
            )

    def _dimension(self, i: int) -> Dimension:
        return FORCE if self.mechanism.is_prismatic(self.joints[i]) else TORQUE

    def _friction(self, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Return the torques (n, joints) of viscous and of Coulomb friction, relative to their limits."""
        if self._resisting is None:
            none = np.zeros((len(q), len(self.joints)))
            return none, none
        once, twice = (
            self._torques(q, speed * v, a, self._resisting) - self._torques(q, speed * v, a) for speed in (1.0, 2.0)
        )
        return twice - once, 2.0 * once - twice

    def _torques(self, q: Array, v: Array | None, a: Array | None, dynamics: InverseDynamics | None = None) -> Array:
        torques = (dynamics or self._dynamics).torques_of(q, v, a, actuated=v is not None)[:, self._limited]
        lost = np.flatnonzero(~np.isfinite(torques).all(axis=1))
        if len(lost):
            raise CinegenError(
                f"{self.mechanism.name}: no torques of the actuated joints hold it at {len(lost)} of {len(q)} points "
                "of the path: it passes a type 2 singularity there (--cross-singularities, crosses=True: it may)"
            )
        return torques / self.limits


def _efforts(mechanism: Mechanism, asked: float | Mapping[str, float] | None) -> Array:
    """Return the limits (actuated,) of actuated joints, N m and N; infinite where there is none."""
    limits = {name: mechanism.limits[name].effort for name in mechanism.actuated}
    if isinstance(asked, Mapping):
        for name in asked:
            if name not in limits:
                raise UnknownNameError("actuated joint", name, mechanism.actuated)
        limits |= asked
    elif asked is not None:
        limits = dict.fromkeys(limits, asked)
    for name, limit in limits.items():
        if not limit > 0.0:
            raise CinegenError(f"the limit of torque or force of {name} must be positive, not {limit:g}")
    return np.array(list(limits.values()))
