"""Draw mechanisms into a page: each node of a mechanism is a node of the scene, moved by its placement."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Protocol

import numpy as np
import pinocchio as pin
from meshcat import Visualizer
from meshcat.geometry import Geometry, Material, Mesh, Sphere, TriangularMeshGeometry, triad

from cinegen.arrays import Array, ArrayLike
from cinegen.cockpit.graphic_file import draw_file, material, material_of
from cinegen.cockpit.page import DrawingCommand, Page
from cinegen.cockpit.surfaces import merged, surface_of
from cinegen.collision.shapes import bounding_box_corners
from cinegen.mission.drawn_obstacle import DrawnObstacle, DrawnShape
from cinegen.model import Mechanism
from cinegen.model.motion_plane import motion_plane
from cinegen.session.setup import DrawnAttached
from raff2urdf.escape import path_segment

_ORIGIN = pin.SE3.Identity()
_SHOWN = 1.6  # m: radius at which everything is drawn, so that robots of any size fill the view
_EYE = np.array([3.8, -4.9, 3.0])  # direction from which the camera looks
_SLOPE, _ZOOM = (
    np.tan(np.radians(75.0) / 2.0) / 3.2,
    3.2,
)  # half the view's height at 1 m: little perspective distortion
_FILLED, _ASPECT = 0.7, 1.5  # share of a view that is filled, and its width by its height; the page knows its own
_MANY = 500  # shapes of a robot: from there on, the shapes of each link are one
_GAP = 0.05  # m: between what is drawn and the floor
_ALIKE = 0.5  # part of a radius by which a scene may differ from the one before, whose scale it keeps
_TILT = 1e-3  # of a camera that looks straight down, so that it has an upper side
_LOOP = 0xCC79A7  # Okabe and Ito's reddish purple: closed loops
_TARGET = 0xD55E00  # vermilion: targets
_GOAL = 0x009E73  # bluish green: the goal of a scene
_OBSTACLE = np.array([0.62, 0.55, 0.46, 1.0])  # nothing else is brown
_HELD = np.array([0.94, 0.89, 0.26, 1.0])  # Okabe and Ito's yellow: what a robot holds
_WALL = np.array([0.62, 0.55, 0.46, 0.35])  # of obstacles that can't be moved: they must not hide what is behind


ROOT = "/meshcat/cinegen"
"""Path of everything that is drawn in a page's scene."""


class Window(Protocol):
    """A receiver of drawing commands, as `meshcat.Visualizer` takes it."""

    def send(self, command: DrawingCommand) -> object:
        """Take a drawing command."""


