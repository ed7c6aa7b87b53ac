"""What proofs of the branch cost `ForwardKinematics`: ratios to the same without proofs, timed alternately.

python benchmarks/branches.py [ROBOT...]

loop      the actuated joints swing by 0.05 rad (or characteristic lengths) in 314 moves, as in a control loop
jumps     they jump by 0.1 to and fro
lines     of 20 random targets within 1 rad, those at which moves in 1, 2, 3, 10, 100 and 300 lines do not end at the
          same configuration, or not all fail
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from statistics import median

import numpy as np

import cinegen
from cinegen.model import ForwardKinematics

ROBOTS = Path(__file__).parent.parent / "robots"
ROUNDS = 15
Values = dict[str, float]


def main() -> None:
    print(f"{'':<16}{'loop':>7}{'jumps':>7}{'lines':>7}")
    for name in sys.argv[1:] or ["delta4", "sr400", "gough", "five_bar", "four_bar", "tssm", "hybrid"]:
        mechanism = cinegen.load(ROBOTS / f"{name}.raff")
        loop = [_moved(mechanism, 0.05 * np.sin(k / 50.0 + np.arange(9.0))) for k in range(314)]
        jumps = [_moved(mechanism, np.full(9, 0.05 * (-1.0) ** k)) for k in range(60)]
        print(f"{name:<16}{_ratio(mechanism, loop):>7.2f}{_ratio(mechanism, jumps):>7.2f}{_differing(mechanism):>7}")


def _moved(mechanism: cinegen.Mechanism, change: np.ndarray) -> Values:
    """Values of the actuated joints near home, by dimensionless changes."""
    names = mechanism.actuated
    return {
        name: float(mechanism.q_home[mechanism.q_index(name)] + x * mechanism.scale[mechanism.v_index(name)])
        for name, x in zip(names, change.tolist(), strict=False)
    }


def _ratio(mechanism: cinegen.Mechanism, goals: list[Values]) -> float:
    motions = [ForwardKinematics(mechanism), ForwardKinematics(mechanism)]
    motions[1]._memory.proves = 0
    spent: list[list[float]] = [[], []]
    for _ in range(ROUNDS):
        for motion, own in zip(motions, spent, strict=True):
            motion.q = mechanism.q_home
            begin = time.process_time()
            for goal in goals:
                motion.move(goal)
            own.append(time.process_time() - begin)
    return median(spent[0]) / median(spent[1])


def _differing(mechanism: cinegen.Mechanism) -> int:
    rng, motion, found = np.random.default_rng(0), ForwardKinematics(mechanism), 0
    for _ in range(20):
        change, ends = rng.uniform(-1.0, 1.0, len(mechanism.actuated)), set[tuple[float, ...] | None]()
        for lines in (1, 2, 3, 10, 100, 300):
            motion.q = mechanism.q_home
            try:
                for k in range(1, lines + 1):
                    motion.move(_moved(mechanism, change * (k / lines)))
                ends.add(tuple(np.round(motion.q, 8).tolist()))
            except cinegen.ClosureError:
                ends.add(None)
        found += len(ends) > 1
    return found


if __name__ == "__main__":
    main()
