"""Choose actuators for a delta robot: 10 kg go a metre aside and back; what that takes, and which actuator gives it."""

import tempfile
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

import cinegen
from cinegen.dynamics.trajectory import torques_along
from cinegen.mission import MissionRecorder, Recording, RobotSample, resampled
from cinegen.plotting.sheet import INK, ORANGE, label, sheet

delta, load = cinegen.load("delta4"), cinegen.Payload("platform", mass=10.0)
task = (solver := cinegen.Solver(delta, dt=1 / 240)).add_task("platform", rotation=0)
middle, folder = task.target.translation.copy(), Path(tempfile.mkdtemp())
corners = [-0.5, 0, -0.6], [-0.45, 0, -0.35], [0, 0, -0.3], [0.45, 0, -0.35], [0.5, 0, -0.6]  # m
arc = CubicSpline(range(5), corners)(np.linspace(0.0, 4.0, 41))
with MissionRecorder(folder / "cycle.jsonl", {"delta4": delta}) as recorder:
    for k, offset in enumerate([*arc, *arc[-2::-1]]):
        task.target.translation = middle + offset
        q = [solver.step().q for _ in range(240 if k == 0 else 40)][-1]
        recorder.write(0.1 * k, {"delta4": RobotSample(q, "FOLLOWING")})

# %% The fastest timing within 180 degrees/s and 12 rad/s^2, not jerky, and what the joint that works hardest takes.
timed = resampled(Recording.load(recorder.path), rate=250.0, speed=np.inf, acceleration=12.0, jerk=150.0)
need = torques_along(cinegen.InverseDynamics(delta, [load]), timed.times, timed.q)
peak, rms, fast, power = (float(np.abs(values).max()) for values in (need.peak, need.rms, need.speeds, need.peak_power))
print(f"{timed.seconds:.2f} s: {peak:.0f} N m peak, {rms:.0f} N m RMS, {fast:.2f} rad/s, {power / 1000:.1f} kW")

# %% Actuators with their gears, at the output: rated and peak torque (N m), speed (rad/s).
figure, body = sheet(6.0, 4.0, "Actuators of a delta robot", "torques over speeds of all joints, and what each can do")
(axes := body.subplots()).plot(np.abs(need.speeds), np.abs(need.torques), ".", color=INK, markersize=2)
for name, rated, most, speed in (("S", 500, 1500, 3.5), ("M", 1500, 3200, 2.5), ("L", 2500, 5000, 1.6)):
    lacks = [what for what, is_so in (("weak", peak > most), ("hot", rms > rated), ("slow", fast > speed)) if is_so]
    print(f"{name} {most:5} N m: {'too ' + ' and '.join(lacks) if lacks else 'suits'}")
    axes.plot([0, speed, speed], [most, most, 0], color=ORANGE)
    axes.annotate(f"{name}, rated {rated} N m", (speed, most), va="bottom", ha="right")
label(axes, "speed (rad/s)", "torque (N m)")
figure.savefig(folder / "actuators.png")
