"""Mass, centre and moments of inertia of links, estimated from their graphics: RAFF says nothing about masses.

A link is taken to be solid, of one density, as its graphics draw it. Boxes, cylinders and balls are exact; a mesh that
encloses a volume is exact too, any other one counts as its convex hull. Where shapes of one link overlap, what they
share counts twice.

Moments are kept as second moments of mass, S = integral of x x^T dm about the centre, since any S without negative
eigenvalues is an inertia that some body has; the inertia matrix is tr(S) - S.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import yourdfpy
from numpy.typing import NDArray

from raff2urdf.errors import RaffError

Array = NDArray[np.float64]

DENSITY = 1000.0
"""kg/m3 where nothing else is asked for: water's, nearly that of plastics. A bar of it weighs what a tube of aluminium
does whose wall is a fifth of its radius."""

LEAST_MASS = 1e-9
"""kg that a body has at least if it moves: simulators refuse it without."""

LEAST_MOMENT = 1e-13
"""kg m2 that it has at least, about any axis through its centre."""

Reader = Callable[[str], Any]
"""Gives the surface behind the name of a mesh, in the mesh's own unit: a trimesh.Trimesh."""


def _no_second() -> Array:
    return np.zeros((3, 3))


def _no_centre() -> Array:
    return np.zeros(3)


@dataclass(frozen=True)
class Inertia:
    """What a body's motion needs forces for, seen from the body's own axes.

    Attributes:
        mass: kg.
        centre: (3,) of mass, m.
        second: (3, 3) second moments of mass about the centre, kg m2.
    """

    mass: float = 0.0
    centre: Array = field(default_factory=_no_centre)
    second: Array = field(default_factory=_no_second)

    @property
    def matrix(self) -> Array:
        """(3, 3) inertia matrix about the centre, kg m2."""
        return np.asarray(np.trace(self.second) * np.eye(3) - self.second)

    @classmethod
    def of_matrix(cls, mass: float, centre: Array, matrix: Array) -> Inertia:
        """The same from an inertia matrix (3, 3) about the centre."""
        return cls(mass, centre, 0.5 * np.trace(matrix) * np.eye(3) - matrix)

    def seen_from(self, placement: Array) -> Inertia:
        """The same body in other axes, from which its own stand at `placement` (4, 4)."""
        rotation = placement[:3, :3]
        second = rotation @ self.second @ rotation.T
        return Inertia(self.mass, rotation @ self.centre + placement[:3, 3], (second + second.T) / 2.0)

    def __add__(self, other: Inertia) -> Inertia:
        """Both bodies as one, by the parallel axes theorem."""
        mass = self.mass + other.mass
        if mass <= 0.0:
            return self
        apart = other.centre - self.centre
        shared = self.mass * other.mass / mass
        return Inertia(
            mass,
            self.centre + other.mass / mass * apart,
            self.second + other.second + shared * np.outer(apart, apart),
        )

    def share(self, part: float) -> Inertia:
        """So much of the body, everywhere alike."""
        return Inertia(part * self.mass, self.centre, part * self.second)

    def at_least(self, mass: float, moment: float) -> Inertia:
        """The same body, with its mass raised to this, and its moments so far that none about its centre is less."""
        lacking = moment - float(np.linalg.eigvalsh(self.matrix)[0])
        second = self.second + max(0.0, lacking) / 2.0 * np.eye(3)
        return Inertia(max(self.mass, mass), self.centre, second)


@dataclass(frozen=True)
class Inertias:
    """The inertia of every link of a robot.

    Attributes:
        links: by name. Links without a volume have none; others, and those that move together with what is fixed on
            them, have at least `LEAST_MASS` and `LEAST_MOMENT`.
        density: kg/m3 with which they were estimated.
        said: links whose inertia the file itself says.
        raised: links that were raised to the least.
    """

    links: Mapping[str, Inertia]
    density: float
    said: tuple[str, ...] = ()
    raised: tuple[str, ...] = ()

    def sentence(self) -> str:
        """How they came about, for a comment in a file."""
        parts = []
        if len(self.said) < len(self.links):
            parts.append(f"Masses are estimated from the graphics, as solid bodies of {self.density:g} kg/m3.")
        if self.said:
            parts.append(f"Masses of {', '.join(self.said)} are the file's own.")
        if self.raised:
            parts.append(
                f"Raised to {LEAST_MASS:g} kg and {LEAST_MOMENT:g} kg m2, the least that simulators take: "
                f"{', '.join(self.raised)}."
            )
        return " ".join(parts)


