"""`cinegen sensors`: the sensors of a file, possible devices of this machine, and a monitor of one sensor."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from serial.tools import list_ports

from cinegen.devices.kinds import KINDS, open_sensor, overrides, refusal, scheme, split_axes, what_is, why_missing
from cinegen.devices.reading_json import encode_header, encode_recorded
from cinegen.devices.spacenav import socket_path
from cinegen.errors import UnknownNameError
from cinegen.model.load import load_with, robots
from cinegen.sensor import NO_TWIST, Reading, Sensor, SensorError, SensorState, SensorStatus
from raff2urdf.axes import AXES, UNCHANGED, parse_axes
from raff2urdf.command.output import until_stopped
from raff2urdf.escape import one_line
from raff2urdf.readers.options import ReadOptions

Write = Callable[[str], object]

_BAR = 10  # characters of a bar, to each side
_SHOWN = 0.1  # s between two lines of the monitor
_POLL = 0.002  # s
_CLEAR = "\r\033[K"  # moves to the start of the terminal's line and clears it

# --- devices ---------------------------------------------------------------------------------------------------


def listing(
    files: Iterable[str],
    ports: Iterable[str],
    as_json: bool = False,
    ignore_loops: bool = False,
    ignore: Sequence[str] = (),
    options: ReadOptions | None = None,
) -> str:
    """Return a list of the sensors of files, and of possible devices of this machine.

    Args:
        files: files, as for `cinegen.load`.
        ports: texts such as `1=/dev/ttyUSB0` that replace ports of the files.
        as_json: JSON instead of text.
        ignore_loops: as for `cinegen.load`.
        ignore: likewise.
        options: of how the files are read.

    Raises:
        raff2urdf.RaffError: a RAFF file is invalid, or an option has no effect.
        CinegenError: a file is invalid, or a port is given for an unknown sensor.
    """
    urls, options = overrides(ports), options or ReadOptions()
    sensors_of = {file: named(file, urls, ignore_loops, ignore, options) for file in files}
    options.check(*sensors_of)
    known = {sensor["number"] for sensors in sensors_of.values() for sensor in sensors}
    for number in urls:
        if number not in known:
            raise UnknownNameError("sensor", number, tuple(map(str, sorted(known))))
    if as_json:
        return json.dumps({"files": sensors_of, "here": machine()}, indent=1, ensure_ascii=False)
    return _listed(sensors_of, machine())


def named(
    path: str | Path,
    ports: Mapping[int, str],
    ignore_loops: bool = False,
    ignore: Sequence[str] = (),
    options: ReadOptions | None = None,
) -> list[dict[str, Any]]:
    """Return the sensors of a file, with the nodes that may follow them.

    Args:
        path: file, as for `cinegen.load`.
        ports: ports that replace those of the file, by the sensor's number.
        ignore_loops: as for `cinegen.load`.
        ignore: likewise.
        options: of how the file is read.

    Raises:
        raff2urdf.RaffError: the RAFF file is invalid.
        CinegenError: the file is invalid.
    """
    path, options = Path(path), options or ReadOptions()
    mechanisms = [
        load_with(options, path, robot=robot, ignore_loops=ignore_loops, ignore=ignore) for robot in robots(path)
    ]
    entries: dict[int, dict[str, Any]] = {}
    for mechanism in mechanisms:
        for number, sensor in mechanism.sensors.items():
            address, axes = split_axes(ports.get(number, ""))
            url = address or sensor["port"]
            changed = {"port": url, "axes": axes or sensor["axes"]}
            entry = entries.setdefault(number, {**sensor, **changed, "nodes": [], "kind": what_is(url)})
            reason = "" if address else refusal(url)
            entry["missing"] = f"sensor {number}: not opened: it {reason}" if reason else why_missing(url, number)
            for node, numbers in mechanism.sensor_constraints:
                if number in numbers:
                    entry["nodes"].append(node if len(mechanisms) == 1 else f"{mechanism.name}.{node}")
    return [entries[number] for number in sorted(entries)]


def machine() -> dict[str, Any]:
    """Return the serial ports of this machine, and the spacenav daemon's socket."""
    try:
        ports = [{"port": port.device, "is": port.description} for port in sorted(list_ports.comports())]
    except Exception:  # the system's list can't be read
        ports = []
    socket = socket_path()
    return {"ports": ports, "spacenav": {"socket": socket, "present": Path(socket).exists()}}


