"""Generated C and JavaScript beside Python: differences over many closed configurations, and the time of a tick.

    python benchmarks/generated.py [COUNT] [ROBOT ...]

Actuated joints move to COUNT random values (100,000 unless given), one after the other; all robots of robots/ unless
named. C and JavaScript then move to those that Python reached, and to some of the others, which they may not reach.

Rounding moves a configuration by about the machine's epsilon, divided by the smallest singular value of the passive
joints in the loops: no less can be expected of two programs that round in different ways. So differences are listed as
they are (rad, m), where that singular value is at least 0.01; and divided by this expectation, for all. Where they are
largest, errors of all three are computed with mpmath: see `exact_loops.py`.

Needs gcc and node.
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from bench import ROBOTS
from exact_loops import closed_exactly, distance

import cinegen
from cinegen.codegen import Function, Language, generate
from cinegen.jit.foreign import frame_of
from cinegen.model import ForwardKinematics

TICKS = 100_000
UNREACHED = 100  # values that Python did not reach which the others are given
REGULAR = 0.01  # singular value of configurations that are not near a singularity
WORST = 5  # configurations at which errors are computed
EPSILON = float(np.finfo(float).eps)
NODE = """
import create from "./robot.mjs";
import { readFileSync, writeFileSync } from "node:fs";
const robot = create(), [count, width] = process.argv.slice(2).map(Number);
const values = new Float64Array(new Uint8Array(readFileSync("values.bin")).buffer); // small files share one
const found = new Float64Array(count * (robot.q.length + 12));
for (let i = 0; i < count; i += 1) {
  if (!robot.forward(values.subarray(i * width, (i + 1) * width))) {
    found.fill(NaN, i * (robot.q.length + 12), (i + 1) * (robot.q.length + 12));
    continue;
  }
  robot.place();
  found.set(robot.q, i * (robot.q.length + 12));
  found.set(robot.frames.subarray(-12), i * (robot.q.length + 12) + robot.q.length);
}
writeFileSync("found.bin", found);
robot.init();
const begin = robot.targets[0].slice(), start = performance.now();
for (let i = 0; i < TICKS; i += 1) {
  robot.targets[0][9] = begin[9] + 0.05 * Math.sin(i * 1e-3);
  robot.tick();
}
console.log((performance.now() - start) / TICKS * 1e3);
""".replace("TICKS", str(TICKS))
CLOCK = """
#include "robot.h"
#include <math.h>
#include <time.h>
double microseconds(void);
double microseconds(void) {
  static robot_robot robot;
  robot_init(&robot);
  double *target = robot_target(&robot, 0), begin = target[9];
  const clock_t start = clock();
  for (int i = 0; i < TICKS; i++) {
    target[9] = begin + 0.05 * sin(i * 1e-3);
    robot_tick(&robot);
  }
  return 1e6 * (double) (clock() - start) / CLOCKS_PER_SEC / TICKS;
}
""".replace("TICKS", str(TICKS))


def in_python(mechanism: cinegen.Mechanism, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return configurations (n, nq), and frames of the last node (n, 12); NaN where values can't be reached."""
    motion, node = ForwardKinematics(mechanism), mechanism.nodes[-1]
    q, frames = np.full((len(values), mechanism.model.nq), np.nan), np.full((len(values), 12), np.nan)
    for i, joint_values in enumerate(values.tolist()):
        try:
            q[i] = motion.move(dict(zip(mechanism.actuated, joint_values, strict=True)))
        except cinegen.ClosureError:
            continue
        frames[i] = frame_of(mechanism.placement(q[i], node)).ravel()
    return q, frames


