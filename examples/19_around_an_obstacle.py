"""A seven-joint arm with a wall in its way: over it by vortices, and how clear of everything it stays all along."""

import tempfile
from pathlib import Path

from cinegen.collision import scene_of
from cinegen.errors import CinegenError
from cinegen.mission import Recording
from cinegen.mission.results import record_plan
from cinegen.planning import plan, rrt_connect
from cinegen.plotting import draw_plan

scene = scene_of(
    {
        "name": "wall",
        "robot": "robots/arm7.raff",
        "safety": 0.02,  # m, to be kept
        "start": {"joints": {"joint1": -0.6}},
        "goal": {"point": [0.5, 0.35, 0.3]},  # of the tool, whatever its orientation
        "obstacle": [{"name": "wall", "kind": "box", "size": [0.7, 0.04, 0.45], "point": [0.55, 0.0, 0.225]}],
    }
)

way = plan(scene)
for attempt in way.attempts:
    print(f"{attempt.words}: {attempt.status.value} after {len(attempt.path) - 1} steps")
print(f"{way}, {1000 * way.clearance:.0f} mm clear of everything all along; the tool goes {way.length:.2f} m")

folder = Path(tempfile.mkdtemp())
draw_plan(way).savefig(folder / "wall.png")
record_plan(way, folder / "wall.jsonl")  # for `cinegen replay` and `cinegen export`
print(f"{Recording.load(folder / 'wall.jsonl').seconds:.1f} s, as fast as its joints may go")

try:
    other = rrt_connect(scene, seconds=5)  # on the same distances
    print(f"RRT-Connect: {other}, joints move by {other.motion:.1f} rad instead of {way.motion:.1f}")
except CinegenError as error:  # without the package ompl
    print(error)
