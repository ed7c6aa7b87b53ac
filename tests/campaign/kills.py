"""Kill commands that write at random moments, or let their disk be full. What is on the disk afterwards is whole: the
old file, or the new one, or what the same command resumes. Then the same command succeeds, and removes what was left.
No process stays behind, and a full disk is told in a sentence.

A command runs once up to its first change of the disk. There it stays, and each case is a fork of it: a case takes as
long as the command writes. Half of the kills come right before a change of the disk (a file is opened, renamed,
removed, ...), of a random number; the others after a random part of the time until the command ends. Disks are full at
a random size of a file, or at random numbers of pages and of files of a file system in memory, where that is permitted.

A new command that writes, or a new option that names a file, is a new entry of `WRITERS`.
"""

import asyncio
import contextlib
import ctypes
import gc
import mmap
import multiprocessing
import os
import re
import resource
import shutil
import signal
import struct
import tempfile
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from pkgutil import walk_packages
from random import Random
from typing import Any

import numpy as np
from PIL import Image
from zarr.core import sync

import cinegen
import raff2urdf
from campaign.judge import Finding
from campaign.readers import ROOT, make_recording
from campaign.workers import Campaign, die_with_parent

Files = dict[str, bytes]
_LIBC = ctypes.CDLL(None, use_errno=True)
_NEWNS, _REMOUNT, _PRIVATE = 0x20000, 0x20, 0x44000  # of Linux: CLONE_NEWNS, MS_REMOUNT, MS_PRIVATE | MS_REC
_ENDING = 15.0  # s in which the processes of a killed command must end
_CREATED = re.compile(rb'"created":"[^"]*"')  # what differs from run to run
_AGE = 7200.0  # s: temporary files are removed from an hour on
_CHANGES = {f"os.{name}" for name in ("rename", "remove", "mkdir", "rmdir", "chmod", "truncate", "link", "symlink")}
"""Audit events of changes of the disk, besides files that are opened to be written."""


@dataclass(frozen=True)
class Writer:
    """A command that writes into the folder where it runs. Its inputs are in `../in/`.

    Attributes:
        call: the command.
        door: number of the writing (a listing of the folder) before which cases begin; 0: the first change; None: the
            command's start, since it has several threads or processes when it writes.
        grows: whether its output grows line by line, and is read up to a line that was cut.
        resumes: whether the same command goes on where it was killed.
    """

    call: str
    door: int | None = 0
    grows: bool = False
    resumes: bool = False


