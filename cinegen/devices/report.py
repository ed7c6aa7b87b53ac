"""`cinegen sensors`: which sensors a file names, what could be one here, and what one says."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from serial.tools import list_ports

from cinegen.devices.kinds import KINDS, open_sensor, overrides, scheme, what_is, why_missing
from cinegen.devices.record import header, line
from cinegen.devices.spacenav import socket_path
from cinegen.errors import UnknownNameError
from cinegen.model.load import load, robots
from cinegen.sensor import NO_TWIST, Reading, Sensor, SensorError, SensorState, SensorStatus

Say = Callable[[str], object]

_AXES = ("x", "y", "z", "rx", "ry", "rz")
_BAR = 10  # characters of a bar, to each side
_SHOWN = 0.1  # s between two lines of a monitor
_POLL = 0.002  # s
_CLEAR = "\r\033[K"  # goes to the beginning of the terminal's line and empties it

# --- what there is ---------------------------------------------------------------------------------------------------


def listing(files: Iterable[str], ports: Iterable[str], as_json: bool = False, ignore_loops: bool = False) -> str:
    """The sensors that files name, and what could be one here.

    Args:
        files: as for `cinegen.load`.
        ports: that stand in place of the files', as texts such as `1=/dev/ttyUSB0`.
        as_json: for programs, else for people.
        ignore_loops: as for `cinegen.load`.

    Raises:
        raff2urdf.RaffError: a file is wrong.
        CinegenError: a file is wrong, or a port is of a sensor that no file names.
    """
    given = overrides(ports)
    found = {file: named(file, given, ignore_loops) for file in files}
    known = {sensor["number"] for sensors in found.values() for sensor in sensors}
    for number in given:
        if number not in known:
            raise UnknownNameError("sensor", number, tuple(map(str, sorted(known))))
    if as_json:
        return json.dumps({"files": found, "here": here()}, indent=1, ensure_ascii=False)
    return _listed(found, here())


def named(path: str | Path, ports: Mapping[int, str], ignore_loops: bool = False) -> list[dict[str, Any]]:
    """The sensors that a file names, with the nodes that may follow them.

    Args:
        path: as for `cinegen.load`.
        ports: that stand in place of the file's, by the sensor's number.
        ignore_loops: as for `cinegen.load`.

    Raises:
        raff2urdf.RaffError: the file is wrong.
        CinegenError: the file is wrong.
    """
    mechanisms = [load(path, robot, ignore_loops=ignore_loops) for robot in robots(path)]
    found: dict[int, dict[str, Any]] = {}
    for mechanism in mechanisms:
        for number, sensor in mechanism.sensors.items():
            url = ports.get(number, sensor["port"])
            entry = found.setdefault(number, {**sensor, "port": url, "nodes": [], "kind": what_is(url)})
            entry["missing"] = why_missing(url, number)
            for node, numbers in mechanism.sensor_constraints:
                if number in numbers:
                    entry["nodes"].append(node if len(mechanisms) == 1 else f"{mechanism.name}.{node}")
    return [found[number] for number in sorted(found)]


def here() -> dict[str, Any]:
    """What could be a sensor on this machine: its serial ports, and the spacenav daemon."""
    try:
        ports = [{"port": port.device, "is": port.description} for port in sorted(list_ports.comports())]
    except Exception:  # of systems whose list can't be read
        ports = []
    socket = socket_path()
    return {"ports": ports, "spacenav": {"socket": socket, "present": Path(socket).exists()}}


def _listed(files: Mapping[str, list[dict[str, Any]]], found: Mapping[str, Any]) -> str:
    lines: list[str] = []
    for name, sensors in files.items():
        lines.append(f"{name}: {len(sensors) or 'no'} sensor{'s' * (len(sensors) != 1)}")
        for sensor in sensors:
            freedoms = f"translation {sensor['translation']}, rotation {sensor['rotation']}"
            nodes = f"for {', '.join(sensor['nodes'])}" if sensor["nodes"] else "for no node"
            lines.append(f"  {sensor['number']}: {sensor['port']} ({freedoms}) {nodes}")
            if sensor["kind"] is None:
                lines.append("     no kind of sensor begins so")
            elif sensor["missing"]:
                lines.append(f"     {sensor['missing'].partition(': ')[2]}")
            else:
                lines.append(f"     {sensor['kind']}")
        lines.append("")
    lines.append("serial ports here:" if found["ports"] else "serial ports here: none")
    lines += [f"  {port['port']}  {port['is']}".rstrip() for port in found["ports"]]
    daemon = found["spacenav"]
    lines.append(f"spacenav daemon: {'at' if daemon['present'] else 'none at'} {daemon['socket']}")
    lines += ["", "a sensor may be:", *(f"  {what}" for _, what in KINDS.values())]
    return "\n".join(lines)


# --- what one says ---------------------------------------------------------------------------------------------------


def monitor(url: str, say: Say, seconds: float | None = None, as_json: bool = False, rewrite: bool = False) -> None:
    """Shows what a sensor says, until the time is over; returns on Ctrl-C.

    Args:
        url: of the sensor.
        say: takes texts.
        seconds: how long; for ever unless given.
        as_json: every reading as a line, and together a recording that can be replayed.
        rewrite: one line is written over and over, instead of one below the other where something is new.

    Raises:
        CinegenError: there can be no such sensor.
    """
    if scheme(url) == "path":
        raise SensorError(f"'{url}': a path needs a robot: cinegen drive shows it")
    sensor = open_sensor(url)
    sensor.start()
    try:
        if as_json:
            _tell(sensor, say, seconds)
        else:
            _show(sensor, say, seconds, rewrite)
    except KeyboardInterrupt:
        pass
    finally:
        sensor.close()


def _tell(sensor: Sensor, say: Say, seconds: float | None) -> None:
    say(json.dumps(header(sensor.timeout)) + "\n")
    begin: float | None = None
    for reading in _readings(sensor, seconds):
        if reading is not None:
            begin = reading.time if begin is None else begin
            say(json.dumps(line(reading, begin)) + "\n")


def _show(sensor: Sensor, say: Say, seconds: float | None, rewrite: bool) -> None:
    shown, last, fresh = 0.0, Reading(0.0), False
    words, rate = "", _Rate()
    pressed: list[int] = []
    for reading in _readings(sensor, seconds):
        if reading is not None:
            last, fresh = reading, True
            pressed += reading.pressed
        now, status = time.monotonic(), sensor.status
        if status.words != words and status.state is not SensorState.SILENT:
            words = status.words
            say(f"{_CLEAR if rewrite else ''}{status.state.value}: {words}\n")
        if now - shown < _SHOWN or status.state not in (SensorState.LIVE, SensorState.SILENT):
            continue
        shown = now
        text = _line(last, pressed, status, rate.of(status.packets, now))
        if rewrite:
            say(_CLEAR + text)
        elif fresh:
            say(f"{text}\n")
        fresh, pressed = False, []
    if rewrite:
        say("\n")


def _readings(sensor: Sensor, seconds: float | None) -> Iterable[Reading | None]:
    end = None if seconds is None else time.monotonic() + seconds
    while end is None or time.monotonic() < end:
        yield sensor.read()
        time.sleep(_POLL)


class _Rate:
    """Packets per second, over the last second or so."""

    def __init__(self) -> None:
        self._before: list[tuple[float, int]] = []

    def of(self, packets: int, now: float) -> float:
        """The rate, when there were so many by now (s)."""
        self._before = [(then, count) for then, count in self._before if now - then < 1.0] + [(now, packets)]
        then, count = self._before[0]
        return (packets - count) / (now - then) if now > then else 0.0


def _line(last: Reading, pressed: Iterable[int], status: SensorStatus, rate: float) -> str:
    parts = []
    if last.target is not None:
        parts.append("at " + " ".join(f"{value:+.3f}" for value in last.target.translation) + " m")
    else:
        parts += [f"{name} {bar(value)}" for name, value in zip(_AXES, last.twist or NO_TWIST, strict=True)]
    down = sorted(last.buttons | set(pressed))
    parts.append(f"buttons {' '.join(map(str, down)) or '-'}")
    parts.append(f"{rate:3.0f}/s")
    if status.state is SensorState.SILENT:
        parts.append("silent")
    if status.damaged:
        parts.append(f"{status.damaged} damaged")
    return "  ".join(parts)


def bar(value: float) -> str:
    """A value from -1 to 1 as a number and a bar: `+0.50 |    :##  |`."""
    length = round(abs(value) * _BAR / 2)
    half = _BAR // 2
    left = ("#" * length if value < 0 else "").rjust(half)
    right = ("#" * length if value > 0 else "").ljust(half)
    return f"{value:+.2f} |{left}:{right}|"
