"""Velocities and accelerations of joints, as arrays or by name."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.dynamics.errors import MotionError
from cinegen.errors import ConfigurationError, UnknownNameError
from cinegen.model import Mechanism

Motion = ArrayLike | Mapping[str, float]
"""Velocity or acceleration (nv,) of all joints; or those of actuated joints by name, 0 for the others."""

CONSISTENT = 1e-6
"""Velocities that open a loop faster than this fraction of the fastest joint's, dimensionless, are refused."""


def joint_rates(mechanism: Mechanism, what: str, motion: Motion | None) -> Array:
    """Return rates (nv,) of all joints; 0 for None, and for joints that a mapping leaves out.

    Raises:
        ConfigurationError: it is no finite array of that shape.
        UnknownNameError: no such actuated joint.
    """
    rates = np.zeros(mechanism.model.nv)
    if isinstance(motion, Mapping):
        for name, value in motion.items():
            if name not in mechanism.actuated:
                raise UnknownNameError("actuated joint", name, mechanism.actuated)
            rates[mechanism.v_index(name)] = value
    elif motion is not None:
        rates = np.asarray(motion, dtype=float)
    if rates.shape != (mechanism.model.nv,):
        raise ConfigurationError(f"{what} of {mechanism.name} has {mechanism.model.nv} numbers, not {rates.shape}")
    if not np.isfinite(rates).all():
        raise ConfigurationError(f"{what} of {mechanism.name} has numbers that are not finite")
    return rates


def rates_of(mechanism: Mechanism, what: str, rows: ArrayLike | None, count: int, actuated: bool) -> Array:
    """Return rates (count, nv) of all joints, of rows of all or of the actuated joints; 0 for None.

    Raises:
        ConfigurationError: the rows have another shape, or numbers that are not finite.
    """
    rates = np.zeros((count, mechanism.model.nv))
    if rows is None:
        return rates
    columns = [mechanism.v_index(name) for name in mechanism.actuated] if actuated else slice(None)
    values = rows_of(mechanism, what, rows, len(mechanism.actuated) if actuated else mechanism.model.nv)
    if len(values) != count:
        raise ConfigurationError(f"{what} has {len(values)} rows, q has {count}")
    rates[:, columns] = values
    return rates


def rows_of(mechanism: Mechanism, what: str, rows: ArrayLike, width: int) -> Array:
    """Return rows (count, width) as an array.

    Raises:
        ConfigurationError: they have another shape, or numbers that are not finite.
    """
    values = np.ascontiguousarray(rows, dtype=float)
    if values.ndim != 2 or values.shape[1] != width:
        raise ConfigurationError(f"{what} must be (count, {width}) for {mechanism.name}, not {values.shape}")
    if not np.isfinite(values).all():
        raise ConfigurationError(f"{what} has numbers that are not finite")
    return values


def check_gaps(mechanism: Mechanism, gaps: Array, completes: bool) -> None:
    """Check that velocities and accelerations keep the loops closed.

    Args:
        mechanism: with loops.
        gaps: (3,) how far loops are open; the same of velocities and of
            accelerations, relative to the fastest joint's.
        completes: whether these were those of the actuated joints alone.

    Raises:
        MotionError: they do not.
    """
    for gap, what in zip(gaps[1:], ("velocities", "accelerations"), strict=True):
        if gap > CONSISTENT and completes:
            raise MotionError(
                f"{mechanism.name}: the {what} of the actuated joints contradict each other by {gap:.2g} of the "
                "largest: they are more than the mobility, and not independent"
            )
        if gap > CONSISTENT:
            raise MotionError(
                f"{mechanism.name}: these {what} open loops, at {gap:.2g} of the fastest joint's: give those of the "
                "actuated joints only, by name, and the others follow"
            )
