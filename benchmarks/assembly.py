"""Time of `assembly_modes` for whole mechanisms: at first, and then for each set of joint values.

    python benchmarks/assembly.py [ROBOT ...]

For each of the repository's closed robots: seconds of the first call for a mechanism that was just loaded (everything
compiled), in which monodromy looks for all solutions where no family is known; and the median of milliseconds of 30
more calls at random values near home, joints of all legs and polishing included. `ROBOT monodromy` solves it as if
its family were not known.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from statistics import median

import numpy as np

import cinegen
from cinegen.assembly import assembly_modes

ROBOTS = Path(__file__).resolve().parent.parent / "robots"
NAMES = ("five_bar", "delta4", "tssm", "gough", "hybrid", "hybrid monodromy", "gough monodromy")
CALLS = 30


def main() -> None:
    names = sys.argv[1:] or NAMES
    assembly_modes(cinegen.load(ROBOTS / "hybrid.raff"), effort=1e-3)  # compiles
    print(f"{'':<18} {'first, s':>9} {'then, ms':>9} {'modes':>7}  how they were found")
    for name in names:
        measure(*name.split())


def measure(robot: str, method: str = "auto") -> None:
    mechanism = cinegen.load(ROBOTS / f"{robot}.raff")
    home = np.array([mechanism.q_home[mechanism.q_index(name)] for name in mechanism.actuated])
    unit = np.array([mechanism.length if mechanism.is_prismatic(name) else 1.0 for name in mechanism.actuated])
    rng = np.random.default_rng(0)
    began = time.perf_counter()
    modes = assembly_modes(mechanism, method=method)
    first, seconds = time.perf_counter() - began, []
    for _ in range(CALLS):
        values = home + 0.02 * rng.normal(size=len(home)) * unit
        began = time.perf_counter()
        assembly_modes(mechanism, values, method)
        seconds.append(time.perf_counter() - began)
    label = robot if method == "auto" else f"{robot}, {method}"
    print(f"{label:<18} {first:9.3f} {1e3 * median(seconds):9.2f} {len(modes):7}  {modes.method}")


if __name__ == "__main__":
    main()
