"""Trajectories in any joints that determine a mechanism, transformed to all joints or to the actuated ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cinegen import CinegenError, Mechanism
from cinegen.loops.motions import motions_of
from cinegen.model import ForwardKinematics
from cinegen_joint_states.joint_states import CompletionError

Array = NDArray[np.float64]

TOLERANCE = 1e-5
"""rad or characteristic lengths: by which the given values of passive joints may differ from closed loops."""

_RANK = 1e-6  # singular values below are zeros


@dataclass(frozen=True)
class Trajectory:
    """The content of a `trajectory_msgs/JointTrajectory`, without its times.

    Attributes:
        names: (k) of joints.
        positions: (n, k) rad and m.
        velocities: (n, k) rad/s and m/s; None if they are unknown.
        accelerations: (n, k) rad/s^2 and m/s^2; None if they are unknown.
    """

    names: tuple[str, ...]
    positions: Array
    velocities: Array | None = None
    accelerations: Array | None = None

    def of(self, names: Sequence[str]) -> Trajectory:
        """Return the part of some joints, in their order."""
        columns = [self.names.index(name) for name in names]
        velocities, accelerations = (
            None if values is None else values[:, columns] for values in (self.velocities, self.accelerations)
        )
        return Trajectory(tuple(names), self.positions[:, columns], velocities, accelerations)


def completed(
    mechanism: Mechanism, plan: Trajectory, q: Array | None = None, tolerance: float = TOLERANCE
) -> Trajectory:
    """Return a trajectory in all joints, loops closed at each point, on one branch.

    The given joints move straight from each point to the next. If all actuated joints are among them, these determine
    the motion, and the others are compared with it. Otherwise the given joints determine it: for instance the joints of
    a virtual chain to the platform, in which a planner has planned.

    Args:
        mechanism: robot.
        plan: trajectory in joints that determine the mechanism.
        q: (nq,) closed configuration from which its first point is reached; home unless given.
        tolerance: see `TOLERANCE`.

    Raises:
        CompletionError: a joint is unknown or named twice, shapes differ, the joints do not determine the mechanism,
            accelerations come without velocities, or a point can't be reached with closed loops; it names the point.
    """
    _check(mechanism, plan)
    is_actuated = set(mechanism.actuated) <= set(plan.names)
    drivers = mechanism.actuated if is_actuated else plan.names
    if not is_actuated:
        _check_drivers(mechanism, drivers)
    motion = ForwardKinematics(replace(mechanism, actuated=tuple(drivers)), q)
    driving = plan.of(drivers)
    q_indices, v_indices = (
        [index(name) for name in mechanism.joints] for index in (mechanism.q_index, mechanism.v_index)
    )
    others = [name for name in plan.names if name not in drivers]
    positions, velocities, accelerations = [], [], []
    for number, values in enumerate(driving.positions):
        try:
            closed = motion.move(dict(zip(drivers, values.tolist(), strict=True)))
            if driving.velocities is not None:
                rates = [driving.velocities[number]]
                if driving.accelerations is not None:
                    rates.append(driving.accelerations[number])
                v, a = motion.rates(*(dict(zip(drivers, rate.tolist(), strict=True)) for rate in rates))
                velocities.append(v[v_indices])
                accelerations.append(a[v_indices])
        except CinegenError as error:
            raise CompletionError(f"point {number} of the trajectory: {error}") from None
        for name in others:
            value, size = plan.positions[number, plan.names.index(name)], mechanism.scale[mechanism.v_index(name)]
            if not abs(closed[mechanism.q_index(name)] - value) <= tolerance * size:
                raise CompletionError(
                    f"point {number} of the trajectory: joint '{name}' is at {value:.6g}, but at "
                    f"{closed[mechanism.q_index(name)]:.6g} with closed loops: leave it out, or plan with closed loops"
                )
        positions.append(closed[q_indices])
    return Trajectory(
        mechanism.joints,
        np.array(positions),
        np.array(velocities) if plan.velocities is not None else None,
        np.array(accelerations) if plan.accelerations is not None else None,
    )


def _check(mechanism: Mechanism, plan: Trajectory) -> None:
    for name in plan.names:
        if name not in mechanism.joints:
            raise CompletionError(f"{mechanism.name} has no joint '{name}'; it has {', '.join(mechanism.joints)}")
    if len(set(plan.names)) < len(plan.names):
        raise CompletionError("a joint of the trajectory is named twice")
    if not len(plan.positions):
        raise CompletionError("the trajectory has no points")
    for values in (plan.positions, plan.velocities, plan.accelerations):
        if values is not None and values.shape != (len(plan.positions), len(plan.names)):
            raise CompletionError(
                f"the values of a trajectory of {len(plan.positions)} points of {len(plan.names)} joints have shape "
                f"{values.shape}"
            )
    if plan.accelerations is not None and plan.velocities is None:
        raise CompletionError("the trajectory has accelerations, but no velocities")


def _check_drivers(mechanism: Mechanism, drivers: Sequence[str]) -> None:
    """Raise CompletionError unless joints determine the actuated ones."""
    basis = motions_of(mechanism.structure.system, mechanism.structure.samples[0], mechanism.loop_rank)
    driving, actuated = (basis[[mechanism.v_index(name) for name in names]] for names in (drivers, mechanism.actuated))
    if np.linalg.matrix_rank(np.vstack([driving, actuated]), _RANK) > np.linalg.matrix_rank(driving, _RANK):
        raise CompletionError(
            f"{', '.join(drivers)} don't determine {mechanism.name}: give the actuated joints, "
            f"{', '.join(mechanism.actuated)}, or others that do"
        )
