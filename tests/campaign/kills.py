"""Kill commands that write, at random moments, or let their disk be full after a random number of bytes. What is on the
disk afterwards is whole: the old file, or the new one, or what the same command resumes; never half of it. No process
stays behind, and a full disk is told in a sentence.

A new command that writes is a new entry in `WRITERS`.
"""

import contextlib
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from campaign.judge import Finding
from campaign.readers import ROOT
from campaign.workers import Campaign

_CHANGES = re.compile(rb'"created":"[^"]*"')  # what differs from run to run
_LEFT = 15.0  # s in which the processes of a killed command must end


@dataclass(frozen=True)
class Writer:
    """A command that writes.

    Attributes:
        arguments: after `python -m`; they name files in the folder where it runs.
        inputs: contents of its files: with the old ones it writes the old output.
        appends: whether its output grows line by line, and is read up to a line that was cut.
        resumes: whether the same command goes on where it was killed.
        seconds: after which it is interrupted if it doesn't end by itself.
    """

    arguments: str
    inputs: dict[str, tuple[bytes, bytes]] = field(default_factory=dict)
    appends: bool = False
    resumes: bool = False
    seconds: float = 0.0


def _robot(name: str, old: bytes, new: bytes) -> dict[str, tuple[bytes, bytes]]:
    text = (ROOT / f"robots/{name}.raff").read_bytes()
    assert old in text, name
    return {"robot.raff": (text.replace(old, new), text)}


def _scene() -> dict[str, tuple[bytes, bytes]]:
    text = (ROOT / "robots/scenes/disc.toml").read_bytes().replace(b"../planar_3r", b"planar_3r")
    robot = (ROOT / "robots/planar_3r.raff").read_bytes()
    return {"scene.toml": (text.replace(b"0.43", b"0.42"), text), "planar_3r.raff": (robot, robot)}


def _both(name: str, data: bytes) -> dict[str, tuple[bytes, bytes]]:
    return {name: (data, data)}


def _arm() -> dict[str, tuple[bytes, bytes]]:
    text = (ROOT / "generated/planar_3r.urdf").read_bytes()
    return {"robot.urdf": (text.replace(b"0.4", b"0.41"), text)}


def _tilted(degrees: bytes) -> bytes:
    text = (ROOT / "robots/four_bar.raff").read_bytes()
    return text.replace(b"d 120.0 }", b"d 120.0 alpha " + degrees + b" }")


_FOUR_BAR = _robot("four_bar", b"d 120.0", b"d 121.0")
WRITERS = {
    "raff2urdf": Writer("raff2urdf robot.raff -o out/", _FOUR_BAR),
    "raff2urdf-sdf": Writer("raff2urdf robot.raff -o out/ --format sdf", _FOUR_BAR),
    "raff2urdf-mjcf": Writer("raff2urdf robot.raff -o out/ --format mjcf", _robot("planar_3r", b"d 400.0", b"d 401.0")),
    "urdf2raff": Writer("raff2urdf.urdf2raff robot.urdf -o out.raff --force", _arm()),
    "heal": Writer("cinegen heal robot.raff out.raff --force", {"robot.raff": (_tilted(b"0.003"), _tilted(b"0.004"))}),
    "map": Writer(
        "cinegen map robot.raff --over x=-0.5..0.5:60,y=-0.5..0.5:60 --workers 1 -o out.zarr",
        _both("robot.raff", (ROOT / "robots/planar_3r.raff").read_bytes()),
        resumes=True,
    ),
    "plan": Writer("cinegen plan scene.toml -o out.jsonl --force", _scene()),
    "export": Writer("cinegen export in.jsonl --to csv -o out.csv --force"),
    "singular": Writer(
        "cinegen singular robot.raff --over joint2,joint3 -o out.json --force --plot out.png",
        _robot("planar_3r", b"d 400.0", b"d 401.0"),
    ),
    "drive": Writer(
        "cinegen drive robot.raff --record out.jsonl --force --no-browser --seconds 100 --port 8400",
        _both("robot.raff", (ROOT / "robots/planar_3r.raff").read_bytes()),
        appends=True,
        seconds=3.0,
    ),
}  # fmt: skip


