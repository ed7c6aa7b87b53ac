"""`arrange`: the setup of robots with the sensors that their files name, base poses and other sensors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.devices.kinds import exposure, overrides, refusal, split_axes, split_token, why_missing
from cinegen.errors import UnknownNameError, warn
from cinegen.mission import BasePose
from cinegen.model import Mechanism
from cinegen.model.plausible import FAR, reach
from cinegen.session.regular_start import regular_start
from cinegen.session.setup import GAMEPAD, PATH, RATE, Device, SensorSwitch, Setup, SetupError
from raff2urdf.axes import UNCHANGED
from raff2urdf.quantities import ANGLE, LENGTH, parse_list, refused_as, shown

_ROOM = 0.3  # characteristic lengths, around robots that are placed side by side


def arrange(
    robots: Mapping[str, Mechanism],
    files: Mapping[str, str] | None = None,
    sensors: Sequence[str] = (),
    follow: str | None = None,
    node: str | None = None,
    bases: Iterable[str] = (),
    rate: float = RATE,
    record: str | None = None,
) -> Setup:
    """Return the setup of robots with the sensors that their files name, and others.

    Args:
        robots: robots by name.
        files: file of each robot; all from one unless given. Sensors are numbered by file, and robots of several files
            are placed side by side.
        sensors: texts such as `1=/dev/ttyUSB0`, another port for the files' sensor 1; or `NODE=URL`, `ROBOT.NODE=URL`,
            a sensor that a node follows. `#axes=x,-z,y` may follow the URL, or replace it for a file's sensor.
        follow: shape of the path that each robot's end, or `node`, follows until a user drags the robot.
        node: node that follows it.
        bases: texts as `parse_base_pose` reads them.
        rate: ticks per second.
        record: file in which the session is recorded.

    Raises:
        SetupError: the sensors or base poses are not valid for these robots.
        UnknownNameError: there is no such node or robot.
    """
    files = files or dict.fromkeys(robots, "")
    numbered, named = _split(sensors)
    several = len(set(files.values())) > 1
    devices, switches, used = dict[str, Device](), list[SensorSwitch](), set[int]()
    for name, mechanism in robots.items():
        choices = _Choices(name, mechanism, devices)
        used |= choices.add_declared(numbered, f"{files[name]} " if several else "")
        choices.add_named(named)
        if follow is not None:
            choices.add_path(follow, node or mechanism.end, f"{PATH} {name}" if len(robots) > 1 else PATH)
        switches += choices.switches()
    _all_used(robots, numbered, used, named)
    devices[GAMEPAD] = Device(GAMEPAD, "gamepad:")
    placed = base_poses(robots, files, bases)
    starts = {name: regular_start(mechanism) for name, mechanism in robots.items()} if follow is not None else {}
    return Setup(dict(robots), placed, tuple(devices.values()), tuple(switches), rate, record, starts=starts)


class _Choices:
    """Sensors that the nodes of a robot may follow.

    Args:
        robot: name of the robot.
        mechanism: the robot.
        devices: sensors of the session by name, to which the robot's are added.
    """

    def __init__(self, robot: str, mechanism: Mechanism, devices: dict[str, Device]) -> None:
        self._robot, self._mechanism, self._devices = robot, mechanism, devices
        self._ids: dict[str, list[str | None]] = {}  # of each node that may follow one
        self._first: dict[str, str] = {}  # that nodes follow, where it is not the first of these

    def add_declared(self, numbered: Mapping[int, str], prefix: str) -> set[int]:
        """Add the sensors that the robot's file declares; return their numbers.

        Args:
            numbered: URLs and axes that replace theirs, by number.
            prefix: of their names.
        """
        used = set[int]()
        for node, numbers in self._mechanism.sensor_constraints:
            for number in numbers:
                entry = self._mechanism.sensors.get(number)
                if number == 0:
                    self._ids.setdefault(node, []).append(None)
                elif entry is not None:
                    used.add(number)
                    label = f"{prefix}{number}"
                    self._add_port(label, number, entry, numbered.get(number, ""))
                    self._ids.setdefault(node, []).append(label)
                    if number in numbered:
                        self._first[node] = label
        return used

    def _add_port(self, label: str, number: int, entry: Mapping[str, Any], replaced: str) -> None:
        """Add the device of a sensor of the file; `replaced` is another URL, other axes, or both."""
        url, axes = split_axes(replaced)
        if not url and (reason := refusal(entry["port"])):
            raise SetupError(
                f"{self._robot}: the file's sensor {number}, {entry['port']!r}, {reason}. If that is wanted, give "
                f"--sensor {number}={entry['port']}; else name another one, such as "
                f"--sensor {number}=tcp://127.0.0.1:7070"
            )
        dof = entry["translation"], entry["rotation"]
        device = _device(label, url or entry["port"], number, *dof, axes=axes or entry["axes"])
        self._devices.setdefault(label, device)

    def add_named(self, named: Iterable[tuple[str, str]]) -> None:
        """Add sensors for the robot's nodes among `NODE` or `ROBOT.NODE` with a URL each."""
        for text, address in named:
            robot, _, node = text.rpartition(".") if text not in self._mechanism.nodes else ("", "", text)
            if robot in ("", self._robot) and node in self._mechanism.nodes:
                url, axes = split_axes(address)
                label = _free(node, self._devices)
                self._devices[label] = _device(label, url, None, 3, 3, self._robot, node, axes or UNCHANGED)
                self._ids.setdefault(node, [None]).append(label)
                self._first[node] = label

    def add_path(self, shape: str, node: str, label: str) -> None:
        """Add the path that a node follows, unless the file states what it follows."""
        self._mechanism.frame_id(node)
        self._devices[label] = _device(label, f"path:{shape}", None, 3, 3, self._robot, node)
        self._ids.setdefault(node, [None]).append(label)
        if self._ids[node][0] is None:
            self._first.setdefault(node, label)

    def switches(self) -> Iterator[SensorSwitch]:
        """Yield the nodes that may follow sensors, the end of the robot among them."""
        self._ids.setdefault(self._mechanism.end, [None])
        for node, ids in self._ids.items():
            choices = tuple(dict.fromkeys([*ids, GAMEPAD]))
            yield SensorSwitch(self._robot, node, choices, self._first.get(node, ids[0]))