class RobotScene:
    """Mechanisms in meshcat's viewer.

    Args:
        window: receiver of the drawing commands, as `meshcat.Visualizer` takes it: a page, or the window of a viewer.
        mechanisms: mechanisms by name.
        bases: base poses of those that are not at the world's origin (m).
        obstacles: obstacles by name.
        attached: objects that mechanisms hold.
        scaled: scale everything to one size, in which the view is filled; otherwise the camera moves, and 1 is 1 m.
        before: scene in whose scale it is drawn, unless its size differs much.
    """

    def __init__(
        self,
        window: Window,
        mechanisms: Mapping[str, Mechanism],
        bases: Mapping[str, pin.SE3] | None = None,
        obstacles: Mapping[str, DrawnObstacle] | None = None,
        attached: Iterable[DrawnAttached] = (),
        scaled: bool = True,
        before: RobotScene | None = None,
    ) -> None:
        self.mechanisms = dict(mechanisms)
        self.bases = {name: pin.SE3.Identity() for name in mechanisms} | dict(bases or {})
        self._root = Visualizer(window=window)["cinegen"]
        self._targets: set[str] = set()
        drawn = {
            name: (solid, _geometry(solid.shapes, _OBSTACLE if solid.dof else _WALL))
            for name, solid in (obstacles or {}).items()
        }
        held = [(body, _geometry(body.shapes, _HELD)) for body in attached]
        self._fit(drawn.values(), held, scaled, before)
        for name, (obstacle, objects) in drawn.items():
            self._put(_below(self._root, name, name), objects)
            self.show_obstacle(name, obstacle.placement)
        for name, mechanism in self.mechanisms.items():
            self._draw(name, mechanism)
            self.show(name, mechanism.q_home, self.bases[name])
        for body, objects in held:
            self._put(_below(self._root, body.robot, body.node)[path_segment(body.name, "attached ")], objects)

    def show(self, name: str, q: ArrayLike, base: pin.SE3 | None = None) -> None:
        """Move a mechanism to q (nq,), and its base if it is given."""
        mechanism = self.mechanisms[name]
        model, data = mechanism.model, mechanism.structure.system.data
        if base is not None:
            _below(self._root, name).set_transform(base.homogeneous)
        pin.forwardKinematics(model, data, mechanism.structure.checked(q))
        for node in mechanism.nodes:
            placement = pin.updateFramePlacement(model, data, mechanism.frame_id(node))
            _below(self._root, name, node).set_transform(placement.homogeneous)

    def show_obstacle(self, name: str, pose: pin.SE3) -> None:
        """Move an obstacle to a pose in the world (m)."""
        _below(self._root, name).set_transform(pose.homogeneous)

    def move_to(self, page: Page) -> None:
        """Draw into another page from now on, which has everything that was drawn."""
        self._root = Visualizer(window=page)["cinegen"]

    def target(self, name: str, label: str, placement: pin.SE3) -> None:
        """Show a target as a triad; further calls move it."""
        node = _below(_below(self._root, name)["targets"], label)
        size = 0.12 * self.mechanisms[name].length
        if node.path.lower() not in self._targets:
            self._targets.add(node.path.lower())
            node.set_object(triad(size))
            node["ball"].set_object(Mesh(Sphere(0.12 * size), material(_TARGET, 0.85)))
        node.set_transform(placement.homogeneous)

    def goal(self, name: str, placement: pin.SE3, whole: bool) -> None:
        """Show the goal of a node as a ball; `whole`: with a triad, for its orientation."""
        node = _below(self._root, name)["goal"]
        size = 0.02 * self._radius
        if whole:
            node.set_object(triad(4.0 * size))
        node["ball"].set_object(Mesh(Sphere(size), material(_GOAL, 0.85)))
        node.set_transform(placement.homogeneous)

    def _fit(
        self,
        obstacles: Iterable[tuple[DrawnObstacle, list[pin.GeometryObject]]],
        attached: Iterable[tuple[DrawnAttached, list[pin.GeometryObject]]],
        scaled: bool,
        before: RobotScene | None,
    ) -> None:
        """Place everything so that robots, what they hold and movable obstacles fill the view, with the floor below."""
        parts = [
            part @ self.bases[name].rotation.T + self.bases[name].translation
            for name, mechanism in self.mechanisms.items()
            for part in _extent(mechanism)
        ]
        for obstacle, objects in obstacles:
            parts += [
                bounding_box_corners(shape.geometry, obstacle.placement * shape.placement)
                for shape in objects
                if obstacle.dof
            ]
        for held, objects in attached:
            mechanism = self.mechanisms[held.robot]
            pose = self.bases[held.robot] * mechanism.placement(mechanism.q_home, held.node)
            parts += [bounding_box_corners(shape.geometry, pose * shape.placement) for shape in objects]
        points = np.vstack(parts)
        eye = self._eye()
        centre, away = _framed(points, eye)
        self._radius = float(np.linalg.norm(points - centre, axis=1).max()) or 1.0
        if before is not None:
            aside = float(np.linalg.norm(centre - before._centre))
            if aside < _ALIKE * before._radius and 1.0 / (1.0 + _ALIKE) < self._radius / before._radius < 1.0 + _ALIKE:
                centre, self._radius = before._centre, before._radius
        self._centre: Array = centre
        scale = _SHOWN / self._radius
        whole, camera, floor = np.eye(4), np.eye(4), np.eye(4)
        lowest, gap, eye = float(points[:, 2].min()), _GAP / scale, eye * away
        if scaled:
            whole[:3, :3], whole[:3, 3] = scale * np.eye(3), -scale * centre
            lowest, gap, eye = scale * (lowest - centre[2]), _GAP, scale * eye
        else:
            camera[:3, 3] = centre
        position = [float(eye[0]), float(eye[2]), float(-eye[1])]  # y up
        floor[2, 3] = lowest - gap
        self._root.set_transform(whole)
        window = self._root["/"]
        window["/Grid"].set_transform(floor)
        window["/Cameras/default"].set_transform(camera)
        window["/Cameras/default/rotated/<object>"].set_property("position", position)
        window["/Cameras/default/rotated/<object>"].set_property("zoom", _ZOOM)
        window["/Axes"].set_property("visible", False)
        window["/Background"].set_property("top_color", [0.92, 0.95, 0.98])
        window["/Background"].set_property("bottom_color", [1.0, 1.0, 1.0])

    def _eye(self) -> Array:
        """Return the direction (3,) from which the camera looks: facing the plane in which all robots move, if any."""
        eye = _EYE
        planes = [(self.bases[name].rotation, motion_plane(mechanism)) for name, mechanism in self.mechanisms.items()]
        normals = [rotation @ normal for rotation, normal in planes if normal is not None]
        if len(normals) == len(planes) and all(abs(normal @ normals[0]) > 1.0 - 1e-9 for normal in normals):
            eye = np.copysign(1.0, normals[0] @ eye) * normals[0] + [0.0, -_TILT, 0.0]
        return np.asarray(eye / np.linalg.norm(eye))

    def _draw(self, name: str, mechanism: Mechanism) -> None:
        model = mechanism.model
        owners = {frame: node for node, frame in ((node, mechanism.frame_id(node)) for node in mechanism.nodes)}
        shapes = defaultdict[str, list[pin.GeometryObject]](list)
        for solid in mechanism.drawn:
            if solid.parentFrame in owners:
                shapes[owners[solid.parentFrame]].append(solid)
        for node, solids in shapes.items():
            frame, path = model.frames[mechanism.frame_id(node)].placement, _below(self._root, name, node)
            if len(mechanism.drawn) > _MANY:
                plain = [solid for solid in solids if _ending(solid) in ("", ".stl")]
                for mesh in merged((solid, frame.actInv(solid.placement)) for solid in plain):
                    path[f"all {mesh.material.opacity:g}"].set_object(mesh)
                solids = [solid for solid in solids if solid not in plain]
            self._put(path, solids, frame)
        for node in {mechanism.nodes[-1], *(node for node, _ in mechanism.sensor_constraints)}:
            _below(self._root, name, node)["triad"].set_object(triad(0.15 * mechanism.length))
        for loop in mechanism.loops:
            mark = _below(self._root, name, loop.first)[path_segment(loop.name, "loop ")]
            mark.set_object(Mesh(Sphere(0.03 * mechanism.length), material(_LOOP, 0.6)))
            mark.set_transform(loop.first_placement.homogeneous)

    def _put(self, path: Visualizer, objects: Iterable[pin.GeometryObject], frame: pin.SE3 = _ORIGIN) -> None:
        """Draw geometry objects below a path of the page's scene, as seen from a frame."""
        for i, solid in enumerate(objects):
            placement = frame.actInv(solid.placement).homogeneous
            for k, (geometry, look, extra) in enumerate(_drawn(solid)):
                place = path[f"{i}.{k}" if k else str(i)]
                place.set_object(Mesh(geometry, look))
                place.set_transform(placement @ extra)


