"""Pictures on paper of fields and ways. Needs matplotlib, which is loaded when used."""

from cinegen.avoid.drawing.paths import draw_plan
from cinegen.avoid.drawing.potentials import draw_potentials, figure1, figure2, figure3, figure4

__all__ = ["draw_plan", "draw_potentials", "figure1", "figure2", "figure3", "figure4"]