_FILM = "--video film.gif --size 160x120 --seconds 0.1 --force"
_MAP = "cinegen map ../in/planar_3r.raff --over x=-0.5..0.5:5,y=-0.5..0.5:5 --workers 1"
_PROVE = "cinegen prove ../in/five_bar.raff --over x=-10..10mm,y=450..460mm --force"
_SINGULAR = "cinegen singular ../in/planar_3r.raff --over joint2,joint3 --grid 8 --force"
_CALIBRATE = "cinegen calibrate ../in/planar_3r.raff ../in/m.csv --folds 0 --force"
_SYNTHESIZE = "cinegen synthesize ../in/five_bar.raff --task ../in/task.toml -o a.raff --workers 1 --force"
WRITERS = {
    "demo": Writer(f"cinegen demo planar_3r {_FILM}"),
    "modes": Writer("cinegen modes ../in/four_bar.raff --plot modes.png --force"),
    "modes:film": Writer(f"cinegen modes ../in/four_bar.raff --view {_FILM}", 1),
    "singular": Writer(f"{_SINGULAR} --output a.json"),
    "singular:picture": Writer(f"{_SINGULAR} --output a.json --plot a.png", 2),
    "synthesize": Writer(f"{_SYNTHESIZE} --state s.json", None, resumes=True),
    "synthesize:robot": Writer(f"{_SYNTHESIZE} --output a.raff", 3),
    "synthesize:report": Writer(f"{_SYNTHESIZE} --report r.html", 4),
    "tolerance": Writer("cinegen tolerance ../in/four_bar.raff --sigma link*.d=1mm --samples 9 --plot a.svg --force"),
    "calibrate": Writer(f"{_CALIBRATE} --output a.raff"),
    "calibrate:picture": Writer(f"{_CALIBRATE} --plot a.svg"),
    "calibrate:poses": Writer(f"{_CALIBRATE} --propose 2 --poses p.csv"),
    "map": Writer(f"{_MAP} --output a.zarr", resumes=True),
    "map:picture": Writer(f"{_MAP} -o ../in/a.zarr --plot a.png --force"),
    "map:film": Writer(f"{_MAP} -o ../in/a.zarr --view {_FILM}", 1),
    "map:sweep": Writer(
        "cinegen map ../in/planar_3r.raff --over x=-0.3..0.3:3 --at y=0.2 --vary link2.d=0.3..0.5:2 -o a --workers 1",
        resumes=True,
    ),
    "compare": Writer("cinegen compare ../in/a.zarr ../in/a.zarr --plot a.png --force"),
    "prove": Writer(f"{_PROVE} --output a.json"),
    "prove:picture": Writer(f"{_PROVE} -o a.json --plot a.png", 2),
    "plan": Writer("cinegen plan ../in/scene.toml --output a.jsonl --force"),
    "plan:pictures": Writer("cinegen plan ../in/scene.toml --plot a.png --plot-joints b.png --force", 1),
    "plan:film": Writer(f"cinegen plan ../in/scene.toml --view {_FILM}", 1),
    "drive": Writer(
        "cinegen drive ../in/planar_3r.raff --record a.jsonl --force --no-browser --seconds 0.1 --port 8400",
        None, grows=True,
    ),
    "drive:snapshot": Writer("cinegen drive ../in/planar_3r.raff --snapshot a.html --force"),
    "drive:film": Writer(f"cinegen drive ../in/planar_3r.raff {_FILM}", 1),
    "replay": Writer(f"cinegen replay ../in/mission.jsonl {_FILM}", 1),
    "export": Writer("cinegen export ../in/mission.jsonl --to csv --output a.csv --force"),
    "export:npz": Writer("cinegen export ../in/mission.jsonl --to npz -o a.npz --force"),
    "generate": Writer("cinegen generate ../in/four_bar.raff --to c --functions fk --output a/ --force"),
    "page": Writer("cinegen page ../in/four_bar.raff --output a.html --force"),
    "heal": Writer("cinegen heal ../in/tilted.raff a.raff --force", 1),
    "raff2urdf": Writer("raff2urdf ../in/four_bar.raff --output a/ --force"),
    "raff2urdf:sdf": Writer("raff2urdf ../in/four_bar.raff -o a/ --force --format sdf"),
    "urdf2raff": Writer("urdf2raff ../in/planar_3r.urdf --output a.raff --force"),
}  # fmt: skip

_TASK = """starts = 1
[parameters]
"link2.d" = "200..400mm"
[reach]
x = "-50..50mm"
y = "350..400mm"
[[objective]]
minimise = "condition"
"""


def _make_inputs(folder: Path) -> None:
    """Write the inputs of all writers, but for the map."""
    from cinegen.design import Measurements

    make_recording(folder, ("planar_3r",))
    for name in ("robots/planar_3r.raff", "robots/four_bar.raff", "robots/five_bar.raff", "generated/planar_3r.urdf"):
        shutil.copy(ROOT / name, folder)
    robot = cinegen.load(folder / "planar_3r.raff")
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (12, 3))
    values = np.column_stack([q, [robot.placement(pose, "tool").translation[:2] for pose in q]])
    columns = [*robot.actuated, "tool.x", "tool.y"]
    (folder / "m.csv").write_text(Measurements.of(robot, columns, values, [0, 0, 0, 1e-3, 1e-3]).text())
    tilted = (folder / "four_bar.raff").read_text().replace("d 120.0 }", "d 120.0 alpha 0.003 }")
    (folder / "tilted.raff").write_text(tilted)
    scene = (ROOT / "robots/scenes/disc.toml").read_text().replace("../planar_3r", "planar_3r")
    (folder / "scene.toml").write_text(scene)
    (folder / "task.toml").write_text(_TASK)


