"""Joint states of all joints, from those of the actuated ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen import CinegenError, Mechanism
from cinegen.model import ForwardKinematics

Array = NDArray[np.float64]


class CompletionError(CinegenError):
    """A joint state or a trajectory that can't be completed."""


class JointStates(NamedTuple):
    """The content of a `sensor_msgs/JointState`.

    Attributes:
        names: (n) of joints.
        positions: (n,) rad and m.
        velocities: (n,) rad/s and m/s; (0,) if they are unknown.
    """

    names: tuple[str, ...]
    positions: Array
    velocities: Array


class JointStateCompletion:
    """Completes joint states one after the other, on one branch: the robot stays in its assembly mode.

    Joints that are passive in the mechanism, or belong to another robot, are ignored: some drivers publish a value for
    each joint of the URDF, which is 0 for those that they don't measure. An actuated joint that is not named keeps its
    last position, so the joints of one robot may be published by several drivers.

    Args:
        mechanism: robot whose joints have one variable each, as those of a URDF.
        q: (nq,) initial configuration, closed; home unless given.

    Raises:
        CompletionError: the mechanism has no actuated joints, or ball joints, which joint states can't contain.
    """

    def __init__(self, mechanism: Mechanism, q: Array | None = None) -> None:
        if not mechanism.actuated:
            raise CompletionError(f"{mechanism.name} has no actuated joints: nothing determines its configuration")
        if mechanism.balls:
            raise CompletionError(
                f"joint states have one value for each joint, but {', '.join(mechanism.balls)} of {mechanism.name} "
                "have more: convert the file with raff2urdf, and use the URDF"
            )
        self._motion = ForwardKinematics(mechanism, q)
        self.names = mechanism.joints
        self._q_indices = [mechanism.q_index(name) for name in self.names]
        self._v_indices = [mechanism.v_index(name) for name in self.names]
        self._actuated = frozenset(mechanism.actuated)

    @property
    def q(self) -> Array:
        """(nq,) present configuration, loops closed."""
        return self._motion.q

    def complete(
        self, names: Sequence[str], positions: Sequence[float], velocities: Sequence[float] = ()
    ) -> JointStates:
        """Return the states of all joints. If that fails, nothing moves.

        Args:
            names: of joints.
            positions: of each, rad or m.
            velocities: of each, rad/s or m/s; empty if they are unknown.

        Raises:
            CompletionError: names and values differ in number, a joint is named twice, or no actuated joint is named.
            CinegenError: a value is not finite, or the loops can't be closed along the motion to these positions.
        """
        count = len(names)
        if len(positions) != count or len(velocities) not in (0, count):
            raise CompletionError(
                f"{count} joints are named, with {len(positions)} positions and {len(velocities)} velocities"
            )
        if len(set(names)) < count:
            twice = next(name for i, name in enumerate(names) if name in names[:i])
            raise CompletionError(f"joint '{twice}' is named twice")
        actuated = [i for i, name in enumerate(names) if name in self._actuated]
        if not actuated:
            raise CompletionError(f"no actuated joint is named: {', '.join(sorted(self._actuated))}")
        q = self._motion.move({names[i]: float(positions[i]) for i in actuated})
        rates = np.zeros(0)
        if len(velocities) and len(actuated) == len(self._actuated):
            rates = self._motion.rates({names[i]: float(velocities[i]) for i in actuated})[0][self._v_indices]
        return JointStates(self.names, q[self._q_indices], rates)
