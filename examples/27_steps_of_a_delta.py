"""Generate the steps of a delta's stepper motors along a line, as Klipper does, with generated C (needs gcc)."""

import subprocess
import tempfile
from pathlib import Path

import numpy as np

import cinegen
from cinegen.codegen import Function, Language, generate

PLANNER = r"""
#include "delta4.h"
#include <math.h>
#include <stdio.h>
int main(void) {  /* 0.6 m in 1 s, from rest to rest: ticks of 1 ms, steps of 2 pi / 32000 in between */
  static delta4_robot robot;
  const double turn = 6.283185307179586, step = turn / 32000.0;
  double done[3] = {0.0, 0.0, 0.0}, before[3] = {0.0, 0.0, 0.0}, now;
  delta4_init(&robot);
  for (int tick = 1; tick <= 1000; tick++) {
    delta4_target(&robot, 0)[9] = 0.6 * (1e-3 * tick - sin(turn * 1e-3 * tick) / turn);
    if (delta4_tick(&robot) < delta4_FOLLOWING) return 1;
    for (int i = 0; i < 3; before[i++] = now) /* delta4.h lists which numbers of q are the actuated joints' */
      for (now = delta4_q(&robot)[(const int[]) {0, 10, 5}[i]]; fabs(now / step - done[i]) > 0.5;) {
        const double sign = now > before[i] ? 1.0 : -1.0, due = (done[i] + 0.5 * sign) * step;
        printf("%d %g %.9f\n", i, sign, 1e-3 * (tick - 1 + (due - before[i]) / (now - before[i])));
        done[i] += sign;
      }
}}
"""
delta, folder = cinegen.load("delta4"), Path(tempfile.mkdtemp())
files = generate(delta, Language.C, functions=[Function.TICK], dt=1e-3, name="delta4") | {"planner.c": PLANNER}
for name, text in files.items():
    (folder / name).write_text(text)
subprocess.run(["gcc", "-std=c99", "-O2", "delta4.c", "planner.c", "-o", "planner", "-lm"], cwd=folder, check=True)
motors, signs, times = np.loadtxt(subprocess.check_output([folder / "planner"], text=True).splitlines()).T
ends = {name: 2 * np.pi / 32000 * signs[motors == i].sum() for i, name in enumerate(delta.actuated)}
end = delta.placement(delta.close(delta.configuration(ends), locked=tuple(ends)), "platform").translation
print(f"{len(times)} steps; they end {1e3 * np.hypot(end[0] - 0.6, end[1]):.2f} mm from the end of the line")
