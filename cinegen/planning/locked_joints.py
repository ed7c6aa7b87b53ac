"""Scenes whose locked joints cannot move."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from cinegen.collision.mesh_pairs import mesh_pairs
from cinegen.collision.scene import Scene
from cinegen.collision.self_collision import link_pairs
from cinegen.joints import supporting_columns


def with_joints_locked(scene: Scene) -> Scene:
    """Return a scene as planners see it: both limits of its locked joints are their values at the start.

    Links that cannot move relative to each other then are not checked against each other: no path could separate them.
    """
    if not scene.locked:
        return scene
    mechanism, model = scene.mechanism, scene.mechanism.model
    values = {name: float(scene.start[mechanism.q_index(name)]) for name in scene.locked}
    free = np.ones(model.nv)
    free[[mechanism.v_index(name) for name in scene.locked]] = 0.0
    joints = [model.frames[mechanism.frame_id(node)].parentJoint for node in mechanism.nodes]
    moved = [tuple(free * supporting_columns(model, joint)) for joint in joints]
    rigid = [
        (node, other)
        for (node, first), (other, second) in combinations(zip(mechanism.nodes, moved, strict=True), 2)
        if first == second
    ]
    fixed = {frozenset(pair) for pair in rigid}
    attached = [
        replace(
            load, touches=(*load.touches, *(name for name in mechanism.nodes if frozenset((name, load.node)) in fixed))
        )
        for load in scene.attached
    ]
    return replace(
        scene,
        attached=tuple(attached),
        mechanism=mechanism.structure.with_locked(values, link_pairs, mesh_pairs),
        allowed_collisions=(*scene.allowed_collisions, *rigid),
    )
