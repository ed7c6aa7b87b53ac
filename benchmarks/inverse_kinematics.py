"""Time `cinegen.inverse_kinematics`, count the poses that it finds, and time `cinegen.evaluate`.

    python benchmarks/inverse_kinematics.py [COUNT]

Poses are made forwards, from motors at random within their limits, and kept where all joints are within theirs.
"""

from __future__ import annotations

import math
import sys
import sysconfig
import time
from pathlib import Path

import numpy as np

import cinegen

ROBOTS = Path(__file__).parent.parent / "robots"
EXAMPLES = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
NODES = {
    EXAMPLES / "panda_description/urdf/panda.urdf": "panda_hand",
    EXAMPLES / "ur_description/urdf/ur5_robot.urdf": "tool0",
    ROBOTS / "delta4.raff": "platform",
    ROBOTS / "five_bar.raff": "tool",
    ROBOTS / "gough.raff": "platform",
    ROBOTS / "hybrid.raff": "tool",
}
ROUNDS = 5


def reachable(mechanism: cinegen.Mechanism, count: int) -> list[np.ndarray]:
    """Configurations, loops closed and all joints within their limits."""
    rng, found = np.random.default_rng(1), []
    low, high = mechanism.model.lowerPositionLimit, mechanism.model.upperPositionLimit
    while len(found) < count:
        q = mechanism.q_home.copy()
        for joint in mechanism.actuated:
            i = mechanism.q_index(joint)
            reach = mechanism.length if mechanism.is_prismatic(joint) else math.pi
            q[i] = rng.uniform(max(low[i], q[i] - reach), min(high[i], q[i] + reach))
        try:
            q = mechanism.close(q, locked=mechanism.actuated)
        except cinegen.ClosureError:
            continue
        if (q >= low).all() and (q <= high).all():
            found.append(q)
    return found


def measure_reach(count: int) -> None:
    print(f"reach: {count} random reachable poses each, to 1e-6 m and 1e-6 rad inside limits")
    print(f"{'':14}{'found':>8}{'median ms':>11}{'99 %':>8}{'worst':>8}{'starts':>8}")
    for path, node in NODES.items():
        mechanism = cinegen.load(path)
        targets = [mechanism.placement(q, node) for q in reachable(mechanism, count)]
        cinegen.inverse_kinematics(mechanism, {node: targets[0]})  # finds out where it can be
        times, found, starts = [], 0, 0
        for target in targets:
            begin = time.perf_counter()
            reached = cinegen.inverse_kinematics(mechanism, {node: target})
            times.append(1e3 * (time.perf_counter() - begin))
            found += bool(reached) and max(reached.errors[0]) <= 1e-6
            starts = max(starts, reached.starts)
        middle, most, worst = np.quantile(times, [0.5, 0.99, 1.0])
        print(f"{path.stem:14}{100 * found / count:7.1f}%{middle:11.3f}{most:8.3f}{worst:8.2f}{starts:8}")


def measure_evaluate() -> None:
    print("\nevaluate: placement, Jacobian and singular values, on one core")
    arm = cinegen.load(EXAMPLES / "panda_description/urdf/panda.urdf")
    delta = cinegen.load(ROBOTS / "delta4.raff")
    rng = np.random.default_rng(0)
    columns = [arm.q_index(joint) for joint in arm.actuated]
    low, high = arm.model.lowerPositionLimit[columns], arm.model.upperPositionLimit[columns]
    anywhere = rng.uniform(low, high, (30_000, len(columns)))
    home = np.array([delta.q_home[delta.q_index(joint)] for joint in delta.actuated])
    line = np.linspace(-0.5, 0.5, 25)
    grid = [
        [a, b, c]
        for i, a in enumerate(line)
        for j, b in enumerate(_there_and_back(line, i))
        for c in _there_and_back(line, i + j)
    ]
    for name, mechanism, node, values, rotation in (
        ("panda, anywhere", arm, "panda_hand", anywhere, 3),
        ("delta4, a grid, closed", delta, "platform", home + np.array(grid), 0),
    ):
        cinegen.evaluate(mechanism, node, values[:2], 3, rotation)
        rates = []
        for _ in range(ROUNDS):
            begin = time.perf_counter()
            done = cinegen.evaluate(mechanism, node, values, 3, rotation)
            rates.append(len(values) / (time.perf_counter() - begin))
        closed = np.isfinite(done.closure).mean()
        print(f"{name:24}{np.median(rates):10,.0f} a second; {closed:.0%} closed, to {np.nanmax(done.closure):.0e}")


def _there_and_back(line: np.ndarray, turn: int) -> np.ndarray:
    return line if turn % 2 == 0 else line[::-1]


if __name__ == "__main__":
    measure_reach(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
    measure_evaluate()
