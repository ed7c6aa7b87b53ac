"""The kinds of sensors, by the scheme of their URL."""

from __future__ import annotations

import os
import re
import secrets
import warnings
from collections.abc import Callable, Iterable, Mapping
from ipaddress import ip_address
from os.path import realpath
from pathlib import Path as File
from urllib.parse import quote, unquote

from cinegen.arrays import Array
from cinegen.devices.gamepad import Gamepad
from cinegen.devices.json_socket import JsonSocket
from cinegen.devices.replay import Replay
from cinegen.devices.scripted_path import SHAPES, ScriptedSensor, fit_path
from cinegen.devices.serial_mouse import SerialMouse
from cinegen.devices.spacenav import Spacenav
from cinegen.errors import CinegenWarning
from cinegen.model import Mechanism
from cinegen.sensor import Sensor, SensorError
from cinegen.toolpath.seam_file import open_seam
from raff2urdf.axes import UNCHANGED, parse_axes
from raff2urdf.errors import RaffError, did_you_mean, raised_as


def _serial(url: str, *_: object) -> Sensor:
    return SerialMouse(url)


_AXES = "#axes="


def split_axes(url: str) -> tuple[str, str | None]:
    """Return a sensor's URL without the axes that may follow it, `spnav:#axes=x,-z,y`, and those axes.

    Raises:
        SensorError: no such axes.
    """
    address, mark, axes = url.partition(_AXES)
    with raised_as(SensorError, RaffError, f"'{url}': "):
        parse_axes(axes if mark else UNCHANGED)
    return address, axes if mark else None


_TOKEN = re.compile(r"(tcp://[^?]*)\?(?:no-token|token=(.+))", re.IGNORECASE | re.DOTALL)


def split_token(url: str) -> tuple[str, str]:
    """Return a sensor's URL without its token, and the token that programs must send; empty if none is needed.

    The token of `tcp://127.0.0.1:7070` is that of the environment variable `CINEGEN_TOKEN`, or random.

    Raises:
        SensorError: no token, and an address that other machines reach.
    """
    if scheme(url) != "tcp":
        return url, ""
    match = _TOKEN.fullmatch(url)
    if match is None:
        return url, os.environ.get("CINEGEN_TOKEN") or secrets.token_urlsafe(16)
    if match[2] is None and _listens_for_others(url):
        raise SensorError(
            f"'{url}': other machines reach this address: a port there needs a token; leave out ?no-token"
        )
    return match[1], unquote(match[2] or "")


def join_token(url: str, token: str) -> str:
    """Return the URL whose parts `split_token` returns."""
    if scheme(url) != "tcp":
        return url
    return f"{url}?token={quote(token, safe='')}" if token else f"{url}?no-token"


def _tcp(url: str, *_: object) -> Sensor:
    address, token = split_token(url)
    match = re.fullmatch(r"tcp://(\[[0-9a-fA-F:.]+\]|[^:/?\[\]]*):(\d{1,5})/?", address, re.IGNORECASE)
    if match is None or int(match[2]) > 65535:
        raise SensorError(
            f"'{address}': write tcp://127.0.0.1:7070, an address of this machine and a port; ?token=TEXT or ?no-token "
            "may follow"
        )
    return JsonSocket(address, match[1].strip("[]") or "127.0.0.1", int(match[2]), token)


def _path(url: str, mechanism: Mechanism | None, node: str | None, q: Array | None) -> Sensor:
    shape = url.removeprefix("path:")
    if shape not in SHAPES:
        raise SensorError(f"'{url}': no path '{shape}'{did_you_mean(shape, tuple(SHAPES))}")
    if mechanism is None:
        raise SensorError(f"'{url}': a path needs a robot")
    return ScriptedSensor(fit_path(mechanism, node or mechanism.end, shape, q=q))


def _gamepad(url: str, *_: object) -> Sensor:
    if url != "gamepad:":
        raise SensorError(f"'{url}': write gamepad: for the gamepad of the browser that shows the robot")
    return Gamepad()


KINDS: Mapping[str, tuple[Callable[[str, Mechanism | None, str | None, Array | None], Sensor], str]] = {
    "": (_serial, "/dev/ttyUSB0, COM3 - a Magellan (SpaceMouse) or Spaceball on a serial port"),
    "spnav": (lambda url, *_: Spacenav(url), "spnav: - USB and wireless 3D mice, through the spacenav daemon"),
    "tcp": (_tcp, "tcp://127.0.0.1:7070 - a program that sends a token and lines of JSON"),
    "replay": (lambda url, *_: Replay(url.removeprefix("replay:")), "replay:FILE.jsonl - a recording"),
    "path": (_path, "path:circle - a script"),
    "seam": (
        lambda url, mechanism, *_: open_seam(url, mechanism),
        "seam:weld.csv?distance=10mm&speed=20mm/s - along points with normals: a weld or an inspection",
    ),
    "gamepad": (_gamepad, "gamepad: - the gamepad of the browser that shows the robot"),
    "socket": (_serial, "socket://host:port - a serial 3D mouse on another machine"),
    "rfc2217": (_serial, "rfc2217://host:port - the same, behind a serial server"),
    "hwgrep": (_serial, "hwgrep://text - the serial port whose description contains a text"),
    "spy": (_serial, "spy:///dev/ttyUSB0?file=log.txt - a serial port whose data are logged"),
    "loop": (_serial, "loop:// - a serial port that receives what it sends, for tests"),
}
"""Factory (of a URL, and the mechanism and node to move) and description of each kind, by the scheme of its URL."""