def _below(node: Visualizer, *names: str) -> Visualizer:
    """Return the node of what files name, such as a robot and its link, below a node."""
    for name in names:
        node = node[path_segment(name)]
    return node


def _geometry(shapes: Iterable[DrawnShape], colour: Array) -> list[pin.GeometryObject]:
    """Return shapes in a colour (4,)."""
    objects = []
    for i, (placement, shape_) in enumerate(shape.placed() for shape in shapes):
        objects.append(pin.GeometryObject(f"{i}", 0, placement, shape_))
        objects[-1].meshColor = colour
    return objects


def _framed(points: Array, eye: Array) -> tuple[Array, float]:
    """Return the middle (3,) of a view that points (n, 3) fill, and how far away the camera is.

    The camera is the tip of the smallest pyramid around the points, of given slopes, that opens against `eye` (3,).
    """
    right = np.cross([0.0, 0.0, 1.0], eye) / np.hypot(eye[0], eye[1])
    axes = np.array([right, np.cross(eye, right)])
    depths, sides = points @ eye, points @ axes.T
    slopes = _FILLED * _SLOPE * np.array([_ASPECT, 1.0])
    most, least = (sides + np.outer(depths, slopes)).max(axis=0), (sides - np.outer(depths, slopes)).min(axis=0)
    middle = (depths.min() + depths.max()) / 2.0
    away = float(((most - least) / (2.0 * slopes)).max() - middle)
    return (most + least) / 2.0 @ axes + middle * eye, away


def _extent(mechanism: Mechanism) -> Iterator[Array]:
    """Yield points (n, 3) that bound a mechanism at home: the corners of what is drawn, or its nodes if nothing is."""
    placements = [mechanism.placement(mechanism.q_home, node) for node in mechanism.nodes]
    frames = {mechanism.frame_id(node): placement for node, placement in zip(mechanism.nodes, placements, strict=True)}
    solids = [solid for solid in mechanism.drawn if solid.parentFrame in frames]
    for solid in solids:
        in_node = mechanism.model.frames[solid.parentFrame].placement.actInv(solid.placement)
        yield bounding_box_corners(solid.geometry, frames[solid.parentFrame] * in_node)
    if not solids:
        yield np.array([placement.translation for placement in placements])


def _ending(solid: pin.GeometryObject) -> str:
    """Return the ending of a shape's file; empty without one: then the path is its kind."""
    return Path(solid.meshPath).suffix.lower()


def _drawn(solid: pin.GeometryObject) -> Iterator[tuple[Geometry, Material, Array]]:
    """Yield a Pinocchio shape as geometry, material, and the transform (4, 4) between them.

    Several for a mesh with several colours.
    """
    extra = np.eye(4)
    if drawn := list(draw_file(Path(solid.meshPath), solid.meshColor, not solid.overrideMaterial)):
        extra[:3, :3] = np.diag(solid.meshScale)
    for surface, look in drawn or [(TriangularMeshGeometry(*surface_of(solid)), material_of(solid.meshColor))]:
        yield surface, look, extra


def make_page(mechanisms: Mapping[str, Mechanism]) -> tuple[Page, RobotScene]:
    """Return a page that shows mechanisms at home, by name, and the scene in it."""
    page = Page(", ".join(mechanisms))
    return page, RobotScene(page, mechanisms)
