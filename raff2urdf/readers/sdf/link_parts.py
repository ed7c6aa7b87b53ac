"""Inertia and visuals of the links of an SDF."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from yourdfpy import Material, Visual

from raff2urdf.inertia import Inertia
from raff2urdf.readers.screw import parameter
from raff2urdf.readers.sdf.poses import pose
from raff2urdf.readers.urdf import LARGEST, negative_mass, numbers
from raff2urdf.readers.urdf_builder import Shape, material, shapes
from raff2urdf.readers.urdf_file import SHAPES
from raff2urdf.readers.xml_file import error_at


def inertia_of(element: Any, link: str, file: str) -> Inertia:
    """Return the inertia of a link in its own axes, of an element `inertial`. Numbers that are left out are those of
    the format: 1 kg, and 1 kg m2 about each axis.

    Raises:
        RaffError: a number can't be read or meant.
    """

    label = f"link '{link}'"
    mass = parameter(element, "mass", label, file, 1.0)
    if mass < 0.0:
        raise error_at(file, element.find("mass"), negative_mass(label, mass))
    words = [[f"inertia/i{''.join(sorted(i + j))}" for j in "xyz"] for i in "xyz"]
    moments = [[parameter(element, words[i][j], label, file, float(i == j)) for j in range(3)] for i in range(3)]
    inertia = Inertia(mass, np.zeros(3), np.array(moments)).in_frame(pose(element, file))
    if not inertia.largest <= LARGEST:
        raise error_at(file, element, f"the inertia of link '{link}' is beyond {LARGEST:g}: check its units")
    return inertia


def visuals_of(link: Any, file: str) -> Iterator[Visual]:
    """Yield the visuals of a link."""
    for visual in link.iterchildren("visual"):
        for shape, offset in _geometry(visual.find("geometry")):
            origin = pose(visual, file) @ offset
            yield Visual(origin=origin, geometry=shape, material=_material(visual))


def _geometry(geometry: Any) -> Iterator[Shape]:
    """Yield the shapes of a visual that URDF has."""
    for shape in () if geometry is None else geometry.iterchildren(*SHAPES):
        sizes = list[float]()
        for word, count in SHAPES[shape.tag].items():
            sizes += (numbers(shape.findtext(word, "1 1 1")) or [1.0, 1.0, 1.0])[:count]
        yield from shapes(shape.tag, sizes, shape.findtext("uri", "").strip())


def _material(visual: Any) -> Material | None:
    for word in ("diffuse", "ambient"):
        rgba = numbers(visual.findtext(f"material/{word}", "none"))
        if rgba is not None and len(rgba) in (3, 4):
            return material([*rgba, 1.0][:4])
    return None
