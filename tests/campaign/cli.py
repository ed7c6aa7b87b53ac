"""Run campaigns, replay a case, minimise a finding.

python -m campaign files --cases 1e6          1e6 mutated files for all readers
python -m campaign replay raff:123            one case again, in this process
python -m campaign minimise raff:123          the least file that breaks the same promise
"""

from __future__ import annotations

import argparse
import json
import secrets
import shutil
import signal
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from campaign import report, workers
from campaign.shrink import in_child, shrunk
from campaign.soak import soak
from campaign.workers import Result

if TYPE_CHECKING:
    from campaign.readers import Files

ENDLESS = 10**12
HERE = Path("/dev/shm") if Path("/dev/shm").is_dir() else None


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(
        prog="python -m campaign", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("what", choices=("all", *MAKE, "soak", "replay", "minimise"))
    parser.add_argument("case", nargs="?", help="of replay and minimise, such as raff:123")
    parser.add_argument("--cases", type=lambda text: int(float(text)), default=ENDLESS, help="number of cases [no end]")
    parser.add_argument(
        "--seconds", type=float, default=float("inf"), help="time after which no case is begun [no end]"
    )
    parser.add_argument("--hours", type=float, default=1.0, help="of `all` [1]")
    parser.add_argument("--seed", type=int, default=0, help="other cases for each seed [0]")
    parser.add_argument("--workers", type=int, default=0, help="processes [as many as cores]")
    parser.add_argument("--only", default="", help="names of readers or commands, parted by commas [all]")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("build/campaign"), help="folder of the report [build/campaign]"
    )
    options = parser.parse_args()
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell began it in the background
        signal.signal(signal.SIGINT, signal.default_int_handler)
    folder = Path(tempfile.mkdtemp(prefix="campaign", dir=HERE))
    try:
        if options.what in ("replay", "minimise"):
            again(options, folder)
        elif options.what == "all":
            options.seed = options.seed or secrets.randbelow(10**6)
            found = []
            for what, share in SHARES.items():
                options.seconds = 3600.0 * options.hours * share
                found.append(campaign(what, options, folder))
            sys.exit(0 if all(found) else 1)
        else:
            sys.exit(0 if campaign(options.what, options, folder) else 1)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _names(options: Any) -> tuple[str, ...]:
    return tuple(filter(None, options.only.split(",")))


def _files(options: Any, folder: Path) -> workers.Campaign:
    from campaign.readers import READERS, Files

    return Files(folder, options.seed, [READERS[name] for name in _names(options)])


def _ticks(options: Any, folder: Path) -> workers.Campaign:
    from campaign.ticks import Ticks

    return Ticks(options.seed)


def _kills(options: Any, folder: Path) -> workers.Campaign:
    from campaign.kills import Kills

    return Kills(folder, options.seed, _names(options))


def _messages(options: Any, folder: Path) -> workers.Campaign:
    from campaign.messages import Messages

    return Messages(options.seed)


MAKE = {"files": _files, "ticks": _ticks, "messages": _messages, "kills": _kills}
"""Make the campaigns, by name."""


SHARES = {"files": 0.4, "ticks": 0.2, "messages": 0.15, "kills": 0.15, "soak": 0.1}
"""Parts of the hours of `all`."""


def campaign(what: str, options: Any, folder: Path) -> bool:
    """Run a campaign; write its report, meanwhile too; return whether it found nothing."""
    command = f"python -m campaign {what}" + "".join(
        f" --{name} {value:g}"
        for name, value in (("cases", options.cases), ("seconds", options.seconds), ("seed", options.seed))
        if value not in (ENDLESS, float("inf"), 0)
    )
    written = 0.0

    def progress(result: Result, done: float) -> None:
        nonlocal written
        counts = "  ".join(f"{name} {number:,}" for name, number in sorted(result.counts.items())[:6])
        print(
            f"\r\033[K{what} {100 * done:5.1f} %  {counts}  causes {len(result.causes)}",
            end="",
            file=sys.stderr,
            flush=True,
        )
        if result.seconds - written > 20.0:
            written = result.seconds
            report.write(options.output, what, result, command)

    if what == "soak":
        result = soak(folder, min(options.seconds, 1e9), options.seed, progress)
    else:
        result = workers.run(
            MAKE[what](options, folder / what), options.cases, options.seconds, options.workers, progress
        )
    report.write(options.output, what, result, command)
    print(file=sys.stderr)
    print(report.table({what: json.loads((options.output / "report.json").read_text())[what]}))
    return not result.causes


def again(options: Any, folder: Path) -> None:
    """Run a case again, or minimise its file."""
    from campaign.readers import READERS, Files

    name, _, number = options.case.partition(":")
    of_file = name in READERS
    if not number.isdecimal() or not (of_file or (name in MAKE and options.what == "replay")):
        sys.exit(f"'{options.case}': name a case as reports do, such as raff:123; only files can be minimised")
    cases = Files(folder, options.seed, [READERS[name]]) if of_file else MAKE[name](options, folder)
    cases.begin(0)
    if options.what == "minimise":
        sys.stdout.buffer.write(minimised(cases, int(number)) + b"\n")
        return
    try:
        for one in cases.run(int(number))[2]:
            print(one.key, one.detail, sep="\n")
    finally:
        cases.end()


def minimised(files: Files, number: int, seconds: float = 30.0) -> bytes:
    """Return the least part of a case's file that breaks a promise that the file breaks, as far as the time allows."""
    case = files.case(number)

    def causes(data: bytes) -> set[str]:
        return in_child(
            lambda: [f"{kind}: {where}" for kind, where, _ in files.read(case._replace(data=data)).broken],
            files.limit,
            workers.MEMORY,
        )

    found = causes(case.data)
    return shrunk(case.data, lambda data: bool(causes(data) & found), seconds) if found else b""
