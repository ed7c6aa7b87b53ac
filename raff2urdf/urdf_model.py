"""The parts of a URDF that robots are made of here, and its XML. Lengths are in m, angles in rad.

The attributes have the names that yourdfpy gives them. That package is not used: it requires trimesh with the readers
of all formats, which are more than twenty packages, among them an HTTP client.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from raff2urdf.inertia import Inertia
from raff2urdf.placement import roll_pitch_yaw

Array = NDArray[np.float64]


@dataclass(slots=True)
class UrdfBox:
    """A box with sides `size` (3,)."""

    size: Array


@dataclass(slots=True)
class UrdfCylinder:
    """A cylinder along z."""

    radius: float
    length: float


@dataclass(slots=True)
class UrdfSphere:
    """A sphere."""

    radius: float


@dataclass(slots=True)
class UrdfMesh:
    """The mesh of a file, scaled by (3,)."""

    filename: str
    scale: Array


@dataclass(slots=True)
class UrdfGeometry:
    """A shape: one of these."""

    box: UrdfBox | None = None
    cylinder: UrdfCylinder | None = None
    sphere: UrdfSphere | None = None
    mesh: UrdfMesh | None = None


@dataclass(slots=True)
class UrdfMaterial:
    """A colour, red, green, blue and opacity (4,), from 0 to 1."""

    name: str
    rgba: Array


@dataclass(slots=True)
class UrdfVisual:
    """A shape, its placement (4, 4) on the link, and its colour."""

    geometry: UrdfGeometry
    origin: Array | None = None
    material: UrdfMaterial | None = None


@dataclass(slots=True)
class UrdfLink:
    """A link, its shapes, and its inertia in its own axes; None if its mass is unknown."""

    name: str
    visuals: list[UrdfVisual] = field(default_factory=list)
    inertial: Inertia | None = None


@dataclass(slots=True)
class UrdfLimit:
    """Limits of a joint: effort (N or Nm), velocity (1/s), and position unless it is continuous."""

    effort: float
    velocity: float
    lower: float | None = None
    upper: float | None = None


@dataclass(slots=True)
class UrdfJoint:
    """A joint: its type, the links that it connects, the placement (4, 4) of the child on the parent, its axis (3,)."""

    name: str
    type: str
    parent: str
    child: str
    origin: Array
    axis: Array | None = None
    limit: UrdfLimit | None = None


@dataclass(slots=True)
class UrdfRobot:
    """The tree of a robot."""

    name: str
    links: list[UrdfLink] = field(default_factory=list)
    joints: list[UrdfJoint] = field(default_factory=list)


def to_xml(robot: UrdfRobot) -> etree._Element:
    """Return a robot as an element `robot`; numbers read back to the same doubles."""
    root = etree.Element("robot", name=robot.name)
    for link in robot.links:
        element = etree.SubElement(root, "link", name=link.name)
        if link.inertial is not None:
            add_inertial(element, link.inertial)
        for visual in link.visuals:
            _add_visual(element, visual)
    for joint in robot.joints:
        element = etree.SubElement(root, "joint", name=joint.name, type=joint.type)
        etree.SubElement(element, "parent", link=joint.parent)
        etree.SubElement(element, "child", link=joint.child)
        _add_origin(element, joint.origin)
        if joint.axis is not None:
            etree.SubElement(element, "axis", xyz=_numbers(joint.axis))
        if joint.limit is not None:
            limits = ((word, getattr(joint.limit, word)) for word in ("effort", "velocity", "lower", "upper"))
            etree.SubElement(element, "limit", {word: str(value) for word, value in limits if value is not None})
    return root


def add_inertial(link: etree._Element, inertia: Inertia) -> None:
    """Add mass and inertia to a link."""
    element, matrix = etree.SubElement(link, "inertial"), inertia.matrix.tolist()
    etree.SubElement(element, "origin", xyz=_numbers(value + 0.0 for value in inertia.centre.tolist()), rpy="0 0 0")
    etree.SubElement(element, "mass", value=str(float(inertia.mass)))
    upper = {f"i{'xyz'[i]}{'xyz'[j]}": str(matrix[i][j] + 0.0) for i in range(3) for j in range(i, 3)}
    etree.SubElement(element, "inertia", upper)


def _add_visual(link: etree._Element, visual: UrdfVisual) -> None:
    element = etree.SubElement(link, "visual")
    shape, geometry = etree.SubElement(element, "geometry"), visual.geometry
    if geometry.box is not None:
        etree.SubElement(shape, "box", size=_numbers(geometry.box.size))
    elif geometry.cylinder is not None:
        radius, length = str(geometry.cylinder.radius), str(geometry.cylinder.length)
        etree.SubElement(shape, "cylinder", radius=radius, length=length)
    elif geometry.sphere is not None:
        etree.SubElement(shape, "sphere", radius=str(geometry.sphere.radius))
    elif geometry.mesh is not None:
        etree.SubElement(shape, "mesh", filename=geometry.mesh.filename, scale=_numbers(geometry.mesh.scale))
    if visual.origin is not None:
        _add_origin(element, visual.origin)
    if visual.material is not None:
        material = etree.SubElement(element, "material", name=visual.material.name)
        etree.SubElement(material, "color", rgba=_numbers(visual.material.rgba))


def _add_origin(element: etree._Element, origin: Array) -> None:
    rows = {"xyz": origin[:3, 3].tolist(), "rpy": roll_pitch_yaw(origin)}
    etree.SubElement(element, "origin", {word: _numbers(value + 0.0 for value in row) for word, row in rows.items()})


def _numbers(values: Iterable[float]) -> str:
    return " ".join(map(str, values))
