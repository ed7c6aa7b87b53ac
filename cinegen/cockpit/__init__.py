"""What one sees: robots in a page, and the cockpit that they are driven from."""

from cinegen.cockpit.cockpit import Cockpit, draw, standing, title_of
from cinegen.cockpit.film import film
from cinegen.cockpit.notebook import Shown, show, show_map
from cinegen.cockpit.page import Page
from cinegen.cockpit.scene import Scene, page_of

__all__ = ["Cockpit", "Page", "Scene", "Shown", "draw", "film", "page_of", "show", "show_map", "standing", "title_of"]