def scheme(url: str) -> str:
    """Return the scheme of a sensor's URL; empty for the name of a port."""
    match = re.match(r"([A-Za-z][A-Za-z0-9+.]+):|.+?://", url, re.DOTALL)  # two letters at least: C: is a drive
    return (match[1] or match[0].removesuffix("://")).lower() if match else ""


def open_sensor(
    url: str, number: int | None = None, mechanism: Mechanism | None = None, node: str | None = None,
    q: Array | None = None,
) -> Sensor:  # fmt: skip
    """Return a sensor by its URL, not started yet.

    A serial port that does not exist causes a warning, and so does a port that other machines reach.

    Args:
        url: name of a port, or a URL with one of the schemes of `KINDS`.
        number: number of the sensor in its file, for messages.
        mechanism: mechanism that it moves; a scripted path is fitted to it.
        node: node that it moves; the mechanism's end unless given.
        q: (nq,) configuration at the start of a scripted path; home unless given.

    Raises:
        SensorError: no such kind, or the URL is malformed.
        CinegenError: the sensor can't be constructed, such as from a damaged file.
    """
    kind = scheme(url)
    if _AXES in url:
        raise SensorError(
            f"'{url}': readings have the axes of the device: leave {_AXES}... out; TwistMapping(axes=...) and --sensor "
            "of cinegen drive change them"
        )
    if kind not in KINDS:
        raise SensorError(
            f"{_named(url, number)}: no kind of sensor '{kind}:'{did_you_mean(kind, tuple(filter(None, KINDS)))}"
        )
    sensor = KINDS[kind][0](url, mechanism, node, q)
    for warning in filter(None, (why_missing(url, number), exposure(url, number))):
        warnings.warn(warning, CinegenWarning, stacklevel=2)
    return sensor


def what_is(url: str) -> str | None:
    """Return a description of a sensor's kind by its URL; None for an unknown scheme."""
    kind = scheme(url)
    return KINDS[kind][1].partition(" - ")[2] if kind in KINDS else None


def why_missing(url: str, number: int | None = None) -> str:
    """Return a message about a serial port that does not exist, with its remedy; empty if it exists or is unknown."""
    if scheme(url) or not url.startswith("/") or File(url).exists():
        return ""
    iris = " (/dev/ttyd2 is a name from IRIX)" if re.fullmatch(r"/dev/ttyd\d+", url) else ""
    return (
        f"{_named(url, number)}: there is no such port here{iris}; "
        f"--sensor {1 if number is None else number}=/dev/ttyUSB0 names another"
    )


def exposure(url: str, number: int | None = None) -> str:
    """Return a message about a port that other machines reach, with its remedy; empty if this machine alone does."""
    if scheme(url) != "tcp" or not _listens_for_others(url):
        return ""
    return (
        f"{_named(url.partition('?')[0], number)}: every machine that reaches this port can drive the robot if it has "
        "the token, which is sent without encryption; with 127.0.0.1 only this machine can"
    )


def _named(url: str, number: int | None) -> str:
    return f"'{url}'" if number is None else f"sensor {number}, '{url}'"


def refusal(url: str) -> str:
    """Return why a sensor is not opened if only a robot's file names it; empty if it is opened.

    A file from elsewhere must not make a program read or write other files, connect to a server, or listen to other
    machines. So it may name serial ports, the spacenav daemon, scripts, the browser's gamepad, and programs on this
    machine that connect to a loopback port, with a token that it does not know.
    """
    kind = scheme(url)
    if kind in ("gamepad", "path", "hwgrep", "loop") or url == "spnav:":
        return ""
    if kind == "tcp" and "?" in url:
        return "would choose which programs can drive the robot"
    if kind == "tcp":
        return "would let other machines drive the robot" if _listens_for_others(url) else ""
    if kind == "" and any(re.fullmatch(_SERIAL_PORT, name) and ".." not in name for name in (url, realpath(url))):
        return ""
    if kind in ("socket", "rfc2217", "spnav"):
        return "would connect to a server"
    return "would open a file" if kind in ("spy", "replay") else "is not the name of a serial port"


_SERIAL_PORT = r"(?:/dev/(?:tty|cu\.|rfcomm|pts/|serial/)[\w.:/+-]*|(?:\\\\\.\\)?(?i:COM)\d+)"


def _listens_for_others(url: str) -> bool:
    """Return whether a sensor's URL opens a port that other machines reach."""
    match = re.match(r"tcp://(\[[^\]]*\]|[^:/?]*)", url, re.IGNORECASE)
    host = match[1].strip("[]") if match is not None else ""
    try:
        return bool(host) and not ip_address(host).is_loopback
    except ValueError:  # a name
        return host.lower() != "localhost"


def overrides(texts: Iterable[str]) -> dict[int, str]:
    """Return the URLs that replace those of a file, by the sensor's number, from texts such as `1=/dev/ttyUSB0`.

    Raises:
        SensorError: a text has another form.
    """
    urls = {}
    for text in texts:
        number, _, url = text.partition("=")
        if not (number.isdecimal() and url):
            raise SensorError(f"--sensor {text}: write NUMBER=URL, for example --sensor 1=/dev/ttyUSB0")
        urls[int(number)] = url
    return urls
