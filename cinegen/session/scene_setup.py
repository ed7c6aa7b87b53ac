"""`scene_setup` and `map_setup`: the setup of a session with the robot of a scene and its obstacles, or with a map."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

import coal
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision import Obstacle, Scene
from cinegen.collision.body import PlacedShape
from cinegen.collision.mobile_robot import mobile_robot
from cinegen.collision.obstacle import Attached
from cinegen.collision.obstacle_kinds import HEIGHT
from cinegen.collision.shapes import kind_of, rounded_hull
from cinegen.errors import CinegenWarning
from cinegen.mission.drawn_obstacle import DrawnObstacle, DrawnShape
from cinegen.model import Mechanism
from cinegen.model.motion_plane import motion_plane
from cinegen.session.arrangement import arrange
from cinegen.session.setup import RATE, Avoidance, DrawnAttached, MapOverlay, Setup, SetupError
from raff2urdf.errors import did_you_mean

_FLAT = 0.25  # characteristic lengths
_THIN = 0.02  # of a half-space's width
_WIDE = 1.3  # times as wide as everything in the scene
_POINT = 0.015  # of the scene's radius: the ball that a point is drawn as
_MOST_TRIANGLES = 50_000  # of an obstacle, which else is drawn as the convex shapes around its pieces
_BLUE = "0.34 0.71 0.91 1"  # Okabe and Ito's sky blue: a mobile robot


def scene_setup(
    scene: Scene,
    sensors: Collection[str] = (),
    follow: str | None = None,
    node: str | None = None,
    rate: float = RATE,
    record: str | None = None,
) -> Setup:
    """Return the setup of a session with a scene's robot, which avoids the scene's obstacles.

    Args:
        scene: the robot begins at its start. It is called as its file, a mobile robot "mobile".
        sensors: see `arrange`, as for the others.
        follow: shape of the path that the robot's end, or `node`, follows.
        node: node that follows it.
        rate: ticks per second.
        record: file in which the session is recorded.

    Raises:
        SetupError: the sensors are not valid for the robot.
        UnknownNameError: there is no such node.
    """
    appearance = SceneAppearance(scene)
    if scene.mobile is not None:
        scene = replace(scene, mechanism=mobile_robot(appearance.visual(scene.mobile)))
    name = _path_safe(Path(scene.robot).stem if isinstance(scene.robot, str) else scene.mechanism.name)
    setup = arrange({name: scene.mechanism}, None, tuple(sensors), follow, node, (), rate, record)
    obstacles: dict[str, DrawnObstacle] = {}
    for obstacle in scene.obstacles:
        key = _path_safe(obstacle.name)
        while key in obstacles or key == name:
            key += "'"
        obstacles[key] = appearance.obstacle(obstacle)
    attached = tuple(
        DrawnAttached(name, part.node, _path_safe(part.name), appearance.attached(part)) for part in scene.attached
    )
    return replace(setup, obstacles=obstacles, avoidance=Avoidance(name, scene), attached=attached)


def _path_safe(name: str) -> str:
    """Return a name as the page's scene can have it, where a slash separates names."""
    return " ".join(name.replace("/", "-").split())


