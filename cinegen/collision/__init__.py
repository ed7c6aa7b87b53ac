"""What a robot may hit: the shapes of its links, scenes with obstacles, and distances between them."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from cinegen.collision.errors import AvoidError, SceneError

if TYPE_CHECKING:
    from cinegen.collision.around import surroundings
    from cinegen.collision.scene import Scene, load_scene, scene_of

__all__ = ["AvoidError", "Scene", "SceneError", "load_scene", "scene_of", "surroundings"]


def __getattr__(name: str) -> object:
    """Load scenes when they are asked for: a distance needs none."""
    if name == "surroundings":
        return import_module("cinegen.collision.around").surroundings
    if name in __all__:
        return getattr(import_module("cinegen.collision.scene"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
