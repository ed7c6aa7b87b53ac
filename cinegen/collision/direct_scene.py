"""`scene_for`: the scene of a mechanism that a program has, without a file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.errors import SceneError
from cinegen.collision.obstacle import Obstacle
from cinegen.collision.scene import Scene, configuration_keys
from cinegen.collision.scene_file import scene_of
from cinegen.collision.scene_table import pose_keys
from cinegen.model import Mechanism

Goal: TypeAlias = "pin.SE3 | Sequence[float] | Array | Mapping[str, Any]"
"""Goal of `scene_for`."""

_GOAL_KEYS = ("point", "rpy", "angle", "joints", "tolerance", "cone")


def scene_for(
    mechanism: Mechanism,
    goal: Goal,
    *,
    start: Array | Sequence[float] | Mapping[str, float] | None = None,
    obstacles: Iterable[Mapping[str, Any] | Obstacle] = (),
    **keys: Any,
) -> Scene:
    """Return the scene of a mechanism; lengths in m, angles in rad, poses in the world.

    Args:
        mechanism: robot, as `cinegen.load` returns it.
        goal: goal of its end, or of `node`: a pose, or the three coordinates of a point; a mapping from joint names to
            values; or the keys of a scene's goal, such as `point`, `tolerance` and `cone`.
        start: (nq,) configuration, or a mapping from joint names to values, the others at home; home by default. Loops
            are closed.
        obstacles: each an `Obstacle`, or keys and values as in a file: `{"kind": "box", "size": [1, 1, 1], ...}`.
        keys: other keys of a scene's file, such as `node`, `safety`, `locked`, `weights`, `attached`.

    Raises:
        SceneError: a value is invalid; the message names the key.

    Example:
        `scene_for(arm, [0.5, 0.3, 0.4], obstacles=[{"kind": "sphere", "radius": 0.1, "point": [0.5, 0, 0.3]}])`
    """
    around = list(obstacles)
    made = [obstacle for obstacle in around if isinstance(obstacle, Obstacle)]
    values: dict[str, Any] = {"name": mechanism.name, "goal": _goal_keys(goal), **keys}
    values["obstacle"] = [dict(obstacle) for obstacle in around if not isinstance(obstacle, Obstacle)]
    if start is not None:
        values["start"] = _start_keys(mechanism, start)
    scene = scene_of(values, mechanism=mechanism)
    names = [*(obstacle.name for obstacle in (*scene.obstacles, *made)), *(held.name for held in scene.attached)]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise SceneError(f"obstacles: '{twice[0]}' is the name of two: give each another one")
    return replace(scene, obstacles=(*scene.obstacles, *made))


def _goal_keys(goal: Goal) -> dict[str, Any]:
    if isinstance(goal, pin.SE3):
        return pose_keys(goal)
    if isinstance(goal, Mapping):
        return dict(goal) if any(key in _GOAL_KEYS for key in goal) else {"joints": dict(goal)}
    try:
        point = np.asarray(goal, dtype=float)
    except (TypeError, ValueError):
        point = np.zeros(0)
    if point.shape != (3,):
        raise SceneError(
            f"goal must be a pose (pin.SE3), a point of 3 numbers, or joint names and values, not {goal!r:.60}"
        )
    return {"point": point.tolist()}


def _start_keys(mechanism: Mechanism, start: Any) -> dict[str, Any]:
    if isinstance(start, Mapping):
        return {"joints": dict(start)}
    q = np.asarray(start, dtype=float)
    if q.shape != (mechanism.model.nq,):
        raise SceneError(f"start must have {mechanism.model.nq} numbers, its shape is {q.shape}")
    return configuration_keys(mechanism, q)