def _listed(files: Mapping[str, list[dict[str, Any]]], devices: Mapping[str, Any]) -> str:
    lines: list[str] = []
    for name, sensors in files.items():
        lines.append(f"{name}: {len(sensors) or 'no'} sensor{'s' * (len(sensors) != 1)}")
        for sensor in sensors:
            dof = f"translation {sensor['translation']}, rotation {sensor['rotation']}"
            dof += f", axes {sensor['axes']}" * (parse_axes(sensor["axes"]) != parse_axes(UNCHANGED))
            nodes = f"for {', '.join(sensor['nodes'])}" if sensor["nodes"] else "for no node"
            lines.append(f"  {sensor['number']}: {sensor['port']} ({dof}) {nodes}")
            if sensor["kind"] is None:
                lines.append("     unknown kind of sensor")
            elif sensor["missing"]:
                lines.append(f"     {sensor['missing'].partition(': ')[2]}")
            else:
                lines.append(f"     {sensor['kind']}")
        lines.append("")
    lines.append("serial ports here:" if devices["ports"] else "serial ports here: none")
    lines += [f"  {port['port']}  {port['is']}".rstrip() for port in devices["ports"]]
    daemon = devices["spacenav"]
    lines.append(f"spacenav daemon: {'at' if daemon['present'] else 'none at'} {daemon['socket']}")
    lines += ["", "a sensor may be:", *(f"  {what}" for _, what in KINDS.values())]
    return "\n".join(lines)


# --- monitor ---------------------------------------------------------------------------------------------------


def monitor(url: str, write: Write, seconds: float | None = None, as_json: bool = False, rewrite: bool = False) -> None:
    """Show the readings of a sensor until the time is over or Ctrl-C.

    Args:
        url: URL of the sensor.
        write: function that writes a text.
        seconds: duration; unlimited unless given.
        as_json: write each reading as a line of JSON; together they are a recording.
        rewrite: rewrite one line instead of appending a line for each new reading.

    Raises:
        CinegenError: the URL is invalid.
    """
    if scheme(url) == "path":
        raise SensorError(f"'{url}': a path needs a robot: use cinegen drive")
    sensor = open_sensor(url)
    sensor.start()
    try:
        with until_stopped():
            if as_json:
                _record(sensor, write, seconds)
            else:
                _show(sensor, write, seconds, rewrite)
    finally:
        sensor.close()


def _record(sensor: Sensor, write: Write, seconds: float | None) -> None:
    write(encode_header(sensor.timeout).decode())
    begin: float | None = None
    for reading in _readings(sensor, seconds):
        if reading is not None:
            begin = reading.time if begin is None else begin
            write(encode_recorded(reading, begin).decode())


def _show(sensor: Sensor, write: Write, seconds: float | None, rewrite: bool) -> None:
    shown, last, fresh = 0.0, Reading(0.0), False
    message, packets = "", [0] * (1 + round(1.0 / _SHOWN))  # at the lines of the last second
    pressed: list[int] = []
    for reading in _readings(sensor, seconds):
        if reading is not None:
            last, fresh = reading, True
            pressed += reading.pressed
        now, status = time.monotonic(), sensor.status
        if status.message != message and status.state is not SensorState.SILENT:
            message = status.message
            write(f"{_CLEAR if rewrite else ''}{status.state.value}: {one_line(message)}\n")
        if now - shown < _SHOWN or status.state not in (SensorState.LIVE, SensorState.SILENT):
            continue
        shown = now
        packets = [*packets[1:], status.packets]
        text = _line(last, pressed, status, packets[-1] - packets[0])
        if rewrite:
            write(_CLEAR + text)
        elif fresh:
            write(f"{text}\n")
        fresh, pressed = False, []
    if rewrite:
        write("\n")


def _readings(sensor: Sensor, seconds: float | None) -> Iterable[Reading | None]:
    end = None if seconds is None else time.monotonic() + seconds
    while end is None or time.monotonic() < end:
        yield sensor.read()
        time.sleep(_POLL)


def _line(last: Reading, pressed: Iterable[int], status: SensorStatus, rate: int) -> str:
    parts = []
    if last.target is not None:
        parts.append("at " + " ".join(f"{value:+.3f}" for value in last.target.translation) + " m")
    else:
        parts += [f"{name} {bar(value)}" for name, value in zip(AXES, last.twist or NO_TWIST, strict=True)]
    down = sorted(last.buttons | set(pressed))
    parts.append(f"buttons {' '.join(map(str, down)) or '-'}")
    parts.append(f"{rate:3d}/s")
    if status.state is SensorState.SILENT:
        parts.append("silent")
    if status.damaged:
        parts.append(f"{status.damaged} damaged")
    return "  ".join(parts)


def bar(value: float) -> str:
    """Return a value from -1 to 1 as a number and a bar: `+0.50 |    :##  |`."""
    length = round(abs(value) * _BAR / 2)
    half = _BAR // 2
    left = ("#" * length if value < 0 else "").rjust(half)
    right = ("#" * length if value > 0 else "").ljust(half)
    return f"{value:+.2f} |{left}:{right}|"