class SceneAppearance:
    """Shapes that a scene is drawn as.

    Shapes that are given in the plane are very tall; where the robot moves in that plane they are drawn flat. A
    half-space, which is unbounded, is drawn as a slab behind its plane, wider than the scene.

    Args:
        scene: scene.

    Attributes:
        height: height (m) of shapes that are drawn flat; None where the robot moves in space.
    """

    def __init__(self, scene: Scene) -> None:
        mechanism = scene.mechanism
        normal = motion_plane(mechanism)
        upright = normal is not None and abs(normal[2]) > 1.0 - 1e-9
        self.height: float | None = _FLAT * mechanism.length if upright else None
        points = [mechanism.placement(scene.start, node).translation for node in mechanism.nodes]
        points += [scene.goal.translation]
        for obstacle in scene.obstacles:
            for body in obstacle.bodies:
                if np.isfinite(body.radius):
                    points += [body.centre + sign * np.array([body.radius, body.radius, 0.0]) for sign in (-1.0, 1.0)]
        low, high = np.min(points, axis=0), np.max(points, axis=0)
        self._middle: Array = (low + high) / 2.0
        self._radius = float(np.linalg.norm(high - low)) / 2.0

    def obstacle(self, obstacle: Obstacle) -> DrawnObstacle:
        """Return an obstacle of the scene. Half-spaces can't be moved."""
        dof: Literal[0, 3, 6] = 6 if self.height is None else 3
        if not all(np.isfinite(piece.radius) for piece in obstacle.pieces):
            dof = 0
        return DrawnObstacle(tuple(map(DrawnShape.of, self._shapes(obstacle))), obstacle.placement, dof)

    def attached(self, held: Attached) -> tuple[DrawnShape, ...]:
        """Return the shapes of an object that the scene's robot holds, in the frame of the node that holds it."""
        return tuple(
            DrawnShape.of(PlacedShape(held.object.placement * placement, shape))
            for placement, shape in self._shapes(held.object)
        )

    def visual(self, radius: float) -> str:
        """Return the visual of a mobile robot (radius in m), in URDF: a disc, or for a point a small ball."""
        shape = f'<cylinder radius="{radius}" length="{self.height or radius}"/>'
        if radius == 0.0:
            shape = f'<sphere radius="{_POINT * self._radius}"/>'
        colour = f'<material name="mobile"><color rgba="{_BLUE}"/></material>'
        return f"<visual><geometry>{shape}</geometry>{colour}</visual>"

    def _shapes(self, obstacle: Obstacle) -> Iterator[PlacedShape]:
        meshes = [piece.as_described.shape for piece in obstacle.pieces if piece.interior is not None]
        is_small = sum(mesh.num_tris for mesh in meshes) <= _MOST_TRIANGLES
        for piece in obstacle.pieces:
            if piece.interior is not None and is_small:
                yield PlacedShape(piece.as_described.placement, piece.as_described.shape)
            elif not np.isfinite(piece.radius):
                yield self._slab(piece.shape, obstacle.placement * piece.placement, piece.placement)
            else:
                shape = piece.shape if self.height is None else _flattened(piece.shape, self.height)
                yield PlacedShape(piece.placement, shape)

    def _slab(self, half_space: coal.Halfspace, world: pin.SE3, placement: pin.SE3) -> PlacedShape:
        """Return the slab of a half-space with these poses in the world and in its obstacle."""
        normal = np.array(half_space.n)
        middle = world.actInv(self._middle)
        width = 2.0 * _WIDE * self._radius
        thickness = _THIN * width
        centre = middle - normal * (float(normal @ middle) - half_space.d + thickness / 2.0)
        rotation = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).toRotationMatrix()
        sides = [width, width, thickness]
        if self.height is not None and abs(normal[2]) < 0.5:  # a wall, seen from above
            along = np.cross([0.0, 0.0, 1.0], normal)
            rotation = np.column_stack([along, [0.0, 0.0, 1.0], normal])
            sides = [width, self.height, thickness]
        return PlacedShape(placement * pin.SE3(rotation, centre), coal.Box(np.array(sides)))


def _flattened(shape: coal.ShapeBase, height: float) -> coal.ShapeBase:
    """Return a shape that was given in the plane with a height (m); another shape as it is."""
    points, radius = rounded_hull(shape)
    if radius > 0.0 or np.ptp(points[:, 2]) != HEIGHT:
        return shape
    return kind_of(shape).stretched(shape, height / HEIGHT)


def map_setup(path: str | Path, quantity: str | None = None, mechanism: Mechanism | None = None) -> Setup:
    """Return the setup of a session with the robot of a map, among the map's obstacles if it has some.

    Args:
        path: path of the map, which may be incomplete.
        quantity: quantity that colours the cells initially; the map's first unless given.
        mechanism: the map's robot, loaded from its file, if the map is far from it. Otherwise its meshes
            are not found there, and it is drawn as a stick figure.

    Raises:
        MapError: there is no map.
        SetupError: the map has no such quantity, or is of another robot.
    """
    from cinegen.workspace.zarr_store import MapStore

    where = Path(path).absolute()
    with warnings.catch_warnings():  # they were issued when it was made
        warnings.simplefilter("ignore", CinegenWarning)
        spec = MapStore(where).spec
    if quantity is not None and quantity not in spec.quantities:
        known = f"it has {', '.join(spec.quantities) or 'none'}"
        raise SetupError(f"{path}: no quantity '{quantity}'{did_you_mean(quantity, spec.quantities)}; {known}")
    if mechanism is None:
        source = spec.mechanism.source._replace(owner=str(where.parent))
        mechanism = replace(spec.mechanism, source=source)
    elif replace(spec, mechanism=mechanism).robot_hash != spec.robot_hash:
        raise SetupError(f"{path} is a map of another robot than {mechanism.name}, or of another version of it")
    if spec.scene is None:
        robot = " ".join(mechanism.name.replace("/", "-").split()) or "robot"  # as the page's scene requires
        with warnings.catch_warnings():  # of ports: no sensor was requested
            warnings.simplefilter("ignore", CinegenWarning)
            setup = arrange({robot: mechanism})
    else:
        from cinegen.collision import scene_of

        setup = scene_setup(scene_of(dict(spec.scene), spec.folder, mechanism=mechanism))
        assert setup.avoidance is not None
        robot = setup.avoidance.robot
    return replace(setup, map=MapOverlay(str(where), robot, spec.node, quantity))
