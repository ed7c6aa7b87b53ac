"""Run campaigns, replay a case.

python -m campaign files --cases 1e6          1e6 mutated files for all readers
python -m campaign replay raff:123            one case again, in this process
"""

import argparse
import json
import secrets
import shutil
import signal
import sys
import tempfile
from pathlib import Path
from typing import Any

from campaign import report, workers
from campaign.soak import soak
from campaign.workers import Result

ENDLESS = 10**12
HERE = Path("/dev/shm") if Path("/dev/shm").is_dir() else None


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(
        prog="python -m campaign", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("what", choices=("all", *SHARES, "replay"))
    parser.add_argument("case", nargs="?", help="of replay, such as raff:123")
    parser.add_argument("--cases", type=lambda text: int(float(text)), default=ENDLESS, help="number of cases [no end]")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="after which no case is begun [no end]")
    parser.add_argument("--hours", type=float, default=1.0, help="of `all` [1]")
    parser.add_argument("--seed", type=int, default=0, help="other cases for each seed [0]")
    parser.add_argument("--workers", type=int, default=0, help="processes [as many as cores]")
    parser.add_argument("--only", default="", help="names of readers or commands, parted by commas [all]")
    parser.add_argument("-o", "--output", type=Path, default=Path("build/campaign"), help="folder [build/campaign]")
    options = parser.parse_args()
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell began it in the background
        signal.signal(signal.SIGINT, signal.default_int_handler)
    folder = Path(tempfile.mkdtemp(prefix="campaign", dir=HERE))
    try:
        if options.what == "replay":
            again(options, folder)
        elif options.what == "all":
            options.seed = options.seed or secrets.randbelow(10**6)
            passed = []
            for what, share in SHARES.items():
                options.seconds = 3600.0 * options.hours * share
                passed.append(campaign(what, options, folder))
            sys.exit(0 if all(passed) else 1)
        else:
            sys.exit(0 if campaign(options.what, options, folder) else 1)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def make(what: str, options: Any, folder: Path) -> workers.Campaign:
    """Make a campaign by its name, one of `SHARES` but for the soak."""
    from campaign import kills, messages, readers, ticks

    names = tuple(filter(None, options.only.split(",")))
    if what == "files":
        return readers.Files(folder, options.seed, [readers.READERS[name] for name in names])
    if what == "kills":
        return kills.Kills(folder, options.seed, names)
    return ticks.Ticks(options.seed) if what == "ticks" else messages.Messages(options.seed)


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
        text = f"\r\033[K{what} {100 * done:5.1f} %  {counts}  causes {len(result.causes)}"
        print(text, end="", file=sys.stderr, flush=True)
        if result.seconds - written > 20.0:
            written = result.seconds
            report.write(options.output, what, result, command)

    if what == "soak":
        result = soak(folder, min(options.seconds, 1e9), options.seed, progress)
    else:
        made = make(what, options, folder / what)
        result = workers.run(made, options.cases, options.seconds, options.workers, progress)
    report.write(options.output, what, result, command)
    print(file=sys.stderr)
    print(report.table({what: json.loads((options.output / "report.json").read_text())[what]}))
    return not result.causes


def again(options: Any, folder: Path) -> None:
    """Run a case again."""
    from campaign.readers import READERS

    name, _, number = options.case.partition(":")
    if not number.isdecimal() or name not in (*READERS, "ticks", "messages", "kills"):
        sys.exit(f"'{options.case}': name a case as reports do, such as raff:123")
    if name in READERS:
        options.only = name
    cases = make("files" if name in READERS else name, options, folder)
    cases.begin(0)
    try:
        for finding in cases.run(int(number))[2]:
            print(finding.key, finding.detail, sep="\n")
    finally:
        cases.end()
