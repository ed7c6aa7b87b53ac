"""A mechanism drawn into a page: one node of the scene for each node of the mechanism, moved by its placement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import coal
import meshcat
import meshcat.geometry as shape
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from cinegen.model import Mechanism
from cinegen.show.page import Page

Array = NDArray[np.float64]

_SHOWN = 1.6  # m: the radius of what is shown, whatever its true size, so that every robot fills the view
_EYE, _ZOOM = (3.8, 3.0, 4.9), 2.2  # m, y up: where the view is from; far away, so that near parts don't look fat
_LOOP = 0xCC79A7  # Okabe and Ito's reddish purple: where a loop is closed
_TARGET = 0xD55E00  # vermillion: what is pulled


class Scene:
    """Mechanisms in a page, at a scale that fits them into the view.

    Args:
        page: to draw into.
        mechanisms: by the name they have in the page.
    """

    def __init__(self, page: Page, mechanisms: Mapping[str, Mechanism]) -> None:
        self.page, self.mechanisms = page, dict(mechanisms)
        self._root = meshcat.Visualizer(window=page)["cinegen"]
        self._targets: set[str] = set()
        self._fit()
        for name, mechanism in self.mechanisms.items():
            self._draw(name, mechanism)
            self.show(name, mechanism.q_home)

    def show(self, name: str, q: ArrayLike) -> None:
        """Moves a mechanism to q (nq,)."""
        mechanism = self.mechanisms[name]
        model, data = mechanism.model, mechanism.system.data
        pin.forwardKinematics(model, data, mechanism.checked(q))
        for node in mechanism.nodes:
            placement = pin.updateFramePlacement(model, data, mechanism.frame_id(node))
            self._root[name][node].set_transform(placement.homogeneous)

    def target(self, name: str, label: str, placement: pin.SE3) -> None:
        """Shows a sensor's target as a triad; drawn when first shown, then moved."""
        path = f"{name}/targets/{label}"
        size = 0.12 * self.mechanisms[name].length
        if path not in self._targets:
            self._targets.add(path)
            self._root[path].set_object(shape.triad(size))
            ball = shape.MeshLambertMaterial(color=_TARGET, opacity=0.85)
            self._root[path]["ball"].set_object(shape.Sphere(0.12 * size), ball)
        self._root[path].set_transform(placement.homogeneous)

    def _fit(self) -> None:
        """Scales and moves the whole so that it fills the view, and puts the floor under it."""
        points = np.vstack([_origins(mechanism) for mechanism in self.mechanisms.values()])
        centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
        radius = float(np.linalg.norm(points - centre, axis=1).max()) or 1.0
        scale = _SHOWN / radius
        whole = np.diag([scale, scale, scale, 1.0])
        whole[:3, 3] = -scale * centre
        self._root.set_transform(whole)
        floor = np.eye(4)
        floor[2, 3] = scale * float(points[:, 2].min() - centre[2]) - 0.05
        window = meshcat.Visualizer(window=self.page)
        window["/Grid"].set_transform(floor)
        window["/Cameras/default/rotated/<object>"].set_property("position", list(_EYE))
        window["/Cameras/default/rotated/<object>"].set_property("zoom", _ZOOM)
        window["/Axes"].set_property("visible", False)
        window["/Background"].set_property("top_color", [0.92, 0.95, 0.98])
        window["/Background"].set_property("bottom_color", [1.0, 1.0, 1.0])

    def _draw(self, name: str, mechanism: Mechanism) -> None:
        model = mechanism.model
        owners = {frame: node for node, frame in ((node, mechanism.frame_id(node)) for node in mechanism.nodes)}
        for i, solid in enumerate(mechanism.visual.geometryObjects):
            drawn = _shape(solid)
            if drawn is None:
                continue
            node = owners.get(solid.parentFrame)
            if node is None:
                continue
            geometry, extra = drawn
            r, g, b, opacity = solid.meshColor
            colour = (int(255 * r) << 16) + (int(255 * g) << 8) + int(255 * b)
            material = shape.MeshLambertMaterial(color=colour, opacity=float(opacity))
            place = self._root[name][node][str(i)]
            place.set_object(geometry, material)
            in_node = model.frames[solid.parentFrame].placement.actInv(solid.placement)
            place.set_transform(in_node.homogeneous @ extra)
        for node in {mechanism.nodes[-1], *(node for node, _ in mechanism.sensor_constraints)}:
            self._root[name][node]["triad"].set_object(shape.triad(0.15 * mechanism.length))
        for loop in mechanism.loops:
            mark = self._root[name][loop.first][f"loop {loop.name}"]
            ball = shape.MeshLambertMaterial(color=_LOOP, opacity=0.6)
            mark.set_object(shape.Sphere(0.05 * mechanism.length), ball)
            mark.set_transform(loop.first_placement.homogeneous)


def _origins(mechanism: Mechanism) -> Array:
    places: Sequence[Any] = [mechanism.placement(mechanism.q_home, node).translation for node in mechanism.nodes]
    return np.array(places)


def _shape(solid: pin.GeometryObject) -> tuple[Any, Array] | None:
    """A Pinocchio shape as meshcat's, and what turns and scales the one into the other; None if it is unknown."""
    geometry, extra = solid.geometry, np.eye(4)
    if solid.meshPath and solid.meshPath not in ("BOX", "CYLINDER", "SPHERE", "CAPSULE", "CONE", "CONVEX"):
        extra[:3, :3] = np.diag(solid.meshScale)
        kinds = {
            ".stl": shape.StlMeshGeometry,
            ".obj": shape.ObjMeshGeometry,
            ".dae": shape.DaeMeshGeometry,
        }
        for ending, kind in kinds.items():
            if solid.meshPath.lower().endswith(ending):
                return kind.from_file(solid.meshPath), extra
        return None
    if isinstance(geometry, coal.Box):
        return shape.Box((2.0 * geometry.halfSide).tolist()), extra
    if isinstance(geometry, coal.Sphere):
        return shape.Sphere(float(geometry.radius)), extra
    if isinstance(geometry, coal.Cylinder):
        extra[:3, :3] = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]  # three.js's cylinders stand along y
        return shape.Cylinder(2.0 * float(geometry.halfLength), float(geometry.radius)), extra
    return None
