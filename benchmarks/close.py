"""How often a second closed robots are closed when their motors are told where to be, each from where it was before.

    python benchmarks/close.py [ROBOT...]

Motors swing by 0.1 rad (or characteristic lengths), at once, 314 times to and fro; what is printed are medians of
calls from a plain Python loop:

    close        mechanism.close(q, locked=mechanism.actuated)
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
from statistics import median

import numpy as np
from bench import ROBOTS, in_turns, robots

import cinegen
from cinegen.devices import Lines
from cinegen.model import ForwardKinematics

ROUNDS, SWING, BULK = 15, 0.1, 20_000


def swings(mechanism: cinegen.Mechanism, count: int) -> np.ndarray:
    """(count, motors) values around home, rad and m."""
    columns = [mechanism.v_index(joint) for joint in mechanism.actuated]
    home = [mechanism.q_home[mechanism.q_index(joint)] for joint in mechanism.actuated]
    phases = np.arange(count)[:, None] / 50.0 + np.arange(len(columns))
    return home + SWING * np.sin(phases) * mechanism.scale[columns]


def main() -> None:
    print(f"{'a second':<16}{'joints':>7}{'loops':>6}{'close':>9}{'move':>9}{'lines':>9}{'bulk':>9}")
    for name, mechanism in robots():
        if mechanism.loops:
            measure(name, mechanism)


def measure(name: str, mechanism: cinegen.Mechanism) -> None:
    values = swings(mechanism, 314)
    places = [mechanism.q_index(joint) for joint in mechanism.actuated]
    starts, q = [], mechanism.q_home
    for row in values:
        start = q.copy()
        start[places] = row
        starts.append(start)
        q = mechanism.close(start, mechanism.actuated)
    named = [dict(zip(mechanism.actuated, row.tolist(), strict=True)) for row in values]
    lines = "".join(json.dumps(row) + "\n" for row in named).encode()
    motion, served = ForwardKinematics(mechanism), Lines(mechanism)
    calls = {
        "close": lambda: [mechanism.close(start, mechanism.actuated) for start in starts],
        "move": lambda: [motion.move(row) for row in named],
        "lines": lambda: served.serve(io.BytesIO(lines), len),
    }
    rates = [len(values) / median(times) for times in in_turns(calls, ROUNDS).values()]
    cells = "".join(f"{rate:>9.0f}" for rate in (*rates, bulk(name, mechanism)))
    print(f"{name:<16}{len(mechanism.joints):>7}{len(mechanism.loops):>6}{cells}")


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
