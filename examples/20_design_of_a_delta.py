"""Choose the forearm of a delta robot: from the task to a RAFF file, with the figures that decide."""

# %% The task: a box of 1600 by 1600 by 800 mm, 1.6 m below the base, all of it reached and without a singularity.
import tempfile
from pathlib import Path

import cinegen
from cinegen.plotting.sweep import draw_sweep
from cinegen.workspace import GridAxis, Region
from cinegen.workspace.sweep import Variation, WantedBox, sweep

region = Region((GridAxis("x", -1.0, 1.0, 10), GridAxis("y", -1.0, 1.0, 10), GridAxis("z", -2.6, -1.4, 6)))
wanted = WantedBox({"x": (-0.8, 0.8), "y": (-0.8, 0.8), "z": (-2.4, -1.6)})

# %% What varies: the forearms of all three arms together, so that the robot stays symmetric. A map for each.
forearms = Variation.parse("link4.d+link9.d+link15.d=2750..3750:5")  # mm
folder = Path(tempfile.mkdtemp())
table = sweep("delta4", [forearms], region, folder, box=wanted)

# %% What was found. 1/condition is 1 where the platform moves equally well in all directions, and 0 where it is stuck.
print(table.text())
draw_sweep(table).savefig(folder / "forearms.png")

# %% The decision: of those that do the whole task the one that moves best where it moves worst.
best = max(table.suitable, key=lambda row: row.dexterity.conditioning.worst)
print(f"{len(table.suitable)} of {len(table.rows)} do the whole task; {best.name} does it best")
print("    1/condition at worst", round(best.dexterity.conditioning.worst, 2), "and it reaches", best.extent)

# %% The result is a robot like any other.
robot = cinegen.load(folder / best.name / "robot.raff")
print(f"    home is {-1000 * robot.placement(robot.q_home, 'platform').translation[2]:.0f} mm below the base")
