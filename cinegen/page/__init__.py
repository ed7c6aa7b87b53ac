"""Pages without a server: one HTML file that holds robots, the cockpit's page, and the solver in JavaScript."""

from cinegen.page.build import build_page

__all__ = ["build_page"]
