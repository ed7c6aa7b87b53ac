"""`torques_along`: torques along a sampled trajectory, the figures by which actuators are chosen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.dynamics.inverse_dynamics import InverseDynamics
from cinegen.errors import ConfigurationError
from cinegen.tolerances import CLOSURE
from raff2urdf.errors import counted

_EVEN = 1e-6  # relative difference of two sampling periods


@dataclass(frozen=True, eq=False, repr=False)
class TrajectoryTorques:
    """Torques along a trajectory.

    Attributes:
        joints: the actuated joints.
        times: (n,) s.
        torques: (n, actuated) N m and N; NaN where none hold the load.
        speeds: (n, actuated) rad/s and m/s.
    """

    joints: tuple[str, ...]
    times: Array
    torques: Array
    speeds: Array

    def __repr__(self) -> str:
        return f"<TrajectoryTorques of {', '.join(self.joints)[:60]}: {counted(len(self.times), 'sample')}>"

    @property
    def peak(self) -> Array:
        """(actuated,) largest torques and forces, N m and N."""
        return np.asarray(np.nanmax(np.abs(self.torques), axis=0, initial=0.0))

    @property
    def peak_time(self) -> Array:
        """(actuated,) when these occur, s."""
        return np.asarray(self.times[np.argmax(np.nan_to_num(np.abs(self.torques)), axis=0)])

    @property
    def rms(self) -> Array:
        """(actuated,) root mean squares over time, N m and N: what heats an actuator; NaN where none hold the load."""
        return np.asarray(np.sqrt(np.mean(self.torques**2, axis=0)))

    @property
    def peak_power(self) -> Array:
        """(actuated,) largest mechanical power, W; negative if the joint only brakes."""
        return np.asarray(np.nanmax(self.torques * self.speeds, axis=0, initial=-np.inf))

    @property
    def not_held(self) -> Array:
        """(k,) times at which no torques hold the load, s."""
        return np.asarray(self.times[np.isnan(self.torques).any(axis=1)])


def torques_along(dynamics: InverseDynamics, times: ArrayLike, q: ArrayLike) -> TrajectoryTorques:
    """Return the torques along a trajectory that is at rest at both ends.

    Velocities and accelerations of the actuated joints are central differences; those of all other joints follow from
    the loops.

    Args:
        dynamics: with the loads.
        times: (n,) s, evenly spaced, three at least.
        q: (n, nq) configurations, loops closed.

    Raises:
        ConfigurationError: q or times has a wrong shape, or times are not evenly spaced.
        ClosureError: loops are open at a time, which the message has.
        MotionError: as `InverseDynamics.torques_of`.
    """
    mechanism, at = dynamics.mechanism, np.asarray(times, dtype=float)
    configurations = np.asarray(q, dtype=float)
    if configurations.shape != (len(at), mechanism.model.nq) or len(at) < 3:
        raise ConfigurationError(
            f"a trajectory of {mechanism.name} has {mechanism.model.nq} numbers for each of three times at least, not "
            f"{configurations.shape} for {len(at)}"
        )
    period = (at[-1] - at[0]) / (len(at) - 1)
    if not period > 0.0 or np.abs(np.diff(at) - period).max() > _EVEN * period:
        raise ConfigurationError("the times of a trajectory must be evenly spaced, and increase")
    for time, configuration in zip(at, configurations, strict=True):
        gap = mechanism.closure(configuration)
        if gap > CLOSURE:
            raise dynamics.open_loops(gap, f"at {time:.4g} s ")
    columns = [mechanism.q_index(name) for name in mechanism.actuated]
    padded = np.vstack([configurations[1], configurations, configurations[-2]])[:, columns]  # at rest: mirrored
    v = (padded[2:] - padded[:-2]) / (2.0 * period)
    a = (padded[2:] - 2.0 * padded[1:-1] + padded[:-2]) / period**2
    return TrajectoryTorques(mechanism.actuated, at, dynamics.torques_of(configurations, v, a, actuated=True), v)
