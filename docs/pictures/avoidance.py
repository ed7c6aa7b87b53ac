"""Draws the pictures of docs/avoidance.md again: `python docs/pictures/avoidance.py [NAME ...]`. Takes 20 s."""

import sys
from functools import partial
from pathlib import Path

from figures import ROBOTS, write

from cinegen.collision import load_scene, scene_of
from cinegen.planning import plan
from cinegen.plotting import draw_plan

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "papers"))
from firas import firas
from vortex_figures import figure1, figure2, figure3, figure4

WALL = {
    "name": "wall",
    "robot": "arm7.raff",
    "safety": 0.02,
    "start": {"joints": {"joint1": -0.6}},
    "goal": {"point": [0.5, 0.35, 0.3]},
    "obstacle": [{"name": "wall", "kind": "box", "size": [0.7, 0.04, 0.45], "point": [0.55, 0.0, 0.225]}],
}


def way(name, field="vortex"):
    """A figure of the paper: what becomes of a scene."""
    scene = load_scene(ROBOTS / "scenes" / f"{name}.toml")
    return draw_plan(plan(scene, field=field, planner="vortex", shorten=False))


def wall():
    """A redundant arm in space."""
    return draw_plan(plan(scene_of(WALL, ROBOTS)))


FIGURES = {
    "avoid_rod_potential": figure1,
    "avoid_vortex_potential": figure2,
    "avoid_rod_and_vortex": figure3,
    "avoid_discarding": figure4,
    "avoid_rod_firas": partial(way, "rod", firas),
    "avoid_rod": partial(way, "rod"),
    "avoid_disc_firas": partial(way, "disc", firas),
    "avoid_disc": partial(way, "disc"),
    "avoid_discs": partial(way, "discs"),
    "avoid_generic": partial(way, "generic"),
    "avoid_wall": wall,
}
"""What draws each of them: figures 1 to 10 of De Medio and Oriolo in their order, and one in space."""


if __name__ == "__main__":
    write(FIGURES)