def in_c(folder: Path, mechanism: cinegen.Mechanism, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the same from C, and the time of a tick, us."""
    for name, text in {**generate(mechanism, Language.C, name="robot"), "clock.c": CLOCK}.items():
        (folder / name).write_text(text)
    command = ["gcc", "-std=gnu99", "-O2", "-shared", "-fPIC", "robot.c", "clock.c", "-o", "robot.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    code, doubles = ctypes.CDLL(str(folder / "robot.so")), ctypes.POINTER(ctypes.c_double)
    code.microseconds.restype = ctypes.c_double
    code.robot_q.restype = code.robot_node.restype = doubles
    code.robot_forward.restype = ctypes.c_bool
    robot = ctypes.create_string_buffer(1 << 20)
    code.robot_init(robot)
    q = np.ctypeslib.as_array(code.robot_q(robot), (mechanism.model.nq,))
    frame = np.ctypeslib.as_array(code.robot_node(robot, len(mechanism.nodes) - 1), (12,))
    reached, frames = np.full((len(values), len(q)), np.nan), np.full((len(values), 12), np.nan)
    for i, row_values in enumerate(np.ascontiguousarray(values)):
        if code.robot_forward(robot, row_values.ctypes.data_as(doubles)):
            code.robot_place(robot)
            reached[i], frames[i] = q, frame
    return reached, frames, float(code.microseconds())


def in_node(folder: Path, mechanism: cinegen.Mechanism, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the same from JavaScript."""
    functions = (Function.FORWARD, Function.TICK)
    for name, text in generate(mechanism, Language.JAVASCRIPT, name="robot", functions=functions).items():
        (folder / name).write_text(text)
    (folder / "values.bin").write_bytes(values.tobytes())
    (folder / "run.mjs").write_text(NODE)
    command = ["node", "run.mjs", str(len(values)), str(values.shape[1])]
    said = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout
    rows = np.fromfile(folder / "found.bin").reshape(len(values), -1)
    return rows[:, :-12], rows[:, -12:], float(said)


def tick_in_python(mechanism: cinegen.Mechanism) -> float:
    """Return the time of a tick of the solver, us."""
    solver = cinegen.Solver(mechanism, 1.0 / 240.0)
    task = solver.add_task(mechanism.end)
    begin, count = task.target.translation.copy(), TICKS // 5
    start = time.process_time()
    for i in range(count):
        task.target.translation = begin + np.array([0.05 * np.sin(i * 1e-3), 0.0, 0.0])
        solver.step()
    return 1e6 * (time.process_time() - start) / count


def conditioning(mechanism: cinegen.Mechanism, q: np.ndarray) -> np.ndarray:
    """Return of configurations (n, nq) the smallest singular value of the passive joints in the loops (n,), or 1."""
    columns, rank = mechanism.structure.passive_columns, mechanism.structure.passive_rank
    if rank == 0:
        return np.ones(len(q))
    jacobians = np.array([mechanism.structure.system.evaluate(q_row)[1][:, columns] for q_row in q])
    return np.asarray(np.linalg.svd(jacobians, compute_uv=False)[:, rank - 1])


def main() -> None:
    """Print a table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    names = sys.argv[2:] or sorted(path.stem for path in ROBOTS.glob("*.raff") if path.stem != "two_arms")
    print(f"{count} values. Largest differences of configurations and frames from Python, with a singular value of at")
    print(f"least {REGULAR}; of configurations by epsilon / singular value; largest errors by the same; us of a tick\n")
    titles = ("reached", "sigma", "C", "node", "C/(e/s)", "node/(e/s)", *("Python", "C", "node") * 2)
    print(f"{'robot':20}" + "".join(f"{title:>11}" for title in titles))
    for name in names:
        print(row(name, count), flush=True)


def row(name: str, count: int) -> str:
    """Return the line of a robot."""
    mechanism, rng = cinegen.load(name), np.random.default_rng(0)
    home = np.array([mechanism.q_home[mechanism.q_index(joint)] for joint in mechanism.actuated])
    sizes = np.array([mechanism.scale[mechanism.v_index(joint)] for joint in mechanism.actuated])
    values = home + 0.2 * sizes * rng.uniform(-1.0, 1.0, (count, len(home)))
    wanted = in_python(mechanism, values)
    reached = np.isfinite(wanted[0]).all(axis=1)
    reaches = reached.sum()
    reached |= (~reached).cumsum() <= UNREACHED
    values, wanted = values[reached], (wanted[0][reached], wanted[1][reached])
    with tempfile.TemporaryDirectory() as folder:
        *c, c_time = in_c(Path(folder), mechanism, values)
        *node, node_time = in_node(Path(folder), mechanism, values)
    known = [np.isfinite(result[0]).all(axis=1) for result in (wanted, c, node)]
    same = (known[0] == known[1]).all() and (known[0] == known[2]).all()
    q = [result[0][known[0]] for result in (wanted, c, node)]
    sigma = conditioning(mechanism, q[0])
    apart = [
        np.max([np.abs(a - b)[known[0]].max(axis=1) for a, b in zip(wanted, result, strict=True)], axis=0)
        for result in (c, node)
    ]
    in_q = [np.abs(other - q[0]).max(axis=1) for other in q[1:]]
    expected = EPSILON / sigma
    cells = [f"{reaches:11}", f"{sigma.min():11.1e}"]
    cells += [f"{gap[sigma >= REGULAR].max():11.1e}" for gap in apart]
    cells += [f"{(gap / expected).max():11.1f}" for gap in in_q]
    errors = np.zeros(3)
    if mechanism.is_constrained:
        for i in {int(i) for gap in (*in_q, *(gap / expected for gap in in_q)) for i in np.argsort(-gap)[:WORST]}:
            exact = closed_exactly(mechanism, q[0][i])
            errors = np.maximum(errors, [distance(solutions[i], exact) / expected[i] for solutions in q])
    cells += [f"{number:11.1f}" for number in (*errors, tick_in_python(mechanism), c_time, node_time)]
    return f"{name:20}{''.join(cells)}" + ("" if same else "  not the same are reached")


if __name__ == "__main__":
    main()
