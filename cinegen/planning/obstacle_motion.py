"""`ObstacleMotion`: estimates the velocity of an obstacle from its poses, and predicts the next ones."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array


class ObstacleMotion:
    """Velocity of an obstacle, constant from one of its poses to the next, and after the last one.

    An obstacle that gets no new pose for more ticks than lay between its last two poses is at rest.

    Args:
        placement: first pose.
        tick: number of the tick at which it has this pose.
    """

    def __init__(self, placement: pin.SE3, tick: int) -> None:
        self._pose, self._tick, self._interval = placement.copy(), tick, 1
        self._linear = self._angular = np.zeros(3)

    def update(self, placement: pin.SE3, tick: int, dt: float) -> None:
        """Take over the pose at a tick of dt (s)."""
        if tick > self._tick:
            seconds, self._interval = (tick - self._tick) * dt, tick - self._tick
            self._linear = (placement.translation - self._pose.translation) / seconds
            self._angular = pin.log3(placement.rotation @ self._pose.rotation.T) / seconds
        self._pose, self._tick = placement.copy(), tick

    def twist(self, tick: int) -> tuple[Array, Array]:
        """Return the velocity (3,) of its origin, m/s, and the angular one (3,), rad/s, at a tick."""
        if tick - self._tick > self._interval + 1:
            return np.zeros(3), np.zeros(3)
        return self._linear, self._angular

    def pose(self, tick: int, seconds: float) -> pin.SE3:
        """Return the pose that it will have some seconds after a tick."""
        linear, angular = self.twist(tick)
        rotation = self._pose.rotation
        if angular.any():
            rotation = pin.exp3(angular * seconds) @ rotation
        return pin.SE3(rotation, self._pose.translation + linear * seconds)

    def velocity(self, point: Array, tick: int) -> Array:
        """Return the velocity (3,) of a point (3,) of the obstacle at a tick, m/s."""
        linear, angular = self.twist(tick)
        return np.asarray(linear + np.cross(angular, point - self._pose.translation))

    def speed(self, radius: float, tick: int) -> float:
        """Return a bound of the speed of all points within a radius (m) of its origin at a tick, m/s."""
        linear, angular = self.twist(tick)
        return float(np.linalg.norm(linear) + np.linalg.norm(angular) * radius)