def parse_base_pose(text: str) -> tuple[str, BasePose]:
    """Parse the base pose of a robot: `NAME=ROBOT.NODE`, `NAME=x,y,z`, `NAME=x,y,z,roll,pitch,yaw` (m, degrees), or
    `NAME=ROBOT.NODE@x,y,z...` for a placement in the frame of a node.

    Raises:
        SetupError: the text has another form.
    """
    name, equals, pose = text.partition("=")
    on, at, numbers = pose.partition("@")
    if not at and "," in on:
        on, numbers = "", on
    robot, _, node = on.rpartition(".")
    values = numbers.split(",") if numbers or at else []
    if not (name and equals) or len(values) not in (0, 3, 6) or not (on or values) or (on and not (robot and node)):
        raise SetupError(
            f"--base {text}: write NAME=ROBOT.NODE, NAME=x,y,z[,roll,pitch,yaw] (m and degrees) or "
            "NAME=ROBOT.NODE@x,y,z..., for example --base wrist=delta4.platform"
        )
    placement = pin.SE3.Identity()
    if values:
        with refused_as(SetupError, f"--base {text}"):
            point, angles = parse_list(values[:3], LENGTH), parse_list(values[3:], ANGLE) or [0.0, 0.0, 0.0]
        placement = pin.SE3(pin.rpy.rpyToMatrix(np.array(angles)), np.array(point))
    return name, BasePose(robot or None, node or None, placement)


