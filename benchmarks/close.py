"""How often a second closed robots are closed when their motors are told where to be, each from where it was before.

    python benchmarks/close.py [ROBOT...]

Motors swing by 0.1 rad (or characteristic lengths), at once, 314 times to and fro; what is printed are medians of
calls from a plain Python loop:

    close        mechanism.close(q, locked=mechanism.actuated)
    numpy        the same by raff2urdf.closure.close, which it falls back to
    ratio        of the two, timed alternately
    move         ForwardKinematics.move: on one branch, whatever the jump
    lines        what `cinegen close` makes of a line of JSON, pipes apart; `bulk` is the command itself, fed by a pipe
"""

from __future__ import annotations

import io
import json
import subprocess
import sys
import threading
import time
from pathlib import Path
from statistics import median

import numpy as np

import cinegen
from cinegen.devices import Lines
from cinegen.model import ForwardKinematics
from raff2urdf import closure

ROBOTS = Path(__file__).parent.parent / "robots"
ROUNDS, SWING, BULK = 15, 0.1, 20000


def swings(mechanism: cinegen.Mechanism, count: int) -> np.ndarray:
    """(count, motors) values around home, rad and m."""
    columns = [mechanism.v_index(joint) for joint in mechanism.actuated]
    home = [mechanism.q_home[mechanism.q_index(joint)] for joint in mechanism.actuated]
    phases = np.arange(count)[:, None] / 50.0 + np.arange(len(columns))
    return home + SWING * np.sin(phases) * mechanism.scale[columns]


def main() -> None:
    names = sys.argv[1:] or sorted(path.stem for path in ROBOTS.glob("*.raff"))
    print(f"{'a second':<16}{'joints':>7}{'loops':>6}{'close':>9}{'numpy':>8}{'ratio':>7}", end="")
    print(f"{'move':>9}{'lines':>9}{'bulk':>9}")
    for name in names:
        mechanism = cinegen.load(ROBOTS / f"{name}.raff")
        if mechanism.loops:
            measure(name, mechanism)


def measure(name: str, mechanism: cinegen.Mechanism) -> None:
    values = swings(mechanism, 314)
    places = [mechanism.q_index(joint) for joint in mechanism.actuated]
    free = np.ones(mechanism.model.nv, dtype=bool)
    free[[mechanism.v_index(joint) for joint in mechanism.actuated]] = False
    starts, q = [], mechanism.q_home
    for row in values:
        start = q.copy()
        start[places] = row
        starts.append(start)
        q = mechanism.close(start, mechanism.actuated)
    named = [dict(zip(mechanism.actuated, row.tolist(), strict=True)) for row in values]
    lines = "".join(json.dumps(row) + "\n" for row in named).encode()
    motion, served = ForwardKinematics(mechanism), Lines(mechanism)
    ways = {
        "close": lambda: [mechanism.close(start, mechanism.actuated) for start in starts],
        "numpy": lambda: [closure.close(mechanism.structure.system, start, free) for start in starts],
        "move": lambda: [motion.move(row) for row in named],
        "lines": lambda: served.serve(io.BytesIO(lines), len),
    }
    seconds: dict[str, list[float]] = {way: [] for way in ways}
    for _ in range(ROUNDS):
        for way, run in ways.items():
            began = time.perf_counter()
            run()
            seconds[way].append((time.perf_counter() - began) / len(values))
    rate = {way: 1.0 / median(found) for way, found in seconds.items()}
    ratio = median(old / new for old, new in zip(seconds["numpy"], seconds["close"], strict=True))
    print(
        f"{name:<16}{len(mechanism.joints):>7}{len(mechanism.loops):>6}{rate['close']:>9.0f}{rate['numpy']:>8.0f}"
        f"{ratio:>7.1f}{rate['move']:>9.0f}{rate['lines']:>9.0f}{bulk(name, mechanism):>9.0f}"
    )


def bulk(name: str, mechanism: cinegen.Mechanism) -> float:
    """Lines a second through the command and two pipes, from the first answer on."""
    rows = swings(mechanism, BULK)
    lines = [json.dumps(dict(zip(mechanism.actuated, row.tolist(), strict=True))) + "\n" for row in rows]
    command = [sys.executable, "-m", "cinegen", "close", str(ROBOTS / f"{name}.raff")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write("{}\n")
        process.stdin.flush()
        process.stdout.readline()  # it stands ready
        began = time.perf_counter()
        writer = threading.Thread(target=lambda: (process.stdin.writelines(lines), process.stdin.close()))
        writer.start()
        count = sum(1 for _ in process.stdout)
        ended = time.perf_counter()
        writer.join()
    assert count == BULK
    return BULK / (ended - began)


if __name__ == "__main__":
    main()
