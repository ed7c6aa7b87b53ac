"""Drawing commands of meshcat's viewer: objects of three.js, and the nodes of its scene that show them.

The viewer is shipped with cinegen (`static/vendor`). The package meshcat is not used: what it would add is a server of
its own, for which it requires IPython, zmq and twenty more packages.
"""

from __future__ import annotations

import uuid
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import umsgpack
from numpy.typing import ArrayLike

from raff2urdf.escape import path_segment

Json = dict[str, Any]

FORMATS = ("stl", "obj", "dae")
"""Formats of meshes that the viewer reads."""

_ARRAYS = {np.uint8: ("Uint8Array", 0x12), np.uint32: ("Uint32Array", 0x16), np.float32: ("Float32Array", 0x17)}
"""JavaScript's types of arrays, and their extension types in the viewer's MessagePack."""


class Window(Protocol):
    """The receiver of drawing commands."""

    def send(self, command: Json) -> None:
        """Take a drawing command."""


class SceneNode:
    """A node of the viewer's scene.

    Args:
        window: takes the commands.
        path: path of the node, such as /meshcat/robot.

    Attributes:
        path: the same.
    """

    def __init__(self, window: Window, path: str = "/meshcat") -> None:
        self._window, self.path = window, path

    def __getitem__(self, path: str) -> SceneNode:
        """Return the node at a path: below this one, or below the root if it begins with a slash."""
        return SceneNode(self._window, path if path.startswith("/") else f"{self.path}/{path}")

    def named(self, name: str, prefix: str = ":") -> SceneNode:
        """Return the node of a robot, a link or anything else that a file names, below this one."""
        return self[path_segment(name, prefix)]

    def set_object(self, drawn: Json) -> None:
        """Show an object: `mesh` or `triad`."""
        self._send("set_object", object=drawn)

    def set_transform(self, matrix: ArrayLike) -> None:
        """Place the node by a matrix (4, 4), relative to its parent."""
        self._send("set_transform", matrix=np.asarray(matrix, dtype=float).T.ravel().tolist())

    def set_property(self, name: str, value: Any) -> None:
        """Set a property of the viewer."""
        self._send("set_property", property=name, value=value)

    def delete(self) -> None:
        """Remove the node and all below it."""
        self._send("delete")

    def _send(self, kind: str, **values: Any) -> None:
        self._window.send({"type": kind, "path": self.path, **values})


def box(sides: ArrayLike) -> Json:
    """Return a box with sides (3,), m."""
    width, height, depth = np.asarray(sides, dtype=float).tolist()
    return {"type": "BoxGeometry", "width": width, "height": height, "depth": depth}


def sphere(radius: float) -> Json:
    """Return a sphere with a radius, m."""
    return {"type": "SphereGeometry", "radius": radius, "widthSegments": 20, "heightSegments": 20}


def cylinder(height: float, radius: float) -> Json:
    """Return a cylinder along y with a height and a radius, m."""
    ends = {"radiusTop": radius, "radiusBottom": radius}
    return {"type": "CylinderGeometry", **ends, "height": height, "radialSegments": 50}


def triangles(corners: ArrayLike, faces: ArrayLike) -> Json:
    """Return a surface: corners (n, 3), m, and triangles (m, 3), indices of corners."""
    data = {"attributes": {"position": _array(corners, np.float32)}, "index": _array(faces, np.uint32)}
    return {"type": "BufferGeometry", "data": data}


def mesh_file(path: Path) -> Json:
    """Return the mesh in a file of one of `FORMATS`.

    Raises:
        OSError, UnicodeDecodeError: it can't be read.
    """
    kind = path.suffix[1:].lower()
    data = umsgpack.Ext(_ARRAYS[np.uint8][1], path.read_bytes()) if kind == "stl" else path.read_text(encoding="utf-8")
    return {"type": "_meshfile", "format": kind, "data": data}


def material(colour: int, opacity: float = 1.0) -> Json:
    """Return a material: a colour 0xRRGGBB, and an opacity from 0 to 1."""
    return _material("MeshLambertMaterial", colour, opacity, 0)


def mesh(geometry: Json, look: Json) -> Json:
    """Return an object: a geometry with a material."""
    return _object("Mesh", geometry, look)


def triad(size: float) -> Json:
    """Return the axes of a frame as an object: lines of a length, m; x is red, y is green and z is blue."""
    ends = np.zeros((6, 3))
    ends[1::2] = size * np.eye(3)
    colours = np.array(
        [[1.0, 0.0, 0.0], [1.0, 0.6, 0.0], [0.0, 1.0, 0.0], [0.6, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.6, 1.0]]
    )
    attributes = {"position": _array(ends, np.float32), "color": _array(colours, np.float32)}
    lines = {"type": "BufferGeometry", "data": {"attributes": attributes}}
    return _object("LineSegments", lines, _material("LineBasicMaterial", 0xFFFFFF, 1.0, 2))


def _material(kind: str, colour: int, opacity: float, vertex_colours: int) -> Json:
    return {
        "type": kind, "color": colour, "reflectivity": 0.5, "side": 2, "transparent": opacity != 1.0,
        "opacity": opacity, "linewidth": 1.0, "wireframe": False, "wireframeLinewidth": 1.0,
        "vertexColors": vertex_colours,
    }  # fmt: skip


def _object(kind: str, geometry: Json, look: Json) -> Json:
    geometry, look = ({"uuid": str(uuid.uuid4()), **part} for part in (geometry, look))
    return {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [geometry],
        "materials": [look],
        "object": {
            "uuid": str(uuid.uuid4()), "type": kind, "geometry": geometry["uuid"], "material": look["uuid"],
            "matrix": np.eye(4).ravel().tolist(),
        },
    }  # fmt: skip


def _array(values: ArrayLike, kind: type[np.generic]) -> Json:
    """Return an array (n, k) for the viewer."""
    array = np.ascontiguousarray(values, dtype=kind)
    name, code = _ARRAYS[kind]
    return {"itemSize": array.shape[1], "type": name, "array": umsgpack.Ext(code, array.tobytes()), "normalized": False}
