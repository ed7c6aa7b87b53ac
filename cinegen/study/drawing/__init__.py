"""Pictures on paper: mechanisms as skeletons, seen from several sides. Needs matplotlib, which is loaded when used."""

from cinegen.study.drawing.modes import DrawingError, draw_modes
from cinegen.study.drawing.skeleton import Skeleton
from cinegen.study.drawing.view import View, views

__all__ = ["DrawingError", "Skeleton", "View", "draw_modes", "views"]
