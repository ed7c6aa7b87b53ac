"""The cockpit: robots in a page, and the server from which they are driven."""

from cinegen.cockpit.cockpit import Cockpit, base_poses_at_start, draw, title_of
from cinegen.cockpit.film import film
from cinegen.cockpit.notebook import show, show_map
from cinegen.cockpit.page import Page
from cinegen.cockpit.scene import RobotScene, make_page
from cinegen.cockpit.viewer import Viewer
from cinegen.cockpit.watched_files import SetupFiles

__all__ = [
    "Cockpit",
    "Page",
    "RobotScene",
    "SetupFiles",
    "Viewer",
    "base_poses_at_start",
    "draw",
    "film",
    "make_page",
    "show",
    "show_map",
    "title_of",
]
