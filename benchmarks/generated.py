"""Generated C and JavaScript beside Python: differences over many closed configurations, and the time of a tick.

    python benchmarks/generated.py [COUNT] [ROBOT ...]

Actuated joints move to COUNT random values (100,000 unless given), one after the other; all robots of robots/ unless
named. Needs gcc and node.
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import cinegen
from cinegen.codegen import Function, Language, generate
from cinegen.jit.foreign import frame_of
from cinegen.model import ForwardKinematics

ROOT = Path(__file__).parent.parent
TICKS = 100_000
NODE = """
import create from "./robot.mjs";
import { readFileSync, writeFileSync } from "node:fs";
const robot = create(), [count, width] = process.argv.slice(2).map(Number);
const values = new Float64Array(readFileSync("values.bin").buffer.slice(0, 8 * count * width));
const found = new Float64Array(count * (robot.q.length + 12));
for (let i = 0; i < count; i += 1) {
  robot.forward(values.subarray(i * width, (i + 1) * width));
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
    for i, given in enumerate(values.tolist()):
        try:
            q[i] = motion.move(dict(zip(mechanism.actuated, given, strict=True)))
        except cinegen.ClosureError:
            continue
        frames[i] = frame_of(mechanism.placement(q[i], node)).ravel()
    return q, frames


def in_c(folder: Path, mechanism: cinegen.Mechanism, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the same from C, and the time of a tick, us."""
    for name, text in generate(mechanism, Language.C, name="robot").items():
        (folder / name).write_text(text)
    (folder / "clock.c").write_text(CLOCK)
    command = ["gcc", "-std=gnu99", "-O2", "-shared", "-fPIC", "robot.c", "clock.c", "-o", "robot.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    code, doubles = ctypes.CDLL(str(folder / "robot.so")), ctypes.POINTER(ctypes.c_double)
    code.robot_q.restype = code.robot_node.restype = doubles
    code.robot_forward.restype, code.microseconds.restype = ctypes.c_bool, ctypes.c_double
    robot = ctypes.create_string_buffer(1 << 20)
    code.robot_init(robot)
    q = np.ctypeslib.as_array(code.robot_q(robot), (mechanism.model.nq,))
    frame = np.ctypeslib.as_array(code.robot_node(robot, len(mechanism.nodes) - 1), (12,))
    found, frames = np.full((len(values), len(q)), np.nan), np.full((len(values), 12), np.nan)
    for i, given in enumerate(np.ascontiguousarray(values)):
        if code.robot_forward(robot, given.ctypes.data_as(doubles)):
            code.robot_place(robot)
            found[i], frames[i] = q, frame
    return found, frames, float(code.microseconds())


def in_node(folder: Path, mechanism: cinegen.Mechanism, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the same from JavaScript."""
    functions = (Function.FORWARD, Function.TICK)
    for name, text in generate(mechanism, Language.JAVASCRIPT, name="robot", functions=functions).items():
        (folder / name).write_text(text)
    (folder / "values.bin").write_bytes(values.tobytes())
    (folder / "run.mjs").write_text(NODE)
    command = ["node", "run.mjs", str(len(values)), str(values.shape[1])]
    said = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout
    found = np.fromfile(folder / "found.bin").reshape(len(values), -1)
    return found[:, :-12], found[:, -12:], float(said)


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


def main() -> None:
    """Print a table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    names = sys.argv[2:] or sorted(path.stem for path in (ROOT / "robots").glob("*.raff") if path.stem != "two_arms")
    print(f"{count} configurations: largest differences from Python; us of a tick\n")
    print(f"{'robot':20}{'reached':>9}{'C':>9}{'node':>9}{'Python us':>11}{'C us':>7}{'node us':>9}")
    for name in names:
        mechanism, rng = cinegen.load(name), np.random.default_rng(0)
        home = np.array([mechanism.q_home[mechanism.q_index(joint)] for joint in mechanism.actuated])
        sizes = np.array([mechanism.scale[mechanism.v_index(joint)] for joint in mechanism.actuated])
        values = home + 0.2 * sizes * rng.uniform(-1.0, 1.0, (count, len(home)))
        wanted = in_python(mechanism, values)
        with tempfile.TemporaryDirectory() as folder:
            *c, c_time = in_c(Path(folder), mechanism, values)
            *node, node_time = in_node(Path(folder), mechanism, values)
        reached = np.isfinite(wanted[0]).all(axis=1)
        same = (np.isfinite(c[0]).all(axis=1) == reached).all()
        apart = [
            max(np.abs(a[reached] - b[reached]).max() for a, b in zip(wanted, one, strict=True)) for one in (c, node)
        ]
        print(
            f"{name:20}{reached.sum():9}{apart[0]:9.1e}{apart[1]:9.1e}{tick_in_python(mechanism):11.1f}{c_time:7.1f}"
            f"{node_time:9.1f}" + ("" if same else "  not the same are reached")
        )


if __name__ == "__main__":
    main()
