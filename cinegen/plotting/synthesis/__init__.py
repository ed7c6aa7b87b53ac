"""Reports of syntheses, and pictures of their robots."""

from cinegen.plotting.synthesis.report import synthesis_report
from cinegen.plotting.synthesis.robots import draw_designs

__all__ = ["draw_designs", "synthesis_report"]
