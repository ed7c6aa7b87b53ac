"""Random scenes of `avoidance.py`: a family of them each, made again from a number.

    point    a mobile point crosses a field of 10 x 6 m among six convex obstacles, at least 0.15 m apart
    arm      a planar arm of three links (0.4, 0.3, 0.2 m) among one to three discs and bars, from one random posture to
             where the tool is in another, at least 0.45 m away
    wall     a panda's hand goes from one side of a wall to the other
    clutter  a panda's hand goes anywhere among six balls
    shelf    a panda's hand goes into the shelf of a cupboard: two bays of 0.4 x 0.3 m, 0.3 m deep
    delta    the platform of a delta (0.66 m in radius) goes 2 m, over or around two posts that stand in the middle

Start and goal are clear by more than the safety distance; whether there is a way is not looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
from bench import PANDA
from scipy.spatial import ConvexHull

import cinegen
from cinegen.arrays import Array
from cinegen.collision import Clearance, Scene, clearance_of, scene_of
from cinegen.ik import FrameTask
from cinegen.ik.local_ik import LocalIK
from cinegen.model import Mechanism

CLEAR = 0.02  # m: of start and goal; scenes keep half of it
GAP = 0.15  # m: between the obstacles of a field

Entry = dict[str, Any]


@cache
def robot(name: str) -> Mechanism:
    return cinegen.load(PANDA if name == "panda" else name)


def scene(mechanism: Mechanism, name: str, obstacles: list[Entry], start: Entry, goal: Array, **more: Any) -> Scene:
    values = {"name": name, "safety": CLEAR / 2, "obstacle": obstacles, "start": start, **more}
    return scene_of({**values, "goal": {"point": [float(x) for x in goal]}}, mechanism=mechanism)


def clearance(mechanism: Mechanism, obstacles: list[Entry]) -> Clearance:
    return clearance_of(scene(mechanism, "looked at", obstacles, {}, np.zeros(3)))


def is_clear(near: Clearance, q: Array) -> bool:
    """Whether obstacles are at least as far as starts and goals need, and links keep half of it from each other."""
    needed = np.where(near.pairs[:, 1] < len(near.links), 0.5 * CLEAR, CLEAR)
    return bool((near.distances(q) > needed).all())


def posture(mechanism: Mechanism, q: Array) -> Entry:
    """A start."""
    return {"joints": {name: float(q[mechanism.q_index(name)]) for name in mechanism.actuated}}


def anywhere(mechanism: Mechanism, rng: np.random.Generator) -> Array:
    model = mechanism.model
    return rng.uniform(np.maximum(model.lowerPositionLimit, -np.pi), np.minimum(model.upperPositionLimit, np.pi))


# --- in the plane ----------------------------------------------------------------------------------------------------


def point(number: int) -> Scene:
    rng = np.random.default_rng(number)
    while True:
        obstacles: list[Entry] = []
        outlines: list[Array] = []
        for _ in range(2000):
            outline = shape(rng) + rng.uniform([1.2, 0.6], [8.8, 5.4])
            if all(apart(outline, other) >= GAP for other in outlines):
                outlines.append(outline)
                obstacles.append({"name": f"o{len(outlines)}", "kind": "polygon", "points": outline.tolist()})
            if len(outlines) == 6:
                break
        start, goal = np.array([0.2, rng.uniform(0.5, 5.5)]), np.array([9.8, rng.uniform(0.5, 5.5)])
        ends = np.array([start]), np.array([goal])
        if len(outlines) == 6 and all(apart(end, outline) > 0.1 for end in ends for outline in outlines):
            return scene_of(
                {
                    "name": f"point {number}", "mobile": {"radius": 0.0}, "safety": CLEAR, "obstacle": obstacles,
                    "start": {"point": start.tolist()}, "goal": {"point": goal.tolist()},
                }
            )  # fmt: skip


def shape(rng: np.random.Generator) -> Array:
    """(n, 2) the corners of something convex: a polygon of 3 to 7 corners, or a disc as one of 24."""
    if rng.random() < 0.4:
        turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        return rng.uniform(0.3, 0.9) * np.column_stack([np.cos(turn), np.sin(turn)])
    while True:
        corners = rng.uniform(0.3, 1.2) * rng.normal(size=(7, 2)) * [1.0, rng.uniform(0.3, 1.0)] * 0.6
        hull = ConvexHull(corners)
        if hull.volume > 0.15:
            return corners[hull.vertices]


def apart(points: Array, other: Array) -> float:
    """Between two convex polygons, or a point and one: 0 where they overlap."""
    if len(points) > 2 and any(inside(corner, other) for corner in points):
        return 0.0
    if any(inside(corner, other) for corner in points) or (
        len(points) > 2 and any(inside(corner, points) for corner in other)
    ):
        return 0.0
    edges = [(a, b) for a, b in ((other, points), (points, other))]
    return min(to_edge(corner, first, second) for corners, outline in edges for corner in corners
               for first, second in zip(outline, np.roll(outline, -1, axis=0), strict=True))  # fmt: skip


def inside(place: Array, outline: Array) -> bool:
    if len(outline) < 3:
        return False
    edges = np.roll(outline, -1, axis=0) - outline
    way = place - outline
    return bool((edges[:, 0] * way[:, 1] - edges[:, 1] * way[:, 0] > 0.0).all())


def to_edge(place: Array, first: Array, second: Array) -> float:
    edge = second - first
    part = np.clip((place - first) @ edge / max(edge @ edge, 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(place - first - part * edge))


def arm(number: int) -> Scene:
    rng, mechanism, reach = np.random.default_rng(number), robot("planar_3r"), 0.9
    while True:
        obstacles: list[Entry] = []
        for i in range(rng.integers(1, 4)):
            r, turn = rng.uniform(0.25, 0.95) * reach, rng.uniform(-np.pi, np.pi)
            place = [float(r * np.cos(turn)), float(r * np.sin(turn))]
            if rng.random() < 0.5:
                kind: Entry = {"kind": "disc", "radius": rng.uniform(0.04, 0.14) * reach}
            else:
                size = [rng.uniform(0.05, 0.3) * reach, rng.uniform(0.02, 0.1) * reach]
                kind = {"kind": "box", "size": size, "angle": rng.uniform(0.0, np.pi)}
            obstacles.append({"name": f"o{i + 1}", "point": place, **kind})
        near = clearance(mechanism, obstacles)
        ends = [q for q in (anywhere(mechanism, rng) for _ in range(200)) if is_clear(near, q)][:2]
        if len(ends) < 2:
            continue
        begin, end = (mechanism.placement(q, "tool").translation for q in ends)
        if np.linalg.norm(end - begin) > 0.45:
            return scene(mechanism, f"arm {number}", obstacles, posture(mechanism, ends[0]), end[:2], node="tool")


# --- in space --------------------------------------------------------------------------------------------------------


def wall(number: int) -> Scene:
    rng = np.random.default_rng(number)
    y, x, height = rng.uniform(-0.1, 0.1), rng.uniform(0.3, 0.45), rng.uniform(0.3, 0.6)
    size, place = [0.5, 0.04, height], [x + 0.25, y, rng.uniform(0.15, 0.3)]
    obstacles: list[Entry] = [{"name": "wall", "kind": "box", "size": size, "point": place}]
    left, right = ([0.35, 0.2 + y, 0.15], [0.6, 0.5, 0.5]), ([0.35, -0.5, 0.15], [0.6, -0.2 + y, 0.5])
    return hand(f"wall {number}", rng, obstacles, left, right)


def clutter(number: int) -> Scene:
    rng = np.random.default_rng(number)
    obstacles: list[Entry] = []
    for i in range(6):
        turn, r = rng.uniform(-np.pi, np.pi), rng.uniform(0.35, 0.8)
        place = [float(r * np.cos(turn)), float(r * np.sin(turn)), rng.uniform(0.1, 0.9)]
        obstacles.append({"name": f"o{i + 1}", "kind": "sphere", "radius": rng.uniform(0.04, 0.1), "point": place})
    everywhere = ([-0.6, -0.6, 0.2], [0.6, 0.6, 0.8])
    return hand(f"clutter {number}", rng, obstacles, everywhere, everywhere)


def shelf(number: int) -> Scene:
    boards: list[Entry] = [
        {"name": f"board{i}", "kind": "box", "size": [0.3, 0.8, 0.02], "point": [0.75, 0.0, z]}
        for i, z in enumerate((0.2, 0.5, 0.8))
    ]
    sides: list[Entry] = [
        {"name": f"side{i}", "kind": "box", "size": [0.3, 0.02, 0.6], "point": [0.75, y, 0.5]}
        for i, y in enumerate((-0.4, 0.0, 0.4))
    ]
    front, within = ([0.2, -0.5, 0.3], [0.4, 0.5, 0.7]), ([0.68, -0.3, 0.28], [0.78, 0.3, 0.42])
    return hand(f"shelf {number}", np.random.default_rng(number), boards + sides, front, within)


def hand(
    name: str, rng: np.random.Generator, obstacles: list[Entry], begin: tuple[Any, Any], end: tuple[Any, Any]
) -> Scene:
    """A panda's hand goes from one box to another."""
    mechanism, node = robot("panda"), "panda_hand"
    near = clearance(mechanism, obstacles)
    while True:
        first, last = (clear_posture(mechanism, node, rng.uniform(*box), near, rng) for box in (begin, end))
        if first is None or last is None:
            continue
        goal = mechanism.placement(last, node).translation
        if np.linalg.norm(goal - mechanism.placement(first, node).translation) > 0.3:
            return scene(mechanism, name, obstacles, posture(mechanism, first), goal, node=node)


