"""Draws the pictures of docs/forces.md again: `python docs/pictures/forces.py [NAME ...]`."""

import runpy
from functools import partial

from figures import ROBOTS, write


def figure(example):
    """The figure that an example draws."""
    return runpy.run_path(str(ROBOTS.parent / "examples" / f"{example}.py"))["figure"]


FIGURES = {
    "forces_delta4": partial(figure, "22_actuators_of_a_delta"),
    "forces_four_bar": partial(figure, "23_bearings_of_a_press"),
    "forces_ankle": partial(figure, "24_actuators_of_an_ankle"),
}
"""What draws each of them."""


if __name__ == "__main__":
    write(FIGURES)
