"""A seven-joint arm and a wall in its path: vortices guide it over the wall, at a safety distance."""

import tempfile
from pathlib import Path

import cinegen
from cinegen.collision import scene_of
from cinegen.mission import Recording
from cinegen.mission.results import record_plan
from cinegen.planning import plan
from cinegen.plotting import draw_plan

scene = scene_of(
    {
        "name": "wall",
        "safety": 0.02,  # m, safety distance
        "start": {"joints": {"joint1": -0.6}},
        "goal": {"point": [0.5, 0.35, 0.3]},  # of the tool, whatever its orientation
        "obstacle": [{"name": "wall", "kind": "box", "size": [0.7, 0.04, 0.45], "point": [0.55, 0.0, 0.225]}],
    },
    mechanism=cinegen.load("arm7"),
)

path = plan(scene)
for attempt in path.attempts:
    print(f"{attempt.strategy}: {attempt.status.value} after {len(attempt.path) - 1} steps")
print(f"{path}, clearance {1000 * path.clearance:.0f} mm everywhere; the tool moves {path.length:.2f} m")

folder = Path(tempfile.mkdtemp())
draw_plan(path).savefig(folder / "wall.png")
record_plan(path, folder / "wall.jsonl")  # for `cinegen replay` and `cinegen export`
print(f"{Recording.load(folder / 'wall.jsonl').seconds:.1f} s at the largest joint speeds")

other = plan(scene, seconds=5, planner="rrtconnect")  # on the same distances; needs the extra `sampling`
print(f"RRT-Connect: {other}, joints move by {other.motion:.1f} rad instead of {path.motion:.1f}")
