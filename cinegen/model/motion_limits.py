"""Limits of a motion: those of a mechanism's description, and defaults where it has none."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, Bools
from cinegen.errors import CinegenError
from cinegen.joints import step_scale
from cinegen.model.mechanism import Mechanism

DEFAULT_VELOCITY = 1.0, 0.25
"""rad/s and m/s, where a description has no limit. 0.25 m/s is the reduced speed of industrial robots (ISO 10218-1)."""

DEFAULT_ACCELERATION = 10.0, 2.5
"""rad/s^2 and m/s^2; neither URDF nor RAFF has limits of acceleration."""


class MotionLimits(NamedTuple):
    """Limits of the joints' motion; infinite where there is none: those of passive joints without a limit of their
    own, and of the jerk unless it is given.

    Attributes:
        velocity: (nv,) rad/s and m/s.
        acceleration: (nv,) rad/s^2 and m/s^2.
        jerk: (nv,) rad/s^3 and m/s^3.
        defaults: names of the joints whose velocity, and of those whose acceleration, is limited by a default.
    """

    velocity: Array
    acceleration: Array
    jerk: Array
    defaults: tuple[tuple[str, ...], tuple[str, ...]]

    def __str__(self) -> str:
        """Return what is assumed; empty if all limits are known."""
        sentences = []
        for names, what, (angular, linear), unit in zip(
            self.defaults, ("velocity", "acceleration"), (DEFAULT_VELOCITY, DEFAULT_ACCELERATION), ("s", "s^2"),
            strict=True,
        ):  # fmt: skip
            if names:
                listed = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
                sentences.append(f"{what} limit of {listed}: {angular:g} rad/{unit}, {linear:g} m/{unit}")
        return "; ".join(sentences)


def motion_limits(
    mechanism: Mechanism,
    acceleration: float | Mapping[str, float] | None = None,
    jerk: float | Mapping[str, float] | None = None,
) -> MotionLimits:
    """Return the limits of a mechanism's motion.

    Args:
        mechanism: its description limits velocities.
        acceleration: rad/s^2 and m/s^2: one number for all actuated joints, or by joint name; the default for joints
            that are left out.
        jerk: rad/s^3 and m/s^3 likewise; unlimited for joints that are left out.

    Raises:
        UnknownNameError: no such joint.
        CinegenError: a limit is not positive.
    """
    free = np.ones(mechanism.model.nv, dtype=bool)
    if mechanism.is_constrained:
        free[mechanism.structure.passive_columns] = False
    known = np.isfinite(mechanism.limits.velocity)
    velocity = np.where(known, mechanism.limits.velocity, np.where(free, _default(mechanism, DEFAULT_VELOCITY), np.inf))
    limits = _limits(mechanism, "acceleration", acceleration, free)
    accelerations = np.where(
        np.isfinite(limits), limits, np.where(free, _default(mechanism, DEFAULT_ACCELERATION), np.inf)
    )
    columns = mechanism.columns
    defaults = (
        tuple(dict.fromkeys(columns[j] for j in np.flatnonzero(free & ~known))),
        tuple(dict.fromkeys(columns[j] for j in np.flatnonzero(free & ~np.isfinite(limits)))),
    )
    return MotionLimits(velocity, accelerations, _limits(mechanism, "jerk", jerk, free), defaults)


def _default(mechanism: Mechanism, values: tuple[float, float]) -> Array:
    """Return a default of each column (nv,) for rotations and translations."""
    angular, linear = values
    return angular * step_scale(mechanism.model, linear / angular)


def _limits(mechanism: Mechanism, what: str, values: float | Mapping[str, float] | None, free: Bools) -> Array:
    """Return limits (nv,) that are given; infinite elsewhere."""
    limits = np.full(mechanism.model.nv, np.inf)
    if values is None:
        return limits
    if isinstance(values, Mapping):
        for joint, limit in values.items():
            limits[mechanism.v_index(joint)] = _positive(f"the {what} limit of '{joint}'", limit)
        return limits
    limits[free] = _positive(f"the {what} limit", values)
    return limits


def _positive(what: str, limit: float) -> float:
    if not 0.0 < limit < math.inf:
        raise CinegenError(f"{what} is {limit!r}: give a finite number above 0 (per s^2 or s^3, rad and m)")
    return float(limit)
