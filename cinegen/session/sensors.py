"""`SessionSensors`: the sensors of a session, and the nodes that follow them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from cinegen.devices import Gamepad, ScriptedSensor, Sensor, Teleoperation, TwistMapping, open_sensor
from cinegen.devices.kinds import join_token, scheme
from cinegen.devices.latest_reading import DeviceSensor
from cinegen.sensor import Reading, SensorState, TimedSensor, Twist
from cinegen.session.robot import SENSOR, DrivenRobot, UserTask
from cinegen.session.setup import Device, Setup
from cinegen.session.state import SensorReport, Settings
from raff2urdf.axes import format_axes, parse_axes

_FRAMES = {"world": "world", "base": "base", "tool": "node", "view": "view"}  # those of `Teleoperation`
_SCRIPTS = ("path", "seam", "replay")  # kinds that start when they are selected, and that a user's action ends


class SessionSensors:
    """Lets nodes follow sensors. A sensor is opened when it is first selected: another program may use its port.

    Args:
        setup: setup of the session.
        robots: robots of the session.
        new_id: returns the id of the next task.
        wake: called when a device has a new reading, by its own thread.

    Attributes:
        selected: sensor that each node follows, by robot and node; None: no sensor.
        axes: axes of each sensor, in all six entries.
        view: (3, 3) axes of the view in the world as columns: to the right, away from the viewer, up.

    Raises:
        CinegenError: a sensor does not exist.
    """

    def __init__(
        self, setup: Setup, robots: Mapping[str, DrivenRobot], new_id: Callable[[], int], wake: Callable[[], object]
    ) -> None:
        self.robots, self._new_id, self._wake = robots, new_id, wake
        self.selected: dict[tuple[str, str], str | None] = {(s.robot, s.node): None for s in setup.switches}
        self.view = np.eye(3)
        self._devices = {device.name: device for device in setup.devices}
        self.axes = {name: format_axes(parse_axes(device.axes)) for name, device in self._devices.items()}
        self._sensors: dict[str, Sensor] = {}
        self._readings: dict[str, Reading] = {}
        self._driven: dict[tuple[str, str], tuple[UserTask, Teleoperation]] = {}
        self._suspended: set[tuple[str, str]] = set()  # nodes that are dragged
        for device in setup.devices:
            self._sensors[device.name] = opened(device, robots)

    def close(self) -> None:
        """Close all sensors."""
        for sensor in self._sensors.values():
            sensor.close()

    def select(self, robot: str, node: str, name: str | None) -> None:
        """Let a node follow a sensor, from its present pose; None: no sensor."""
        self._disconnect(robot, node)
        self.selected[robot, node] = name
        if name is not None:
            sensor = self._sensors[name]
            if scheme(sensor.url) in _SCRIPTS:
                sensor.close()  # it starts anew
            self._start(sensor)
            self._connect(robot, node, self._devices[name])

    def change_axes(self, name: str, axes: str) -> None:
        """Change the axes of a sensor; the nodes that follow it go on from their present poses."""
        self.axes[name] = format_axes(parse_axes(axes))
        for key, (_, teleoperation) in self._driven.items():
            if self.selected[key] == name:
                teleoperation.mapping = replace(teleoperation.mapping, axes=self.axes[name])

    def suspend(self, robot: str, node: str) -> None:
        """Suspend the sensor of a node that is dragged, and stop the scripts of its robot."""
        self.stop_scripts(robot)
        if self.selected.get((robot, node)) is not None:
            self._disconnect(robot, node)
            self._suspended.add((robot, node))

    def resume(self, robot: str, node: str) -> None:
        """Let a node that was dragged follow its sensor again, from its present pose."""
        name = self.selected.get((robot, node))
        if (robot, node) in self._suspended and name is not None:
            self._connect(robot, node, self._devices[name])

    def deselect_suspended(self, robot: str, node: str) -> None:
        """Deselect the sensor of a node that was dragged and is pinned now."""
        if (robot, node) in self._suspended:
            self.select(robot, node, None)

    def stop_scripts(self, robot: str) -> None:
        """Stop all scripts of a robot."""
        for (owner, node), name in self.selected.items():
            if owner == robot and name is not None and scheme(self._sensors[name].url) in _SCRIPTS:
                self._disconnect(owner, node)
                self.selected[owner, node] = None
                self._sensors[name].close()

    def scripts_run(self) -> bool:
        """Return whether a node follows a script that has not ended."""
        sensors = (self._sensors[name] for name in self.selected.values() if name is not None)
        return any(scheme(sensor.url) in _SCRIPTS and sensor.status.state is SensorState.LIVE for sensor in sensors)

    def put_gamepad(self, twist: Twist, buttons: frozenset[int]) -> None:
        """Give the state of a browser's gamepad to the sensors that stand for it."""
        for sensor in self._sensors.values():
            if isinstance(sensor, Gamepad):
                sensor.put(twist, buttons)

    def advance(self, dt: float, settings: Settings, moving: bool) -> None:
        """Read all sensors, and move the targets of their nodes by dt (s), unless `moving` is False."""
        new = {name: sensor.read() for name, sensor in self._sensors.items()}
        self._readings |= {name: reading for name, reading in new.items() if reading is not None}
        speeds = settings.linear_speed, settings.angular_speed
        for key, (_, teleoperation) in self._driven.items():
            robot = self.robots[key[0]]
            rotation = robot.base.rotation.T
            teleoperation.axes["world"], teleoperation.axes["view"] = rotation, rotation @ self.view
            teleoperation.frame = _FRAMES[settings.frame]
            if settings.frame == "base":  # it may be turned in its world, or float
                base = robot.mechanism.placement(robot.solver.q, robot.mechanism.nodes[0])
                teleoperation.axes["base"] = base.rotation
            device = self._devices[self.selected[key] or ""]
            if 0 < device.translation < 3 and device.rotation in (0, 3):  # what it commands is what it constrains
                axes = {"tool": "target", "base": robot.mechanism.nodes[0]}.get(settings.frame, "world")
                if teleoperation.task.axes != axes:
                    teleoperation.task.axes = axes
            mapping = teleoperation.mapping
            if (mapping.speed, mapping.turning) != speeds:
                teleoperation.mapping = replace(mapping, speed=speeds[0], turning=speeds[1])
            if moving and robot.motion is None:  # readings during a motion have no effect later
                teleoperation.advance_by(self._in_world_of(robot, new, self.selected[key] or ""), dt)

    def _in_world_of(self, robot: DrivenRobot, readings: Mapping[str, Reading | None], name: str) -> Reading | None:
        """Return the reading of a sensor with its target in the robot's own world: programs and their recordings send
        targets in the session's world, paths and seams are in the robot's."""
        reading = readings[name]
        if reading is None or reading.target is None or not self._devices[name].has_axes:
            return reading
        return reading._replace(target=robot.base.actInv(reading.target))

    def reports(self) -> tuple[SensorReport, ...]:
        """Return the state of each sensor."""
        driving = {self.selected[key]: teleoperation for key, (_, teleoperation) in self._driven.items()}
        reports = []
        for name, sensor in self._sensors.items():
            status = (driving.get(name) or sensor).status
            reading = self._readings.get(name)
            twist = reading.twist if reading is not None else None
            axes = self.axes[name] if self._devices[name].has_axes else None
            reports.append(SensorReport(name, *status, twist, axes))
        return tuple(reports)

    def exchange(self, setup: Setup, fresh: Mapping[str, Sensor], names: Mapping[str, str]) -> list[str]:
        """Let the robots that have taken the place of others follow the sensors that those followed, as far as they
        have the nodes. Devices that both setups have stay open, and keep their axes unless the setups' differ.

        Args:
            setup: of the session with the present robots.
            fresh: sensors of that setup, not started.
            names: new names of robots by their old ones, where they differ.

        Returns:
            messages about nodes that no longer follow a sensor.
        """
        before = {(names.get(name, name), node): chosen for (name, node), chosen in self.selected.items()}
        suspended = {(names.get(name, name), node) for name, node in self._suspended}
        old, devices = self._sensors, self._devices
        self._driven.clear()
        self._suspended.clear()
        self._devices = {device.name: device for device in setup.devices}
        self.axes = {
            name: self.axes[name]
            if name in devices and devices[name].axes == d.axes and d.has_axes
            else format_axes(parse_axes(d.axes))
            for name, d in self._devices.items()
        }
        stays = {
            name
            for name, d in self._devices.items()
            if name in devices and replace(devices[name], axes=d.axes) == d and not _is_script(d)
        }
        self._sensors = {name: old[name] if name in stays else s for name, s in fresh.items()}
        self.selected = {(s.robot, s.node): None for s in setup.switches}
        choices = {(s.robot, s.node): s.choices for s in setup.switches}
        lost = [
            f"{node} no longer follows sensor {chosen}"
            for (robot, node), chosen in before.items()
            if chosen is not None and chosen not in choices.get((robot, node), ())
        ]
        for switch in setup.switches:
            key = switch.robot, switch.node
            device = before.get(key, switch.first)
            if device is None or device not in switch.choices:
                continue
            if key not in before and _is_script(self._devices[device]):
                continue
            new, was = self._sensors[device], old.get(device)
            if isinstance(new, TimedSensor) and isinstance(was, TimedSensor):
                new.go_on(was)
            elif device not in stays or key not in before:
                self._start(new)
            self.selected[key] = device
            if key in suspended:
                self._suspended.add(key)
            else:
                self._connect(*key, self._devices[device])
        for name, sensor in old.items():
            if name not in stays:
                sensor.close()
        return lost

    def _start(self, sensor: Sensor) -> None:
        sensor.start()
        if isinstance(sensor, DeviceSensor):
            sensor.newest.wake = self._wake

    def _connect(self, name: str, node: str, device: Device) -> None:
        self._suspended.discard((name, node))
        sensor = self._sensors[device.name]
        rotation = sensor.path.rotation if isinstance(sensor, ScriptedSensor) else device.rotation
        dof = device.translation, rotation
        task = self.robots[name].add_task(self._new_id(), node, SENSOR, f"sensor {device.name}", dof=dof)
        task.scripted = scheme(device.url) in _SCRIPTS
        mapping = TwistMapping(translation=device.translation, rotation=device.rotation, axes=self.axes[device.name])
        self._driven[name, node] = task, Teleoperation(sensor, task.task, mapping)

    def _disconnect(self, name: str, node: str) -> None:
        self._suspended.discard((name, node))
        driven = self._driven.pop((name, node), None)
        if driven is not None:
            self.robots[name].remove_task(driven[0])


def _is_script(device: Device) -> bool:
    return scheme(device.url) in _SCRIPTS


def opened(device: Device, robots: Mapping[str, DrivenRobot]) -> Sensor:
    """Return the sensor of a device, not started. A script is fitted to its robot's present configuration.

    Raises:
        CinegenError: there is no such sensor.
    """
    robot = robots.get(device.robot or "")
    mechanism, q = (robot.mechanism, robot.solver.q) if robot is not None else (None, None)
    number = int(device.name) if device.name.isdecimal() else None
    return open_sensor(join_token(device.url, device.token), number, mechanism, device.node, q)


def default_speed(robots: dict[str, DrivenRobot]) -> float:
    """Return the speed of sensors at full deflection, m/s: the size of the largest robot in about three seconds."""
    length = max(robot.mechanism.length for robot in robots.values())
    return float(f"{0.3 * length:.1g}")
