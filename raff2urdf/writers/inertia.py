"""Mass, centre and moments of inertia of links: stated, or estimated from their graphics.

A link without a stated mass is treated as solid, of one density, in the shape of its graphics. Boxes, cylinders and
balls are exact; a mesh that encloses a volume is exact too, any other one counts as its convex hull. Where shapes of
one link overlap, their intersection counts twice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.errors import RaffError, raised_as
from raff2urdf.files import read_bytes
from raff2urdf.inertia import Inertia, sum_of
from raff2urdf.writers import DENSITY
from raff2urdf.writers.tree_at_home import shape_of

if TYPE_CHECKING:  # takes half a second
    from yourdfpy import Geometry, Robot


LEAST_MASS = 1e-9
"""Least mass of a body that moves, kg: simulators refuse a body without mass."""

LEAST_MOMENT = 1e-13
"""Least moment of inertia of a body that moves, about any axis through its centre, kg m2."""

Reader = Callable[[str], Any]
"""Returns the surface of a mesh by its name, in the mesh's own unit: a trimesh.Trimesh."""


@dataclass(frozen=True)
class Inertias:
    """The inertia of every link of a robot.

    Attributes:
        links: by name. Links without a volume have none; others, and bodies that move, have at least `LEAST_MASS` and
            `LEAST_MOMENT`.
        density: of the estimates, kg/m3.
        estimated: links whose mass is estimated from their graphics.
        stated: whether the robot states the mass of any other one.
        raised: links that were raised to the least values.
    """

    links: Mapping[str, Inertia]
    density: float
    estimated: tuple[str, ...] = ()
    stated: bool = False
    raised: tuple[str, ...] = ()

    def sentence(self) -> str:
        """Return their origin as text, for a comment in a file."""
        text = f"Masses are estimated from the graphics, as solid bodies of {self.density:g} kg/m3."
        if self.stated:
            text = "Masses are the robot's own."
        if self.stated and self.estimated:
            text = (
                f"Masses are the robot's own, but those of {', '.join(self.estimated)} are estimated from the graphics"
            )
            text += f", as solid bodies of {self.density:g} kg/m3."
        least = f"Raised to {LEAST_MASS:g} kg and {LEAST_MOMENT:g} kg m2, the least that simulators accept"
        return f"{text} {least}: {', '.join(self.raised)}." if self.raised else text


def inertias(
    model: Robot,
    density: float | None = None,
    read: Reader | None = None,
    moving: Mapping[str, Iterable[tuple[str, Array]]] | None = None,
) -> Inertias:
    """Return the inertia of every link: the robot's own, or estimated from its graphics.

    A body of several links has those that are stated for any of them; if none is, it is estimated.

    Args:
        model: the robot's tree.
        density: of the links, kg/m3; `DENSITY` if None.
        read: reads a mesh by its name; by default, as a file.
        moving: the bodies that move, by the link that represents each: their links, this one too, with their
            placements on it.

    Raises:
        RaffError: the density is not a number above 0.
    """
    density = DENSITY if density is None else density
    if not (np.isfinite(density) and density > 0.0):
        raise RaffError(f"the density is {density:g} kg/m3: it must be a number above 0")
    surface = cache(read or load_surface)
    bodies = {name: carrier for carrier, parts in (moving or {}).items() for name, _ in parts}
    written = {link.name: link.inertial for link in model.links if link.inertial is not None}
    stated = {name: _placed(Inertia(i.mass, matrix=i.inertia), i.origin) for name, i in written.items()}
    known = {bodies.get(name, name) for name in stated}
    masses = {
        link.name: stated.get(link.name, Inertia())
        if bodies.get(link.name, link.name) in known
        else sum_of(
            _placed(of_geometry(v.geometry, density, surface), v.origin) for v in link.collisions or link.visuals
        )
        for link in model.links
    }
    estimated = [name for name, body in masses.items() if bodies.get(name, name) not in known and body.mass > 0.0]
    raised: dict[str, None] = {}

    def least(name: str, body: Inertia) -> Inertia:
        enough = body.at_least(LEAST_MASS, LEAST_MOMENT)
        if enough.mass <= body.mass and np.trace(enough.matrix) <= np.trace(body.matrix):
            return body
        raised[name] = None
        return enough

    for name, body in masses.items():
        if body.mass > 0.0:
            masses[name] = least(name, body)
    for carrier, parts in (moving or {}).items():
        single, whole = masses[carrier], sum_of(masses[name].in_frame(placement) for name, placement in parts)
        enough = least(carrier, whole)
        if enough is not whole:
            matrix = single.matrix + enough.matrix - whole.matrix
            masses[carrier] = Inertia(single.mass + enough.mass - whole.mass, single.centre, matrix)
    return Inertias(masses, density, tuple(estimated), bool(stated), tuple(raised))


def of_geometry(geometry: Geometry, density: float, surface: Reader | None = None) -> Inertia:
    """Return the inertia of a URDF's shape as a solid body, in the shape's own axes."""
    kind, size, file = shape_of(geometry)
    if kind == "mesh":
        return of_surface((surface or load_surface)(file), density, size)
    if kind == "box":
        mass = density * float(np.prod(size))
        return Inertia.from_second(mass, np.zeros(3), mass / 12.0 * np.diag(size**2))
    radius = float(size[0])
    if kind == "cylinder":
        mass = density * np.pi * radius**2 * float(size[1])
        second = mass * np.diag([radius**2 / 4.0, radius**2 / 4.0, size[1] ** 2 / 12.0])
        return Inertia.from_second(mass, np.zeros(3), second)
    mass = density * 4.0 / 3.0 * np.pi * radius**3
    return Inertia(mass, np.zeros(3), 0.4 * mass * radius**2 * np.eye(3))


def of_surface(mesh: Any, density: float, scale: Any = 1.0) -> Inertia:
    """Return the inertia of the volume of a mesh (trimesh.Trimesh), or of its convex hull if it has holes."""
    from scipy.spatial import QhullError

    mesh = mesh.copy()
    mesh.apply_scale(scale)
    with np.errstate(invalid="ignore", divide="ignore"):  # of a surface that encloses nothing
        if not mesh.is_volume:
            try:
                mesh = mesh.convex_hull
            except (QhullError, ValueError, IndexError):  # all points in one plane, or fewer than four
                return Inertia()
    mass = density * float(mesh.volume)
    if not (np.isfinite(mass) and mass > 0.0):
        return Inertia()
    mesh.density = density
    body = Inertia(mass, np.array(mesh.center_mass), np.array(mesh.moment_inertia))
    values, axes = np.linalg.eigh((body.second + body.second.T) / 2.0)
    return Inertia.from_second(mass, body.centre, axes @ np.diag(np.maximum(values, 0.0)) @ axes.T)  # rounding


def load_surface(path: str | Path, content: bytes | None = None) -> Any:
    """Return the mesh in a file as one surface, a trimesh.Trimesh.

    Args:
        path: of the file.
        content: of the file, if it need not be read.

    Raises:
        RaffError: it can't be read.
    """
    import trimesh

    content = read_bytes(path) if content is None else content
    with raised_as(RaffError, Exception, f"{path}: unreadable: "):  # every reader has errors of its own
        return trimesh.load(BytesIO(content), file_type=Path(path).suffix[1:].lower(), force="mesh")


def _placed(body: Inertia, origin: Array | None) -> Inertia:
    return body if origin is None else body.in_frame(origin)
