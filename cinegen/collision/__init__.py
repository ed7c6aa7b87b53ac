"""Collision geometry: shapes of links, scenes with obstacles, and the distances between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from raff2urdf.lazy import lazy_names

if TYPE_CHECKING:
    from cinegen.collision.clearance import Clearance as Clearance
    from cinegen.collision.clearance import clearance_of as clearance_of
    from cinegen.collision.direct_scene import scene_for as scene_for
    from cinegen.collision.errors import PlanningError as PlanningError
    from cinegen.collision.errors import SceneError as SceneError
    from cinegen.collision.obstacle import Obstacle as Obstacle
    from cinegen.collision.scene import Scene as Scene
    from cinegen.collision.scene_file import load_scene as load_scene
    from cinegen.collision.scene_file import scene_of as scene_of

__all__, __getattr__, __dir__ = lazy_names(__name__)
