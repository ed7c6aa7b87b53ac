"""The sensors of a session, and which nodes they hold."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cinegen.devices import Gamepad, ScriptedSensor, SharedSensor, Teleoperation, TwistMapping, open_sensor
from cinegen.devices.kinds import scheme
from cinegen.sensor import Reading
from cinegen.session.driven import SENSOR, Driven, Held
from cinegen.session.obstacle import is_obstacle
from cinegen.session.setup import Device, Setup
from cinegen.session.state import SensorState

Array = NDArray[np.float64]

_OF_COMMAND = {"world": "world", "base": "base", "tool": "node", "view": "view"}


class Devices:
    """Lets each sensor hold the nodes that it is switched to. It is opened when it is chosen first: its port may be
    used by something else.

    Args:
        setup: of the session.
        robots: that are driven.
        number: gives the next task its number.

    Attributes:
        chosen: which sensor holds each node; None: none. By robot and node.
        speed: at full deflection, m/s.
        turning: at full deflection, rad/s.
        frame: of command.
        view: (3, 3) axes of the view in the world: to the right, away from the viewer, up.

    Raises:
        CinegenError: a sensor that there can't be.
    """

    def __init__(self, setup: Setup, robots: dict[str, Driven], number: Callable[[], int]) -> None:
        self.robots, self._number = robots, number
        self.chosen: dict[tuple[str, str], str | None] = {(one.robot, one.node): None for one in setup.switches}
        self.speed, self.turning, self.frame, self.view = 0.1, 0.5, "world", np.eye(3)
        length = max((one.mechanism.length for one in robots.values() if not is_obstacle(one.mechanism)), default=1.0)
        self.speed = float(f"{0.3 * length:.1g}")  # the robot's own size in some three seconds
        self._devices = {device.name: device for device in setup.devices}
        self._sensors: dict[str, SharedSensor] = {}
        self._readings: dict[str, Reading] = {}
        self._holds: dict[tuple[str, str], tuple[Held, Teleoperation]] = {}
        self._aside: set[tuple[str, str]] = set()
        for device in setup.devices:
            robot = robots.get(device.robot or "")
            mechanism = robot.mechanism if robot is not None else None
            in_file = int(device.name) if device.name.isdecimal() else None
            self._sensors[device.name] = SharedSensor(open_sensor(device.url, in_file, mechanism, device.node))

    def close(self) -> None:
        """Closes them all."""
        for taps in self._sensors.values():
            taps.sensor.close()

    def choose(self, robot: str, node: str, name: str | None) -> None:
        """A sensor holds a node, from where it is; None: it is free."""
        self._let_go(robot, node)
        self.chosen[robot, node] = name
        if name is not None:
            sensor = self._sensors[name].sensor
            if scheme(sensor.url) in _SCRIPTS:
                sensor.close()  # it begins at its beginning
            sensor.start()
            self._take(robot, node, self._devices[name])

    def set_aside(self, robot: str, node: str) -> None:
        """The hand takes a node: who holds it waits; a script that leads any node of the robot is given up."""
        for (of, held), name in self.chosen.items():
            if of == robot and name is not None and scheme(self._sensors[name].sensor.url) in _SCRIPTS:
                self._let_go(of, held)
                self.chosen[of, held] = None
        if self.chosen.get((robot, node)) is not None:
            self._let_go(robot, node)
            self._aside.add((robot, node))

    def take_up(self, robot: str, node: str) -> None:
        """The hand has let go: who waited for a node holds it again, where it is."""
        name = self.chosen.get((robot, node))
        if (robot, node) in self._aside and name is not None:
            self._take(robot, node, self._devices[name])

    def give_up(self, robot: str, node: str) -> None:
        """The hand has pinned a node: who waited for it holds it no more."""
        if (robot, node) in self._aside:
            self.choose(robot, node, None)

    def give_up_scripts(self, robot: str) -> None:
        """No script leads a robot any more."""
        self.set_aside(robot, "")

    def tell_gamepad(self, twist: tuple[float, ...], buttons: frozenset[int]) -> None:
        """What a browser's gamepad says."""
        for taps in self._sensors.values():
            if isinstance(taps.sensor, Gamepad):
                x, y, z, a, b, c = twist
                taps.sensor.put((x, y, z, a, b, c), buttons)

    def advance(self, dt: float, moving: bool) -> None:
        """Reads them all, and moves on by dt (s) what they hold; nothing where `moving` is False."""
        for name, taps in self._sensors.items():
            reading = taps.read()
            if reading is not None:
                self._readings[name] = reading
        for (robot, _), (_, hold) in self._holds.items():
            one = self.robots[robot]
            turn = one.base.rotation.T
            hold.axes["world"], hold.axes["view"] = turn, turn @ self.view
            hold.frame = _OF_COMMAND[self.frame]
            hold.mapping = self._mapping(hold.mapping)
            if moving and one.motion is None:
                hold.advance(dt)
            else:
                hold.sensor.read()  # what is said meanwhile counts no more

    def states(self) -> tuple[SensorState, ...]:
        """What each is doing."""
        holds = {self.chosen[key]: hold for key, (_, hold) in self._holds.items()}
        found = []
        for name, taps in self._sensors.items():
            status = holds[name].status if name in holds else taps.sensor.status
            reading = self._readings.get(name)
            found.append(SensorState(name, status, reading.twist if reading is not None else None))
        return tuple(found)

    def _take(self, robot: str, node: str, device: Device) -> None:
        self._aside.discard((robot, node))
        one = self.robots[robot]
        sensor = self._sensors[device.name]
        rotation = device.rotation
        if isinstance(sensor.sensor, ScriptedSensor):
            rotation = sensor.sensor.path.rotation
        held = one.take(self._number(), node, SENSOR, f"sensor {device.name}", freedoms=(device.translation, rotation))
        held.scripted = scheme(device.url) in _SCRIPTS
        grip = TwistMapping(self.speed, self.turning, translation=device.translation, rotation=device.rotation)
        self._holds[robot, node] = held, Teleoperation(sensor.reader(), held.task, grip)

    def _let_go(self, robot: str, node: str) -> None:
        self._aside.discard((robot, node))
        holding = self._holds.pop((robot, node), None)
        if holding is not None:
            self.robots[robot].release(holding[0])

    def _mapping(self, grip: TwistMapping) -> TwistMapping:
        if (grip.speed, grip.turning) == (self.speed, self.turning):
            return grip
        return TwistMapping(self.speed, self.turning, translation=grip.translation, rotation=grip.rotation)


_SCRIPTS = ("path", "seam", "replay")
"""Kinds that begin when they are chosen, and that a person's hand ends."""
