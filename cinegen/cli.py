"""The command `cinegen`."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
import warnings
import webbrowser
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raff2urdf.errors import RaffError

if TYPE_CHECKING:
    from cinegen.model import Mechanism

_UNATTENDED = 10.0  # s: how long a robot moves where nobody can press Ctrl-C


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit code: 0, or 1 where something is wrong."""
    parser = argparse.ArgumentParser(prog="cinegen", description="Drive, study and show any mechanism.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    info = commands.add_parser("info", help="what a mechanism is: joints, loops, mobility, singular values")
    _of_files(info)
    info.add_argument("--json", action="store_true", help="as JSON")
    info.set_defaults(run=_info)

    drive = commands.add_parser("drive", help="move a mechanism in a page")
    _of_files(drive)
    drive.add_argument(
        "--follow", default="circle", choices=["circle", "figure8", "line", "still"],
        help="the path its end follows, as large as fits into the workspace (%(default)s); still: none",
    )  # fmt: skip
    drive.add_argument("--node", metavar="NAME", help="which node follows it (its sensor's, or the last in the file)")
    drive.add_argument("--seconds", type=_seconds, metavar="S", help="stop after so long (at Ctrl-C)")
    drive.add_argument(
        "--snapshot", metavar="FILE.html",
        help="write a page that needs no server: at once, or after --seconds of motion",
    )  # fmt: skip
    drive.add_argument("--port", type=int, default=7000, help="first port to try (%(default)s)")
    drive.add_argument("--no-browser", action="store_true", help="only print the page's address")
    drive.set_defaults(run=_drive)

    close = commands.add_parser(
        "close", help="a filter: values of actuated joints in, values of all joints out, loops closed",
        description="Reads lines such as {\"joint1\": 0.1} from its input (rad, m) and answers each with a line of all "
        "joints, on the same branch as the line before; the first begins at home. Joints that are not named stay. What "
        "can't be is answered by {\"error\": \"...\"}, and moves nothing.",
    )  # fmt: skip
    _of_files(close, several=False)
    close.add_argument("--start", metavar="FILE", help="begin where an answer says, kept in a file, instead of at home")
    close.set_defaults(run=_close)

    sensors = commands.add_parser(
        "sensors", help="which sensors a file names and what could be one here; watch one",
        description="Lists the sensors that files name, the serial ports of this machine, and what else may be a "
        "sensor. With --monitor, shows what one says until Ctrl-C.",
    )  # fmt: skip
    sensors.add_argument("files", nargs="*", metavar="FILE", help="RAFF file, URDF, SDF or MJCF")
    sensors.add_argument(
        "--sensor", action="append", default=[], metavar="N=URL", help="another port for the files' sensor N"
    )
    sensors.add_argument("--monitor", metavar="URL", help="show what this one says: a port or a URL")
    sensors.add_argument("--seconds", type=_seconds, metavar="S", help="stop after so long (at Ctrl-C)")
    sensors.add_argument("--json", action="store_true", help="as JSON; with --monitor, a recording")
    sensors.set_defaults(run=_sensors)

    options = parser.parse_args(arguments)
    from cinegen.errors import CinegenError

    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        try:
            code: int = options.run(options)
            sys.stdout.flush()
        except (RaffError, CinegenError) as error:
            print(f"cinegen: {error}", file=sys.stderr)
            return 1
        except BrokenPipeError:  # whoever reads has seen enough: `cinegen info x.raff | head -1`
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 1
    return code


def _of_files(parser: argparse.ArgumentParser, several: bool = True) -> None:
    count = "+" if several else 1
    parser.add_argument("files", nargs=count, metavar="FILE", help="RAFF file, URDF, SDF or MJCF")
    parser.add_argument("--robot", metavar="NAME", help="only the robot of this name")
    parser.add_argument(
        "--loop", action="append", default=[], metavar="NAME=KIND",
        help="close a loop as rigid, prismatic, revolute or ball, whatever the file says",
    )  # fmt: skip


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value < 1e9:
        raise argparse.ArgumentTypeError(f"'{text}' is no time in seconds")
    return value


def _mechanisms(options: argparse.Namespace) -> dict[str, Mechanism]:
    """All robots of all files, by a name that is theirs alone."""
    from cinegen.errors import CinegenError
    from cinegen.model.load import load, robots

    loops = {}
    for text in options.loop:
        name, equals, kind = text.rpartition("=")
        if not equals:
            raise CinegenError(f"--loop {text}: write NAME=KIND, for example --loop link5-link11=ball")
        loops[name] = kind
    found: dict[str, Mechanism] = {}
    for file in options.files:
        path = Path(file)
        wanted = robots(path) if options.robot is None else [options.robot]
        for robot in wanted:
            mechanism = load(path, robot, loops)
            name = path.stem if len(wanted) == 1 else f"{path.stem}.{mechanism.name}"
            while name in found:
                name += "'"
            found[name] = mechanism
    return found


# --- info --------------------------------------------------------------------------------------------------------


def _info(options: argparse.Namespace) -> int:
    from cinegen.model.description import describe

    reports = [{"name": name, **describe(mechanism)} for name, mechanism in _mechanisms(options).items()]
    if options.json:
        print(json.dumps(reports, indent=1, ensure_ascii=False))
    else:
        print("\n\n".join(_described(report) for report in reports))
    return 0


def _described(report: Mapping[str, Any]) -> str:
    actuated, joints, loops = report["actuated"], report["joints"], report["loops"]
    undriven = f" ({report['undriven']} driven by no motor)" if report["undriven"] else ""
    lines = [
        f"{report['name']}: robot '{report['robot']}', mobility {report['mobility']}{undriven}, "
        f"{_count(joints, 'joint')} ({len(actuated)} actuated), {_count(loops, 'loop')}",
        "",
        f"  {'joint':<12}{'type':<11}{'home':>10}{'low':>10}{'high':>10}{'velocity':>10}   (rad, m)",
    ]
    for joint in joints:
        numbers = [joint["home"], joint["low"], joint["high"], joint["velocity"]]
        cells = "".join(f"{'-' if value is None else f'{_quiet(value):.4g}':>10}" for value in numbers)
        motor = "actuated" if joint["actuated"] else ""
        lines.append(f"  {joint['name']:<12}{joint['type']:<11}{cells}   {motor}".rstrip())
    if loops:
        lines += ["", f"  loops: {report['loop_rows']} rows of rank {report['loop_rank']}"]
        lines += [f"    {loop['name']}: {loop['kind']}" for loop in loops]
        gaps = report["gap_as_written"], report["closure_at_home"]
        lines.append("    open as written by {:.2g}, at home by {:.2g}".format(*gaps))
        lines.append(f"    singular values at home: {_values(report['loop_singular_values'])}")
    lines += ["", f"  {report['end']} at home: singular values {_values(report['end_singular_values'])}"]
    length = report["characteristic_length"]
    lines.append(f"  (without unit: lengths divided by the characteristic length, {length:.4g} m)")
    return "\n".join(lines)


def _values(sigma: Sequence[float]) -> str:
    return " ".join(f"{_quiet(value):.3g}" for value in sigma)


def _quiet(value: float) -> float:
    """Rounding is not worth reading."""
    return value if abs(value) > 1e-12 else 0.0


def _count(things: Sequence[Any], name: str) -> str:
    return f"{len(things)} {name}{'s' * (len(things) != 1)}"


# --- drive -------------------------------------------------------------------------------------------------------


def _drive(options: argparse.Namespace) -> int:
    mechanisms = _mechanisms(options)
    from cinegen.show import Driven, drive, page_of

    for name, mechanism in mechanisms.items():
        said = f"{name}: {_count(mechanism.joints, 'joint')}, {_count(mechanism.loops, 'loop')}"
        said += f", mobility {mechanism.mobility}"
        print(f"{said}, loops closed to {mechanism.closure(mechanism.q_home):.1g}" if mechanism.loops else said)
    page, scene = page_of(mechanisms)
    if options.snapshot and options.seconds is None:
        _write(Path(options.snapshot), page.html())
        return 0
    attended = sys.stdin is not None and sys.stdin.isatty()
    seconds, snapshot = options.seconds, options.snapshot
    if seconds is None and not attended:
        seconds, snapshot = _UNATTENDED, f"{Path(options.files[0]).stem}.html"
    driven = {
        name: Driven.still(mechanism)
        if options.follow == "still"
        else Driven.along(mechanism, options.follow, options.node)
        for name, mechanism in mechanisms.items()
    }
    for name, one in driven.items():
        if one.path is not None:
            print(f"{name}: {one.path.node} follows a {one.path.shape} of {one.path.size:.3g} m")
    url = page.serve(options.port)
    print(f"page: {url}", "- Ctrl-C ends" if seconds is None else f"- for {seconds:g} s", flush=True)
    if not options.no_browser and _has_screen():
        webbrowser.open(url)
    drive(scene, driven, seconds, _say if sys.stderr.isatty() else None)
    worst = max((one.step.closure for one in driven.values() if one.step is not None), default=0.0)
    print(f"stopped; loops closed to {worst:.1g}")
    if snapshot:
        _write(Path(snapshot), page.html())
    return 0


def _has_screen() -> bool:
    """Whether a browser can open a window here (a text browser would take the terminal instead)."""
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _say(seconds: float, driven: Mapping[str, Any]) -> None:
    said = ", ".join(
        f"{name}: {one.step.verdict.name.lower().replace('_', ' ')}, closure {one.step.closure:.0e}"
        for name, one in driven.items()
    )
    print(f"\r{seconds:5.0f} s  {said[:110]:<110}", end="", file=sys.stderr, flush=True)


def _write(path: Path, text: str) -> None:
    from cinegen.errors import CinegenError

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CinegenError(f"{path}: can't be written: {error.strerror}") from None
    print(f"page without a server: {path.resolve()}")


# --- close -------------------------------------------------------------------------------------------------------


def _close(options: argparse.Namespace) -> int:
    from cinegen.errors import CinegenError

    mechanisms = _mechanisms(options)
    if len(mechanisms) != 1:
        names = ", ".join(mechanism.name for mechanism in mechanisms.values())
        raise CinegenError(f"{options.files[0]} holds several robots: name one by --robot ({names})")
    (mechanism,) = mechanisms.values()
    from cinegen.model import ForwardKinematics
    from cinegen.sense import Lines, start_from

    motion = ForwardKinematics(mechanism) if options.start is None else start_from(mechanism, _read(options.start))
    if sys.stdin is not None:
        with contextlib.suppress(KeyboardInterrupt):
            Lines(motion).serve(sys.stdin.buffer, _say_at_once)
    return 0


# --- sensors -----------------------------------------------------------------------------------------------------


def _sensors(options: argparse.Namespace) -> int:
    from cinegen.sense import report

    if options.monitor:
        rewrite = sys.stdout.isatty() and not options.json
        report.monitor(options.monitor, _say_at_once, options.seconds, options.json, rewrite)
        return 0
    print(report.listing(options.files, options.sensor, options.json))
    return 0


def _say_at_once(text: str) -> None:
    sys.stdout.write(text)
    sys.stdout.flush()


def _read(file: str) -> str:
    from cinegen.errors import CinegenError

    try:
        return Path(file).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CinegenError(f"{file}: can't be read: {error}") from None


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    print(f"warning: {message}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