def clear_posture(
    mechanism: Mechanism, node: str, place: Array, near: Clearance, rng: np.random.Generator
) -> Array | None:
    target = pin.SE3(np.eye(3), place)
    local = LocalIK(mechanism, (FrameTask(node, target, 3, 0, axes="world"),))
    local.tasks[0].target = target
    for _ in range(5):
        if local.solve(local.random_start(rng), 1e-10) and is_clear(near, local.best):
            return local.best
    return None


def delta(number: int) -> Scene:
    rng, mechanism = np.random.default_rng(number), robot("delta4")
    node = mechanism.end
    home = mechanism.placement(mechanism.q_home, node).translation
    while True:
        obstacles: list[Entry] = []
        for i in range(2):
            turn, r, top = rng.uniform(-np.pi, np.pi), rng.uniform(0.0, 0.25), rng.uniform(-0.3, -0.1)
            place = home + np.array([r * np.cos(turn), r * np.sin(turn), top - 0.5])
            post = {"name": f"post{i + 1}", "kind": "cylinder", "radius": rng.uniform(0.03, 0.1), "length": 1.0}
            obstacles.append({**post, "point": [float(x) for x in place]})
        near = clearance(mechanism, obstacles)
        ends = []
        for turn in rng.uniform(-np.pi, np.pi) + np.array([0.0, np.pi]):
            way = [1.0 * np.cos(turn), 1.0 * np.sin(turn), -rng.uniform(0.2, 0.5)]
            reached = cinegen.inverse_kinematics(
                mechanism, [FrameTask(node, pin.SE3(np.eye(3), home + way), 3, 0)], mechanism.q_home
            )
            if reached and is_clear(near, reached.q):
                ends.append(reached.q)
        if len(ends) == 2:
            goal = mechanism.placement(ends[1], node).translation
            return scene(mechanism, f"delta {number}", obstacles, posture(mechanism, ends[0]), goal, node=node)


FAMILIES: Mapping[str, Callable[[int], Scene]] = {
    "point": point, "arm": arm, "wall": wall, "clutter": clutter, "shelf": shelf, "delta": delta,
}  # fmt: skip
