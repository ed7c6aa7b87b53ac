"""Compile the generated C of a delta into a loop like a firmware's: 1000 ticks a second along a circle (needs gcc)."""

import subprocess
import tempfile
from pathlib import Path

import numpy as np

import cinegen
from cinegen.codegen import Function, Language, generate

FIRMWARE = r"""
#include "delta4.h"
#include <math.h>
#include <stdio.h>
static delta4_robot robot;                  /* all of its memory */
static void write_drives(const double *q) { /* here a firmware moves its actuators to q[0], q[10] and q[5] */
  for (int i = 0; i < delta4_NQ; i++) printf("%.17g ", q[i]);
}
int main(void) {
  delta4_init(&robot);
  double *target = delta4_target(&robot, 0);  /* its origin: [9], [10], [11] */
  for (int tick = 0; tick < 4000; tick++) {   /* here a firmware waits for its timer */
    const double angle = 6.283185307179586 * tick / 2000.0, radius = tick < 2000 ? 0.2 * tick / 2000.0 : 0.2;
    target[9] = radius * cos(angle), target[10] = radius * sin(angle);
    if (delta4_tick(&robot) < delta4_FOLLOWING) return 1;
    write_drives(delta4_q(&robot));
  }
}
"""
delta, folder = cinegen.load("delta4"), Path(tempfile.mkdtemp())
files = generate(delta, Language.C, functions=[Function.TICK], dt=1e-3, name="delta4")
for name, text in {**files, "firmware.c": FIRMWARE}.items():
    (folder / name).write_text(text)
subprocess.run(["gcc", "-std=c99", "-Os", "delta4.c", "firmware.c", "-o", "firmware", "-lm"], cwd=folder, check=True)
run = subprocess.run([folder / "firmware"], check=True, capture_output=True, text=True).stdout
q = np.array(run.split(), dtype=float).reshape(4000, -1)
radii = [np.hypot(*delta.placement(row, "platform").translation[:2]) for row in q[2000:]]
print(f"4000 ticks: loops are open by {max(map(delta.closure, q)):.0e} at most,")
print(f"the platform is {1e9 * np.abs(np.array(radii) - 0.2).max():.1g} nm off the circle at most")