def inertias(
    model: yourdfpy.Robot,
    density: float = DENSITY,
    read: Reader | None = None,
    moving: Iterable[tuple[str, Iterable[tuple[str, Array]]]] = (),
) -> Inertias:
    """The inertia of every link: as the URDF says, or else estimated from its graphics.

    Args:
        model: the robot's tree.
        density: of what the links are made of, kg/m3.
        read: reads a mesh by its name; as a file unless said.
        moving: the bodies that move: of each, the link that bears it, and the links fixed on it with their placements.

    Raises:
        RaffError: the density is no number above 0.
    """
    if not (np.isfinite(density) and density > 0.0):
        raise RaffError(f"a density of {density:g} kg/m3: it must be a number above 0")
    surfaces: dict[str, Any] = {}

    def surface(name: str) -> Any:
        if name not in surfaces:
            surfaces[name] = (read or load_surface)(name)
        return surfaces[name]

    found: dict[str, Inertia] = {}
    said: list[str] = []
    for link in model.links:
        own = _of_urdf(link.inertial)
        if own is not None:
            said.append(link.name)
        found[link.name] = own if own is not None else sum_of(_of_visual(v, density, surface) for v in link.visuals)
    raised: dict[str, None] = {}
    for name, body in found.items():
        if body.mass > 0.0 and name not in said:
            found[name] = enough = body.at_least(LEAST_MASS, LEAST_MOMENT)
            if enough.mass > body.mass or np.trace(enough.second) > np.trace(body.second):
                raised[name] = None
    for bearer, fixed in moving:
        whole = found[bearer] + sum_of(found[name].seen_from(placement) for name, placement in fixed)
        enough = whole.at_least(LEAST_MASS, LEAST_MOMENT)
        if enough.mass > whole.mass or np.trace(enough.second) > np.trace(whole.second):
            own = found[bearer]
            found[bearer] = Inertia(
                own.mass + enough.mass - whole.mass, own.centre, own.second + enough.second - whole.second
            )
            raised[bearer] = None
    return Inertias(found, density, tuple(said), tuple(raised))


def sum_of(bodies: Iterable[Inertia]) -> Inertia:
    """Several bodies as one."""
    total = Inertia()
    for body in bodies:
        total = body + total if total.mass <= 0.0 else total + body
    return total


def of_geometry(geometry: yourdfpy.Geometry, density: float, surface: Reader | None = None) -> Inertia:
    """A URDF's shape as a solid body, in the shape's own axes."""
    if geometry.box is not None:
        size = np.asarray(geometry.box.size, dtype=float)
        mass = density * float(np.prod(size))
        return Inertia(mass, np.zeros(3), mass / 12.0 * np.diag(size**2))
    if geometry.sphere is not None:
        radius = float(geometry.sphere.radius)
        mass = density * 4.0 / 3.0 * np.pi * radius**3
        return Inertia(mass, np.zeros(3), mass * radius**2 / 5.0 * np.eye(3))
    if geometry.cylinder is not None:
        radius, length = float(geometry.cylinder.radius), float(geometry.cylinder.length)
        mass = density * np.pi * radius**2 * length
        return Inertia(mass, np.zeros(3), mass * np.diag([radius**2 / 4.0, radius**2 / 4.0, length**2 / 12.0]))
    if geometry.mesh is not None:
        scale = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
        return of_surface((surface or load_surface)(geometry.mesh.filename), density, scale)
    return Inertia()


def of_surface(mesh: Any, density: float, scale: Any = 1.0) -> Inertia:
    """What a mesh (trimesh.Trimesh) encloses, or its convex hull if it has holes; nothing if that is flat."""
    from scipy.spatial import QhullError

    mesh = mesh.copy()
    mesh.apply_scale(scale)
    with np.errstate(invalid="ignore", divide="ignore"):  # a surface that encloses nothing has no centre
        if not mesh.is_volume:
            try:
                mesh = mesh.convex_hull
            except (QhullError, ValueError, IndexError):  # all points in one plane, or fewer than four
                return Inertia()
    mass = density * float(mesh.volume)
    if not (np.isfinite(mass) and mass > 0.0):
        return Inertia()
    mesh.density = density
    body = Inertia.of_matrix(mass, np.array(mesh.center_mass), np.array(mesh.moment_inertia))
    values, axes = np.linalg.eigh((body.second + body.second.T) / 2.0)
    return Inertia(mass, body.centre, axes @ np.diag(np.maximum(values, 0.0)) @ axes.T)  # rounding of thin plates


def load_surface(name: str) -> Any:
    """The mesh in a file, as one surface: a trimesh.Trimesh.

    Raises:
        RaffError: it can't be read.
    """
    import trimesh

    try:
        return trimesh.load(name, force="mesh")
    except Exception as error:  # every reader has errors of its own
        raise RaffError(f"{name}: unreadable: {error}") from None


def _of_visual(visual: yourdfpy.Visual, density: float, surface: Reader) -> Inertia:
    if visual.geometry is None:
        return Inertia()
    body = of_geometry(visual.geometry, density, surface)
    return body if visual.origin is None else body.seen_from(visual.origin)


def _of_urdf(inertial: yourdfpy.Inertial | None) -> Inertia | None:
    if inertial is None or inertial.mass is None or inertial.inertia is None:
        return None
    body = Inertia.of_matrix(float(inertial.mass), np.zeros(3), np.asarray(inertial.inertia, dtype=float))
    return body if inertial.origin is None else body.seen_from(inertial.origin)
