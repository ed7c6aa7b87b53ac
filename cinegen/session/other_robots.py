"""Robots, obstacles and sensors of a setup, made for a session."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass

from cinegen.ik import Solver
from cinegen.sensor import Sensor
from cinegen.session.avoiding import AvoidingRobot
from cinegen.session.driven_obstacle import DrivenObstacle
from cinegen.session.holding import Holding, HoldingError
from cinegen.session.robot import DrivenRobot
from cinegen.session.sensors import opened
from cinegen.session.setup import Setup


@dataclass(frozen=True)
class OtherRobots:
    """Robots, obstacles and sensors of another setup, made for a session that is to go on with them.

    Attributes:
        setup: the other setup.
        edition: its number.
        robots: robots by name.
        obstacles: obstacles by name.
        sensors: sensors by name, not started.
    """

    setup: Setup
    edition: int
    robots: Mapping[str, DrivenRobot]
    obstacles: Mapping[str, DrivenObstacle]
    sensors: Mapping[str, Sensor]

    @classmethod
    def of(cls, setup: Setup, edition: int) -> OtherRobots:
        """Return those of a setup; this may take a second.

        Raises:
            CinegenError: they can't be driven.
        """
        dt = 1.0 / setup.rate
        robots = driven_robots(setup, dt)
        sensors = {device.name: opened(device, robots) for device in setup.devices}
        for robot in robots.values():  # what is made at the first closure is not made in a tick
            robot.succeed(robot)
        return cls(setup, edition, robots, driven_obstacles(setup, dt), sensors)


def driven_obstacles(setup: Setup, dt: float) -> dict[str, DrivenObstacle]:
    """Return the obstacles of a setup by name, for a period of ticks (s)."""
    return {name: DrivenObstacle(name, drawn, dt) for name, drawn in setup.obstacles.items()}


def driven_robots(setup: Setup, dt: float) -> dict[str, DrivenRobot]:
    """Return the robots of a setup by name, for a period of ticks (s)."""
    robots: dict[str, DrivenRobot] = {}
    for name, mechanism in setup.robots.items():
        if setup.avoidance is not None and setup.avoidance.robot == name:
            robots[name] = AvoidingRobot(name, setup.avoidance.scene, tuple(setup.obstacles), dt)
        else:
            robots[name] = DrivenRobot(name, Solver(mechanism, dt, setup.start(name)))
        for joint in setup.locked.get(name, ()):
            robots[name].lock(joint, True)
        with contextlib.suppress(HoldingError):  # without masses there are no torques
            robots[name].holding = Holding(mechanism)
    return robots