def _draw(_setup: object, folder: Path, *_: object) -> None:
    """Write frames of a film: a browser takes seconds."""
    for number in range(1, 4):
        Image.new("RGB", (64, 48), "red").save(folder / f"{number:05d}.png")


@dataclass(frozen=True)
class Order:
    """How a case ends: before a change of the disk of this number, after a time (s), or by itself with a limited size
    of its files (bytes)."""

    change: int = -1
    time: float | None = None
    size: int = -1


@dataclass(frozen=True)
class End:
    """How a case ended: its status, number of changes of the disk, time (s), the time until its last process ended (s;
    infinite if it had to be killed), and what it printed."""

    status: int
    changes: int
    seconds: float
    orphaned: float
    text: str


class Kills(Campaign):
    """Kills and full disks of all writers.

    Args:
        folder: to work in.
        seed: of the campaign.
        names: of the writers; all unless given.
    """

    name, limit = "kills", 3600.0

    def __init__(self, folder: Path, seed: int = 0, names: tuple[str, ...] = ()) -> None:
        self.folder, self.seed, self.names = folder.resolve(), seed, names or tuple(WRITERS)
        self._begun: dict[str, _Begun] = {}
        self._mounts = False
        self._commands: dict[str, list[str]] = {}
        for name in self.names:
            self._commands.setdefault(name.partition(":")[0], []).append(name)
        _make_inputs(self.folder / "in")

    def begin(self, worker: int) -> None:
        """Begin in a process of its own: import and compile what commands need. No thread is started."""
        for package in (cinegen, raff2urdf):
            for module in walk_packages(package.__path__, f"{package.__name__}."):
                if not module.name.endswith("__main__"):
                    import_module(module.name)
        from cinegen.kernels import compile_kernels

        inputs, self.folder = self.folder / "in", Path(tempfile.mkdtemp(dir=self.folder))
        shutil.copytree(inputs, self.folder / "in")
        import_module("cinegen.cockpit.film")._draw_frames = _draw
        list(compile_kernels())
        resource_tracker.ensure_running()  # once for all cases
        self._mounts = _LIBC.unshare(_NEWNS) == 0 and _mount("/", "", _PRIVATE)
        if {"map:picture", "map:film", "compare"} & {*self.names}:
            made = _Begun(WRITERS["map"], self.folder / "first map", False)
            shutil.copytree(made.folder / "a.zarr", self.folder / "in/a.zarr")

    def evidence(self, number: int) -> tuple[str, dict[str, bytes]]:
        """Return the name of a case: by turns of all commands, and of the variants of each."""
        count = len(self._commands)
        variants = list(self._commands.values())[number % count]
        return f"{variants[number // count // 2 % len(variants)]}:{number // count}", {}

    def run(self, number: int) -> tuple[dict[str, int], dict[str, Any], list[Finding]]:
        """Kill a command, or every second time fill its disk; run it again; return what is counted, what is measured,
        and the findings."""
        case, _ = self.evidence(number)
        name, rng = case.rpartition(":")[0], Random(f"{self.seed}/{case}")
        if name not in self._begun:
            self._begun[name] = _Begun(WRITERS[name], self.folder / name, self._mounts)
        command, kind = self._begun[name], ("kills", "full disks")[number // len(self._commands) % 2]
        old = {} if command.writer.resumes or rng.random() < 0.5 else command.old
        command.clean(old)
        order, when = command.kill(rng) if kind == "kills" else command.fill(rng)
        end = command.run(order)
        command.make_room()
        broken = list(command.judge_end(end, kind == "kills"))
        left = command.files()
        broken += command.judge_files(left, old)
        command.age()
        again = command.run_whole()
        if again.status:
            broken.append(("fails afterwards", f"status {again.status}", again.text))
        broken += command.judge_again()
        is_late = int(end.status == 0)
        counts = {"cases": 1, kind: 1, f"{name.partition(':')[0]} {kind}": 1 - is_late}
        counts |= {f"{kind} that came too late": is_late, "new": left == command.new}
        counts["temporary files left"] = sum(map(_is_temporary, left))
        findings = [Finding(case, what, where, f"{when}: {detail}") for what, where, detail in broken]
        return counts, {"s until the last process ended": [end.orphaned, case]}, findings


class _Begun:
    """A command in a process that waits where its cases begin.

    Attributes:
        writer: the command.
        folder: where it runs.
        new: the files that it writes.
        old: those that its cases replace.
    """

    def __init__(self, writer: Writer, folder: Path, mounts: bool) -> None:
        self.writer, self.folder = writer, folder
        folder.mkdir()
        self._mounts = mounts and _mount(str(folder), "mode=700")
        self._text, text = os.pipe()
        os.set_blocking(self._text, False)
        self._orders, orders = multiprocessing.Pipe()
        self._before: Files = {}
        self.clean({})
        if not os.fork():
            os.dup2(text, 1)
            os.dup2(text, 2)
            _Door(writer, folder, orders).run()
        orders.close()
        os.close(text)
        self._receive()
        self._before = self.files()
        end = self.run_whole()
        self.new = {name: data for name, data in self.files().items() if not _is_temporary(name)}
        assert end.status == 0, f"{writer.call}: {end}"
        assert self.new, f"{writer.call} wrote nothing"
        self.old = {name: b"old" for name in self.new if name not in self._before}

    def run(self, order: Order) -> End:
        """Run a case."""
        self._orders.send(order)
        pid, status, changes, seconds = self._receive()
        began = time.monotonic()
        while _is_alive(pid) and time.monotonic() < began + _ENDING:
            time.sleep(0.001)
        orphaned = time.monotonic() - began
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)
            orphaned = float("inf")
        text = b""
        with contextlib.suppress(BlockingIOError):
            text = os.read(self._text, 100_000)
        return End(status, changes, seconds, orphaned, text.decode(errors="replace"))

    def run_whole(self) -> End:
        """Run the command to its end; the time that it takes is that of kills until the next time."""
        end = self.run(Order())
        if end.status == 0:
            self._whole = end
        return end

    def _receive(self) -> Any:
        try:
            return self._orders.recv()
        except (EOFError, ConnectionError):
            raise AssertionError(f"{self.writer.call} ended: {os.read(self._text, 9999).decode()}") from None

    def kill(self, rng: Random) -> tuple[Order, str]:
        """Return an order to be killed at a random moment, and its text."""
        if rng.random() < 0.5:
            change = rng.randrange(self._whole.changes or 1)
            return Order(change=change), f"killed before change {change} of {self._whole.changes}"
        seconds = rng.uniform(0.0, self._whole.seconds)
        return Order(time=seconds), f"killed after {seconds:.4f} of {self._whole.seconds:.4f} s"

    def fill(self, rng: Random) -> tuple[Order, str]:
        """Let the disk be full at a random moment; return the order, and its text."""
        kind = rng.choice(("size", "pages", "files")) if self._mounts else "size"
        if kind == "size":
            size = rng.randrange(max(map(len, self.new.values())))
            return Order(size=size), f"no file above {size} bytes"
        disk = os.statvfs(self.folder)
        if kind == "pages":
            pages = rng.randrange(sum(-(-len(data) // disk.f_bsize) for data in self.new.values()))
            used = disk.f_blocks - disk.f_bfree
            assert _mount(str(self.folder), f"size={max(1, used + pages) * disk.f_bsize}", _REMOUNT)
            return Order(), f"no room after {pages} pages"
        files = rng.randrange(len(self.new))
        assert _mount(str(self.folder), f"nr_inodes={disk.f_files - disk.f_ffree + files}", _REMOUNT)
        return Order(), f"no room after {files} files"

    def make_room(self) -> None:
        """Let the disk have room."""
        if self._mounts:
            assert _mount(str(self.folder), "size=1g,nr_inodes=100k", _REMOUNT)

    def clean(self, old: Files) -> None:
        """Remove all files, and write old ones, and those of before the cases."""
        for path in self.folder.iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        (self.folder / ".tmp").mkdir()
        for name, data in {**old, **self._before}.items():
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
            (self.folder / name).write_bytes(data)

    def age(self) -> None:
        """Let temporary files be so old that others remove them."""
        for path in self.folder.rglob(".*"):
            os.utime(path, (time.time() - _AGE,) * 2)

    def files(self) -> Files:
        """Return all files, by their names, without their dates."""
        paths = (path for path in sorted(self.folder.rglob("*")) if path.is_file())
        return {str(path.relative_to(self.folder)): _CREATED.sub(b"", path.read_bytes()) for path in paths}

    def judge_end(self, end: End, is_killed: bool) -> Iterator[tuple[str, str, str]]:
        """Yield what is wrong with the end of a case."""
        code = os.waitstatus_to_exitcode(end.status)
        if end.orphaned == float("inf"):
            yield "orphan", "", f"{_ENDING} s after its end"
        if "Traceback" in end.text or code not in ((0, -signal.SIGKILL) if is_killed else (0, 1)):
            yield "end", f"exit code {code}", end.text
        if code == 1 and not end.text.strip():
            yield "silent", "", ""

    def judge_files(self, files: Files, old: Files) -> Iterator[tuple[str, str, str]]:
        """Yield what is wrong with files after a kill or a full disk."""
        for name in {*self.new, *files}:
            data = files.get(name)
            as_before = data in (None, old.get(name), self._before.get(name))
            if data is None and name in old:
                yield "lost", name, ""
            elif as_before or _is_temporary(name) or self.writer.resumes:
                continue
            elif name not in {**self.new, **self._before}:
                yield "strange file", name, ""
            elif self.writer.grows:
                yield from _unreadable(self.folder / name)
            elif data != self.new[name]:
                yield "half a file", name, f"{len(data)} bytes, not {len(self.new[name])}"

    def judge_again(self) -> Iterator[tuple[str, str, str]]:
        """Yield what is wrong with the files after the command has run again."""
        files = self.files()
        for name in {*self.new, *files}:
            if _is_temporary(name):
                if not name.startswith(".tmp/"):
                    yield "temporary file left", name, "by the next run too"
            elif self.writer.grows and name in files:
                yield from _unreadable(self.folder / name)
            elif files.get(name) != self.new.get(name):
                yield "differs afterwards", name, ""


class _Door:
    """Where a command, before it changes the disk, becomes the parent of its cases."""

    def __init__(self, writer: Writer, folder: Path, orders: Connection) -> None:
        self._writer, self._folder, self._orders = writer, str(folder), orders
        self._shared = mmap.mmap(-1, 16)  # of all processes of a case: number of changes, and seconds in the end
        self._order, self._pid, self._began, self._listings, self._is_waiting = Order(), 0, 0.0, 0, False

    def run(self) -> None:
        """Run the command in this process, which is a new one, and in those of its cases."""
        import sys

        import cinegen.cli
        import raff2urdf.cli
        import raff2urdf.urdf2raff.cli

        code = 3
        try:
            die_with_parent()
            gc.freeze()  # else collections copy all pages
            os.chdir(self._folder)
            tempfile.tempdir = os.environ["TMPDIR"] = f"{self._folder}/.tmp"
            sys.stdin, sys.stdout, sys.stderr = (open(i, "rw"[i > 0], closefd=False) for i in range(3))  # noqa: SIM115
            context = multiprocessing.get_context("fork")  # others would import all anew
            context.Process = partial(_forked, context.Process)
            multiprocessing.get_context = lambda method=None: context  # type: ignore[assignment,misc]
            program, *words = self._writer.call.split()
            mains = {"raff2urdf": raff2urdf.cli.main, "urdf2raff": raff2urdf.urdf2raff.cli.main}
            sys.addaudithook(self._hear)
            if self._writer.door is None:
                self._wait()
            code = mains.get(program, cinegen.cli.main)(words)
            struct.pack_into("d", self._shared, 8, time.monotonic() - self._began)
            sys.stdout.flush()
        except BaseException:
            os.write(2, traceback.format_exc().encode())
        finally:
            os._exit(code)

    def _hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self._is_waiting or not self._is_change(event, arguments):
            return
        if self._pid:
            (number,) = struct.unpack_from("q", self._shared)
            struct.pack_into("q", self._shared, 0, number + 1)
            if number == self._order.change:
                os.kill(self._pid, signal.SIGKILL)
        else:
            self._listings += event == "os.scandir" and os.path.abspath(arguments[0]) == self._folder
            if self._writer.door in (0, self._listings):
                self._wait()

    def _is_change(self, event: str, arguments: tuple[Any, ...]) -> bool:
        if event == "open":
            if not arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
                return False
        elif event not in _CHANGES and (self._pid or event != "os.scandir"):
            return False
        if not isinstance(path := arguments[0], (str, bytes, os.PathLike)):
            return False
        return os.path.abspath(os.fsdecode(path)).startswith(self._folder)

    def _wait(self) -> None:
        """Fork a case for each order; return in these."""
        self._is_waiting = True
        if sync.loop[0] is not None:  # threads of zarr, which starts others after a fork
            asyncio.run_coroutine_threadsafe(sync.loop[0].shutdown_default_executor(), sync.loop[0]).result()
            sync.cleanup_resources()
        end = time.monotonic() + 9.0  # those that have been joined take a moment to end
        while len(os.listdir("/proc/self/task")) > 1:
            assert time.monotonic() < end, "a process with threads can't be forked: begin it earlier (`door`)"
        self._orders.send(None)
        while True:
            try:
                self._order = self._orders.recv()
            except EOFError:
                os._exit(0)
            self._shared[:] = bytes(16)
            pid = os.fork()
            if not pid:
                os.setsid()
                die_with_parent()
                if self._order.size >= 0:
                    resource.setrlimit(resource.RLIMIT_FSIZE, (self._order.size,) * 2)
                if self._order.time is not None:
                    _kill_after(self._order.time)
                self._began, self._pid, self._is_waiting = time.monotonic(), os.getpid(), False
                return
            status = os.waitpid(pid, 0)[1]
            self._orders.send((pid, status, *struct.unpack("qd", self._shared)))


def _kill_after(seconds: float) -> None:
    """Have the system kill this process after a time, however busy the machine is."""
    timer, event = ctypes.c_void_p(), struct.pack("qii48x", 0, signal.SIGKILL, 0)  # SIGEV_SIGNAL
    assert _LIBC.timer_create(time.CLOCK_MONOTONIC, event, ctypes.byref(timer)) == 0
    assert _LIBC.timer_settime(timer, 0, struct.pack("4q", 0, 0, int(seconds), int(seconds % 1 * 1e9) or 1), None) == 0


def _forked(process: Any, args: tuple[Any, ...], **settings: Any) -> Any:
    """Return a process that is forked with values that are sent to others."""
    return process(args=tuple(getattr(arg, "_value", arg) for arg in args), **settings)


def _mount(folder: str, options: str, flags: int = 0) -> bool:
    """Mount a file system in memory, or change its options; return whether that is permitted."""
    return _LIBC.mount(b"tmpfs", folder.encode(), b"tmpfs", flags, options.encode()) == 0


def _is_alive(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def _is_temporary(name: str) -> bool:
    return name.startswith(".") or "/." in name


def _unreadable(path: Path) -> Iterator[tuple[str, str, str]]:
    from cinegen.errors import CinegenError
    from cinegen.mission.recording import Recording

    try:
        Recording.load(path)
    except CinegenError as error:
        yield "half a file", "recording", str(error)