class Kills(Campaign):
    """Kills of all writers.

    Args:
        folder: to work in.
        seed: of the campaign.
        names: of the writers; all unless given.
    """

    limit = 600.0

    def __init__(self, folder: Path, seed: int = 0, names: tuple[str, ...] = ()) -> None:
        self.folder, self.seed, self.names = folder, seed, names or tuple(WRITERS)
        self._whole: dict[str, tuple[dict[str, bytes], dict[str, bytes]]] = {}
        self._seconds: dict[str, float] = {}
        for name in self.names:
            old, new = folder / "old" / name, folder / "new" / name
            writer = WRITERS[name]
            for i, path in enumerate((old, new)):
                path.mkdir(parents=True)
                _put(writer, path, i, folder)
                began = time.monotonic()
                process = _start(writer, path)
                if writer.seconds:
                    _wait_for(partial(_outputs, writer, path))
                code = _ended(process, writer.seconds)
                assert code in (0, 130, -2), f"{name}: {code}"
                self._seconds[name] = time.monotonic() - began
            self._whole[name] = _outputs(writer, old), _outputs(writer, new)
            assert self._whole[name][1], f"{name} wrote nothing"

    def begin(self, worker: int) -> None:
        """Begin in a process of its own."""
        self.folder = self.folder / f"worker{worker}"

    def evidence(self, number: int) -> tuple[str, dict[str, bytes]]:
        """Return the name of a case."""
        return f"{self.names[number % len(self.names)]}:{number // len(self.names)}", {}

    def run(self, number: int) -> tuple[dict[str, int], dict[str, Any], list[Finding]]:
        """Kill a command once, or every second time fill its disk; return what is counted, what is measured, and the
        findings."""
        case, _ = self.evidence(number)
        name = case.partition(":")[0]
        writer, rng, path = WRITERS[name], Random(f"{self.seed}/{case}"), self.folder / name
        old, new = self._whole[name]
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir(parents=True)
        has_old = rng.random() < 0.5 and not writer.resumes and not writer.appends
        for file, data in old.items() if has_old else ():
            (path / file).parent.mkdir(parents=True, exist_ok=True)
            (path / file).write_bytes(data)
        _put(writer, path, 1, self.folder.parent)
        broken: list[tuple[str, str, str]] = []
        ends: list[tuple[bool, float]] = []
        filled = number // len(self.names) % 2 == 1
        if filled:
            most = rng.randrange(max(map(len, new.values())))
            when = f"no file above {most} bytes"
            _fill(writer, path, most, broken)
        else:
            count = 1 + rng.randint(0, 2 * writer.resumes)
            delays = [rng.uniform(0.0, 1.05 * self._seconds[name]) for _ in range(count)]
            when = f"killed after {delays[0]:.3f} s"
            ends = [self._killed(writer, path, one, broken) for one in delays]
        if writer.resumes:
            code = _ended(_start(writer, path), 0.0)
            if code:
                broken.append(("not resumed", f"exit code {code}", ""))
        found = _outputs(writer, path)
        whole = {"whole": 0, "absent": 0}
        for file in new:
            data = found.pop(file, None)
            if data is None and not has_old:
                whole["absent"] += 1
            elif data is None or (writer.appends and not _is_read(path / file, broken)):
                broken.append(("lost", file, when))
            elif not writer.appends and data not in (new[file], old.get(file) if has_old else None):
                broken.append(("half a file", _kind(file), f"{file}, {when}: {len(data)} bytes, not {len(new[file])}"))
            else:
                whole["whole"] += 1
        strangers = [file for file in found if not Path(file).name.startswith(".") and file not in old]
        if strangers and (writer.resumes or not writer.appends):
            broken.append(("strange file", _kind(strangers[0]), f"{strangers}, {when}"))
        killed = sum(one[0] for one in ends)
        counts = {"cases": 1, "kills": killed, "ended before": len(ends) - killed, f"{name} kills": killed}
        counts |= {"full disks": int(filled), f"{name} full disks": int(filled)}
        counts |= {**whole, "temporary files left": len(found) - len(strangers)}
        worst = {"s until the last process ended": [max((one[1] for one in ends), default=0.0), case]}
        return counts, worst, [Finding(case, *one) for one in broken]

    def _killed(
        self, writer: Writer, path: Path, delay: float, broken: list[tuple[str, str, str]]
    ) -> tuple[bool, float]:
        """Start a command and kill it; return whether it ran until then, and the time (s) until all its processes had
        ended."""
        process = _start(writer, path)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(delay)
        process.kill()  # does nothing if it has ended
        killed = process.wait() == -signal.SIGKILL
        began = time.monotonic()
        while _is_alive(process.pid):
            if time.monotonic() > began + _LEFT:
                broken.append(("orphan", writer.arguments.split()[1], f"killed after {delay:.3f} s"))
                os.killpg(process.pid, signal.SIGKILL)
                break
            time.sleep(0.02)
        return killed, time.monotonic() - began


