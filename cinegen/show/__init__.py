"""What one sees: mechanisms in a meshcat page."""

from cinegen.show.drive import Driven, drive, page_of
from cinegen.show.page import Page
from cinegen.show.scene import Scene

__all__ = ["Driven", "Page", "Scene", "drive", "page_of"]