def base_poses(robots: Mapping[str, Mechanism], files: Mapping[str, str], bases: Iterable[str]) -> dict[str, BasePose]:
    """Return the base poses of robots that are not in the world's origin.

    Args:
        robots: robots by name.
        files: file of each; robots of several files are placed side by side.
        bases: texts as `parse_base_pose` reads them.

    Raises:
        SetupError: a text is none, or means a pose out of reach that would be near in mm.
    """
    parsed = dict(map(parse_base_pose, bases))
    most = FAR * sum(map(reach, robots.values()))
    for name, base in parsed.items():
        far = float(np.abs(base.placement.translation).max())
        if most < far <= 1000.0 * most:
            raise SetupError(
                f"--base {name}: {shown(far, LENGTH)} is far beyond the reach of all robots: did you mean {far:g} mm?"
            )
    return _side_by_side(robots, files) | parsed


def _side_by_side(robots: Mapping[str, Mechanism], files: Mapping[str, str]) -> dict[str, BasePose]:
    """Return base poses that move the robots of each file along x, to the right of those before, if they overlap."""
    bases: dict[str, BasePose] = {}
    edge = -np.inf
    for file in dict.fromkeys(files[name] for name in robots):
        names = [name for name in robots if files[name] == file]
        nodes = [robots[name].placement(robots[name].q_home, node) for name in names for node in robots[name].nodes]
        room = _ROOM * max(robots[name].length for name in names)
        left, right = (pick(float(node.translation[0]) for node in nodes) for pick in (min, max))
        shift = max(0.0, edge + room - left) if edge > -np.inf else 0.0
        if shift > 0.0:
            bases |= {name: BasePose(placement=pin.SE3(np.eye(3), np.array([shift, 0.0, 0.0]))) for name in names}
        edge = right + shift + room
    return bases


def _split(texts: Sequence[str]) -> tuple[dict[int, str], list[tuple[str, str]]]:
    """Return the URLs that replace those of the files' sensors, by number, and nodes with URLs of their own."""
    numbered = overrides(text for text in texts if text.partition("=")[0].isdecimal())
    others = []
    for text in texts:
        node, _, url = text.partition("=")
        if not node or not (url if node.isdecimal() else split_axes(url)[0]):
            raise SetupError(
                f"--sensor {text}: write NUMBER=URL for a sensor of the file, or NODE=URL for one that a node follows, "
                "for example --sensor 1=/dev/ttyUSB0"
            )
        if not node.isdecimal():
            others.append((node, url))
    return numbered, others


def _device(
    name: str, url: str, number: int | None, translation: int, rotation: int, robot: str | None = None, node: str = "",
    axes: str = UNCHANGED,
) -> Device:  # fmt: skip
    """Return a sensor, with a warning if its port does not exist, or if other machines reach it."""
    address, token = split_token(url)
    for warning in filter(None, (why_missing(url, number), exposure(url, number))):
        warn(warning)
    device = Device(name, address, translation, rotation, robot, node or None, token, axes)
    if axes != UNCHANGED and not device.has_axes:
        raise SetupError(
            f"sensor {name}, '{address}', sends targets, which have no axes to change: remove axes '{axes}'"
        )
    return device


def _free(label: str, taken: Mapping[str, object]) -> str:
    while label in taken:
        label += "'"
    return label


def _all_used(
    robots: Mapping[str, Mechanism], numbered: Mapping[int, str], used: set[int], others: Sequence[tuple[str, str]]
) -> None:
    """Refuse options that have no effect."""
    for number in numbered:
        if number not in used:
            known = ", ".join(map(str, sorted(used))) or "none"
            raise SetupError(
                f"--sensor {number}=...: no node of these files may follow a sensor {number} (sensors there: {known}); "
                "NODE=URL lets any node follow a sensor"
            )
    for text, _ in others:
        robot, _, node = text.rpartition(".")
        nodes = {node for mechanism in robots.values() for node in mechanism.nodes}
        if text not in nodes and not (robot in robots and node in robots[robot].nodes):
            if robot in robots:
                raise UnknownNameError("node", node, robots[robot].nodes)
            raise UnknownNameError("node", text, tuple(sorted(nodes)))
