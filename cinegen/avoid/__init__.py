"""Ways around obstacles: scenes, and vortex fields for any robot (De Medio and Oriolo, 1991)."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from cinegen.avoid.errors import AvoidError, SceneError

if TYPE_CHECKING:
    from cinegen.avoid.around import surroundings
    from cinegen.avoid.hand import AvoidingSolver
    from cinegen.avoid.planner import Plan, Verdict, plan, rrt_connect
    from cinegen.avoid.scene import Scene, load_scene, scene_of

__all__ = [
    "AvoidError",
    "AvoidingSolver",
    "Plan",
    "Scene",
    "SceneError",
    "Verdict",
    "load_scene",
    "plan",
    "rrt_connect",
    "scene_of",
    "surroundings",
]

_PLANNER, _SCENE = "cinegen.avoid.planner", "cinegen.avoid.scene"
_WHERE = {
    "AvoidingSolver": "cinegen.avoid.hand",
    "Plan": _PLANNER,
    "Scene": _SCENE,
    "Verdict": _PLANNER,
    "load_scene": _SCENE,
    "plan": _PLANNER,
    "rrt_connect": _PLANNER,
    "scene_of": _SCENE,
    "surroundings": "cinegen.avoid.around",
}


def __getattr__(name: str) -> object:
    """Planners are loaded when somebody asks for them: whoever needs a field, or a distance, does not."""
    if name in _WHERE:
        return getattr(import_module(_WHERE[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
