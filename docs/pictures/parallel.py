"""Draws the pictures of docs/parallel.md again: `python docs/pictures/parallel.py [NAME ...]`. Takes a minute."""

import math

from figures import ROBOTS, write

import cinegen
from cinegen.plotting import draw_modes
from cinegen.plotting.loci import draw_loci
from cinegen.singularities.loci import singular_loci
from cinegen.singularities.slice import Axis, Slice
from raff2urdf.quantities import show_lengths_in


def modes():
    """Merlet's figure 5, and the mirror images below the base."""
    show_lengths_in("mm")
    return draw_modes(cinegen.assembly_modes(cinegen.load(ROBOTS / "tssm.raff")))


def five_bar():
    """All that its tool reaches with its elbows outside."""
    show_lengths_in("m")
    # An even count: the grid leaves out x = 0 and y = 0, where singularities of both types meet in one point.
    axes = Axis("x", -0.55, 0.55), Axis("y", -0.7, 0.7)
    return draw_loci(singular_loci(Slice(cinegen.load(ROBOTS / "five_bar.raff"), axes), 100))


def tssm():
    """Fichter's singularity: a platform that lies level, turned by a quarter of a turn."""
    show_lengths_in("mm")
    axes = Axis("x", -0.01, 0.01), Axis("rz", -math.radians(120), math.radians(120))
    return draw_loci(singular_loci(Slice(cinegen.load(ROBOTS / "tssm.raff"), axes, {"rx": 0.0, "ry": 0.0}), 40))


FIGURES = {
    "tssm_modes": modes,
    "five_bar_singular": five_bar,
    "tssm_singular": tssm,
}
"""What draws each of them."""


if __name__ == "__main__":
    write(FIGURES)