def _put(writer: Writer, path: Path, which: int, folder: Path) -> None:
    for name, contents in writer.inputs.items():
        (path / name).write_bytes(contents[which])
    if "in.jsonl" in writer.arguments:
        (path / "in.jsonl").write_bytes(_recording(folder).read_bytes())


def _recording(folder: Path) -> Path:
    from campaign.readers import make_recording

    path = folder / "recording"
    if not (path / "mission.jsonl").exists():
        make_recording(path, ("planar_3r",))
    return path / "mission.jsonl"


def _fill(writer: Writer, path: Path, most: int, broken: list[tuple[str, str, str]]) -> None:
    """Run a command that can write no file above a size (bytes); it must end with a sentence."""
    process = _start(writer, path, most)
    code = _ended(process, writer.seconds)
    assert process.stderr is not None
    text = process.stderr.read().decode(errors="replace")
    if "Traceback" in text or not (code in (1, 2) or (writer.appends and code in (0, 130, -2))):
        broken.append(("full disk", writer.arguments.split()[1], f"exit code {code} at {most} bytes: {text[-500:]}"))


def _start(writer: Writer, path: Path, most: int | None = None) -> subprocess.Popen[bytes]:
    """Start a command; `most`: largest size of a file that it can write, bytes, and its stderr is piped."""
    command = [sys.executable, "-m", *writer.arguments.split()]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.Popen(
        command, cwd=path, env=environment, start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL if most is None else subprocess.PIPE,
        preexec_fn=None if most is None else partial(resource.setrlimit, resource.RLIMIT_FSIZE, (most, most)),
    )  # fmt: skip


def _ended(process: subprocess.Popen[bytes], seconds: float) -> int:
    """Wait for a command; interrupt one that doesn't end by itself."""
    if seconds:
        time.sleep(seconds)
        process.send_signal(signal.SIGINT)
    return process.wait(300)


def _wait_for(condition: Callable[[], object], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)


def _is_alive(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def _outputs(writer: Writer, path: Path) -> dict[str, bytes]:
    """Return the files that a command wrote, without what differs from run to run."""
    files = {str(one.relative_to(path)): one for one in sorted(path.rglob("*")) if one.is_file()}
    own = {*writer.inputs, "in.jsonl"}
    return {name: _CHANGES.sub(b"", one.read_bytes()) for name, one in files.items() if name not in own}


def _is_read(path: Path, broken: list[tuple[str, str, str]]) -> bool:
    from cinegen.errors import CinegenError
    from cinegen.mission.recording import Recording

    try:
        Recording.load(path)
    except CinegenError as error:
        broken.append(("half a file", "recording", str(error)))
        return False
    return True


def _kind(file: str) -> str:
    return re.sub(r"\d+", "N", Path(file).suffix or file)
