"""Scenes: a robot, what stands in its way, where it starts and where it is to go; written as TOML or JSON."""

from cinegen.collision.scene.obstacle import Obstacle
from cinegen.collision.scene.reading import load_scene, scene_of
from cinegen.collision.scene.scene import Scene

__all__ = ["Obstacle", "Scene", "load_scene", "scene_of"]
