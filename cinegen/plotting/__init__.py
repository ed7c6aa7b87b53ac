"""Pictures on paper: mechanisms, maps, singular curves, fields and paths. Needs matplotlib: imported to draw."""

from raff2urdf.command.extras import needs

with needs("plot", "pictures"):
    import matplotlib as matplotlib
from cinegen.plotting.joints import draw_joints
from cinegen.plotting.modes import DrawingError, draw_modes
from cinegen.plotting.plan import draw_plan
from cinegen.plotting.skeleton import Skeleton
from cinegen.plotting.synthesis import draw_designs, synthesis_report
from cinegen.plotting.view import Projection, views

__all__ = [
    "DrawingError",
    "Projection",
    "Skeleton",
    "draw_designs",
    "draw_joints",
    "draw_modes",
    "draw_plan",
    "synthesis_report",
    "views",
]
