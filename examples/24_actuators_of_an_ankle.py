"""Forces of the two actuators of a parallel ankle, from moments on the ground, over its whole range."""

import tempfile
from pathlib import Path

import numpy as np

import cinegen
from cinegen.plotting.sheet import label, sheet

ankle = cinegen.load("ankle")
PITCH, ROLL = 80.0, 20.0  # N m that the foot exerts on the ground: when it pushes off, and on its edge
pitches, rolls = np.arange(-30, 46, 5), np.arange(-20, 21, 5)  # degrees; pitch lowers the toes

# Moments are mapped to actuator forces by J^-T, whose columns are the forces for 1 N m about each axis.
largest, forces = np.full((len(rolls), len(pitches)), np.nan), {}
for i, roll in enumerate(rolls):
    for j, pitch in enumerate(pitches):
        guess = ankle.q_home.copy()
        guess[[ankle.q_index("joint1"), ankle.q_index("joint2")]] = np.radians([pitch, roll])
        q = ankle.close(guess, locked=["joint1", "joint2"])
        if ankle.limits.outside(q):
            continue
        axes = ankle.placement(q, "link1").rotation[:, 2], ankle.placement(q, "link2").rotation[:, 2]
        ground = [cinegen.Payload("platform", wrench=(0.0, 0.0, 0.0, *-axis)) for axis in axes]
        columns = [cinegen.InverseDynamics(ankle, [payload], gravity=(0.0, 0.0, 0.0)).torques(q) for payload in ground]
        forces[pitch, roll] = np.column_stack(columns)
        largest[i, j] = (np.abs(forces[pitch, roll]) @ [PITCH, ROLL]).max()

print(f"{len(forces)} of {largest.size} poses are within the limits of all joints")
print("at home 1 N m takes", " and ".join(f"{force:.2f} N" for force in forces[0, 0][0]), "on the left: pitch, roll")
i, j = np.unravel_index(np.nanargmax(largest), largest.shape)
most, limit = np.nanmax(largest), ankle.limits["joint5"].effort
print(f"at most {most:.0f} N, at pitch {pitches[j]} and roll {rolls[i]} degrees; at home {largest[4, 6]:.0f} N")
print(f"the actuators, with {limit:.0f} N, are {'strong enough' if most <= limit else 'too weak'}")
figure, body = sheet(6.0, 3.6, "Actuators of an ankle", f"largest force (N) at {PITCH:g} N m pitch, {ROLL:g} N m roll")
picture = (plot := body.subplots()).pcolormesh(pitches, rolls, largest, cmap="cividis")
figure.colorbar(picture), label(plot, "pitch (degrees)", "roll (degrees)")
figure.savefig(Path(tempfile.mkdtemp()) / "ankle.png")
