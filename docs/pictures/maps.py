"""Draws the pictures of docs/maps.md again: `python docs/pictures/maps.py [NAME ...]`. Takes a minute."""

from pathlib import Path
from tempfile import TemporaryDirectory

from figures import ROBOTS, write

import cinegen
from cinegen.plotting.map import draw_map
from cinegen.workspace import GridAxis, MapSpecification, Region, make_map


def map_of(name, axes, quantity, **more):
    """A map of a robot, drawn."""
    region = Region(tuple(GridAxis(*axis) for axis in axes), **more)
    spec = MapSpecification(cinegen.load(ROBOTS / f"{name}.raff"), region, ("sigma_1", "sigma_2", "condition"))
    with TemporaryDirectory() as folder:
        return draw_map(make_map(spec, Path(folder) / f"{name}.zarr", workers=1), quantity, name=name)


FIGURES = {
    "map_five_bar": lambda: map_of("five_bar", [("x", -0.42, 0.42, 80), ("y", 0.0, 0.72, 80)], "sigma_1"),
    "map_five_bar_motors": lambda: map_of("five_bar", [("joint1", 1.1, 3.4, 80), ("joint3", -0.3, 2.0, 80)], "sigma_2"),
    "map_gough": lambda: map_of(
        "gough", [("x", -0.6, 0.6, 60), ("y", -0.6, 0.6, 60)], "condition", at={"rx": 0.0, "ry": 0.0, "rz": 0.0}
    ),
    "map_delta4": lambda: map_of(
        "delta4", [("x", -2.7, 2.9, 36), ("y", -2.8, 2.8, 36), ("z", -5.4, -0.8, 36)], "sigma_1"
    ),
}


if __name__ == "__main__":
    write(FIGURES)
