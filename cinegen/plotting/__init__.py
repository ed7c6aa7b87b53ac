"""Pictures on paper: mechanisms, maps, singular curves, fields and paths. Needs matplotlib, loaded when used."""

from cinegen.plotting.modes import DrawingError, draw_modes
from cinegen.plotting.paths import draw_plan
from cinegen.plotting.potentials import draw_potentials, figure1, figure2, figure3, figure4
from cinegen.plotting.skeleton import Skeleton
from cinegen.plotting.view import Projection, views

__all__ = [
    "DrawingError",
    "Projection",
    "Skeleton",
    "draw_modes",
    "draw_plan",
    "draw_potentials",
    "figure1",
    "figure2",
    "figure3",
    "figure4",
    "views",
]
