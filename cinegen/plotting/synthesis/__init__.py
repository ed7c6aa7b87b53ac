"""Reports of syntheses."""

from cinegen.plotting.synthesis.report import synthesis_report

__all__ = ["synthesis_report"]
