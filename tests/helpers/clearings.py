"""Robots among obstacles, as tests of clearance and of what is held clear need them."""

from dataclasses import replace
from functools import cache

import coal
import numpy as np
import pinocchio as pin
from repository import load

from cinegen.collision import Clearance, Obstacle
from cinegen.collision.body import Body
from cinegen.collision.clearance import links_of
from cinegen.collision.mobile_robot import mobile_body, mobile_robot
from cinegen.collision.refined_distances import UP_TO


def at(*point: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array(point, dtype=float))


def ball(radius: float, *point: float) -> Body:
    return Body("ball", 0, at(*point), coal.Sphere(radius))


def wall(normal, offset: float) -> Body:
    """All x with normal x <= offset."""
    return Body("wall", 0, pin.SE3.Identity(), coal.Halfspace(np.array(normal, dtype=float), offset))


def some(kind: str, place: pin.SE3, size: float) -> Body:
    shapes = {
        "ball": lambda: coal.Sphere(size),
        "box": lambda: coal.Box(size, 1.5 * size, 0.7 * size),
        "capsule": lambda: coal.Capsule(0.4 * size, 2.0 * size),
    }
    return Body(kind, 0, place, shapes[kind]())


@cache
def links(name: str) -> tuple[tuple[Body, ...], tuple[tuple[int, int], ...]]:
    return links_of(load(name))


def obstacles_of(bodies) -> list[Obstacle]:
    """An obstacle for each body in the world."""
    return [Obstacle(body.name, (replace(body, placement=pin.SE3.Identity()),), body.placement) for body in bodies]


def among(name: str, obstacles, self_pairs: bool = True) -> Clearance:
    bodies, pairs = links(name)
    return Clearance(load(name), bodies, obstacles_of(obstacles), pairs if self_pairs else ())


def point_among(obstacles, radius: float = 0.0) -> Clearance:
    return Clearance(mobile_robot(), [mobile_body(radius)], obstacles_of(obstacles))


def around(name: str, seed: int, count: int = 4, near: float = 0.4) -> list[Body]:
    """Obstacles of all kinds about a robot, none of them near its home."""
    mechanism, rng = load(name), np.random.default_rng(seed)
    obstacles: list[Body] = []
    base = mechanism.placement(mechanism.q_home, mechanism.nodes[0]).translation
    while len(obstacles) < count:
        way = rng.normal(size=3) * (1.0, 1.0, 0.0 if name in ("planar_3r", "five_bar") else 1.0)
        place = pin.SE3(pin.exp3(rng.normal(size=3)), base + way / np.linalg.norm(way) * mechanism.length)
        new = some(("ball", "box", "capsule")[len(obstacles) % 3], place, rng.uniform(0.1, 0.25) * mechanism.length)
        if among(name, [new], self_pairs=False).least(mechanism.q_home) > 0.1 * near * mechanism.length:
            obstacles.append(new)
    return obstacles


def apart(shape, at: pin.SE3, other, at_other: pin.SE3) -> float:
    """The distance of two shapes at two poses, by coal itself; below 0 where they overlap."""
    places = [coal.Transform3s(pose.rotation, pose.translation) for pose in (at, at_other)]
    return float(coal.distance(shape, places[0], other, places[1], coal.DistanceRequest(), coal.DistanceResult()))


def to_shape(mechanism, bodies, q, shape, pose: pin.SE3) -> float:
    """The least distance of bodies of a mechanism that move from a shape at a pose, by coal and Pinocchio."""
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    return min(apart(body.shape, data.oMi[body.joint] * body.placement, shape, pose) for body in bodies if body.joint)


def measured(clearance: Clearance, q) -> np.ndarray:
    """(pairs,) distances by coal itself, each body placed by Pinocchio's kinematics of its own: of convex bodies, and
    where these are near, of the shapes inside; meshes that overlap count as deep as the convex bodies around them. The
    offset is added between links."""
    model = clearance.mechanism.model
    data = model.createData()
    pin.forwardKinematics(model, data, q)

    def distance(pair) -> float:
        first, second = (data.oMi[body.joint] * body.placement for body in pair)
        return apart(pair[0].shape, first, pair[1].shape, second)

    distances = []
    for number, pair in enumerate(clearance.pairs):
        bodies, offset = [clearance.bodies[int(i)] for i in pair], clearance.offset(number)
        exact, least, within = [body.as_described for body in bodies], distance(bodies), clearance.exact_within - offset
        if exact != bodies and least < within:
            inner = distance(exact)
            if inner > 0.0 or not any(isinstance(body.shape, coal.BVHModelOBBRSS) for body in exact):
                least = min(inner, UP_TO * within)
        distances.append(least + offset if least > 0.0 else least)
    return np.array(distances)


def within_limits(name: str, rng) -> np.ndarray:
    """A random configuration within limits; loops open."""
    model = load(name).model
    low, high = np.maximum(model.lowerPositionLimit, -3.0), np.minimum(model.upperPositionLimit, 3.0)
    return rng.uniform(low, high)
