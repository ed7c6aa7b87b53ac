"""Masses of the bodies of an MJCF, and the meshes on which they depend."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from raff2urdf.errors import RaffError
from raff2urdf.graphics.names import find
from raff2urdf.inertia import Inertia
from raff2urdf.placement import from_quaternion
from raff2urdf.readers.urdf_builder import Shape, shapes

_LEAST = 1e-14
"""kg, kg m2: of bodies without mass, for which MuJoCo needs more than 1e-15."""


def weighing_meshes(mujoco: Any, spec: Any, path: Path) -> tuple[dict[int, int], dict[int, str]]:
    """Return the meshes on which masses depend, by MuJoCo's rules.

    Returns:
        the indices of geoms whose meshes can be read, with those of their bodies; and the bodies of others, with the
        reason.
    """
    settings, rules = spec.compiler, mujoco.mjtInertiaFromGeom
    files = {mesh.name or Path(mesh.file).stem: mesh for mesh in spec.meshes}
    first, last = settings.inertiagrouprange
    bodies = [number for number, body in enumerate(spec.bodies) for _ in body.geoms]
    explicit = [body.explicitinertial for body in spec.bodies]
    known, unknown = dict[int, int](), dict[int, str]()
    for index, (geom, body) in enumerate(zip(spec.geoms, bodies, strict=True)):
        stated = settings.inertiafromgeom == rules.mjINERTIAFROMGEOM_FALSE or explicit[body]
        by_geoms = body > 0 and (settings.inertiafromgeom == rules.mjINERTIAFROMGEOM_TRUE or not stated)
        weightless = geom.mass == 0.0 or (np.isnan(geom.mass) and geom.density == 0.0)
        if not (by_geoms and geom.meshname and first <= geom.group <= last) or weightless:
            continue
        mesh = files.get(geom.meshname)
        try:
            if mesh is not None and mesh.file:
                file = Path(mesh.file).name if spec.strippath else mesh.file
                find((Path(spec.meshdir or "") / file).as_posix(), path.absolute().parent)
            known[index] = body
        except RaffError as error:
            unknown[body] = str(error)
    return known, unknown


def masses_of(model: Any, spec: Any, unknown: Collection[int]) -> dict[int, Inertia]:
    """Return the inertia of bodies in their own axes, by their indices in the compiled model; not of the world.

    Args:
        model: compiled, with the meshes that masses depend on.
        spec: of which it was compiled.
        unknown: indices in `spec` of bodies whose mass is unknown.
    """
    masses = {}
    for number, spec_body in enumerate(spec.bodies):
        body = spec_body.id
        mass = float(model.body_mass[body])
        weightless = mass <= 2.0 * _LEAST and spec.compiler.boundmass <= _LEAST
        if number in unknown or body <= 0 or (weightless and not spec_body.explicitinertial):
            continue
        placed = from_quaternion(model.body_ipos[body], model.body_iquat[body])
        principal = Inertia(mass, np.zeros(3), np.diag(model.body_inertia[body]))
        masses[body] = Inertia() if weightless else principal.in_frame(placed)
    return masses


def remove_meshes(mujoco: Any, spec: Any, kept: Collection[int] = ()) -> dict[str, Shape]:
    """Replace meshes by boxes without mass, and remove everything that is read from other files.

    Args:
        mujoco: the package.
        spec: the file; changed.
        kept: indices of geoms whose meshes remain.

    Returns:
        the meshes by the names of their geoms.
    """
    files = {mesh.name or Path(mesh.file).stem: mesh for mesh in spec.meshes}
    folder = Path(spec.meshdir or "")
    meshes: dict[str, Shape] = {}
    for i, geom in enumerate(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_HFIELD:
            spec.delete(geom)
            continue
        if not geom.meshname or i in kept:
            continue
        geom.name = geom.name or f"mesh {i}"
        mesh = files.get(geom.meshname)
        if mesh is not None and mesh.file:
            (meshes[geom.name],) = shapes("mesh", mesh.scale, (folder / mesh.file).as_posix())
        geom.meshname, geom.type, geom.size = "", mujoco.mjtGeom.mjGEOM_BOX, [1e-3, 1e-3, 1e-3]
        geom.mass = 0.0
    used = {geom.meshname for geom in spec.geoms}
    unused = [mesh for name, mesh in files.items() if name not in used]
    for thing in [*spec.sensors, *spec.lights, *spec.skins, *spec.hfields, *unused]:
        spec.delete(thing)
    for painted in spec.materials:
        painted.textures = [""] * len(painted.textures)
    for texture in list(spec.textures):
        spec.delete(texture)
    settings = spec.compiler  # MuJoCo refuses bodies that move without mass
    settings.boundmass, settings.boundinertia = max(settings.boundmass, _LEAST), max(settings.boundinertia, _LEAST)
    return meshes
