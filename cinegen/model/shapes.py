"""The visual shapes of a mechanism."""

from __future__ import annotations

from pathlib import Path

import coal
import pinocchio as pin
from lxml import etree

from cinegen.errors import LoadError
from cinegen.model.stick import stick_figure
from raff2urdf.errors import RaffError
from raff2urdf.graphics.names import find
from raff2urdf.readers.urdf import parse_xml


def shapes(model: pin.Model, urdf: str, folder: str | None, name: str) -> pin.GeometryModel:
    """The visual shapes that a URDF gives its links, as Pinocchio reads them; a stick figure where it gives none.

    Args:
        model: of the same URDF.
        urdf: its text.
        folder: where its meshes are looked for (`raff2urdf.graphics.names`); None where it names them absolutely.
        name: what errors call it.

    Raises:
        LoadError: a mesh is not there, can't be read, or lies where it must not: with the line that names it.
    """
    tree = parse_xml(urdf, name)
    for geometry in tree.iter("collision"):
        geometry.getparent().remove(geometry)
    meshes = [mesh for visual in tree.iter("visual") for mesh in visual.iter("mesh")]
    names = [mesh.get("filename", "") for mesh in meshes]
    if folder is not None:
        for mesh in meshes:
            try:
                mesh.set("filename", str(find(mesh.get("filename", ""), Path(folder))))
            except RaffError as error:
                raise LoadError(f"{_where(name, mesh.get('filename', ''))}: {error}") from None
    text = etree.tostring(tree, encoding="unicode")
    try:
        found = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL)
    except (ValueError, RuntimeError) as error:
        for mesh, said in zip(meshes, names, strict=True):
            _check(mesh.get("filename"), _where(name, said))
        raise LoadError(f"{name}: the shapes of '{model.name}' can't be read: {error}") from None
    return found if found.geometryObjects else stick_figure(model)


def _check(path: str, where: str) -> None:
    """Raises LoadError where a mesh can't be read."""
    try:
        coal.MeshLoader().load(path)
    except (ValueError, RuntimeError) as error:
        reason = str(error).partition("message: ")[2] or str(error)
        raise LoadError(f"{where}: the mesh '{path}' can't be read: {' '.join(reason.split())}") from None


def _where(name: str, mesh: str) -> str:
    """The file and the line that names a mesh: the URDF may have been made from an SDF or an MJCF."""
    try:
        lines = Path(name).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return name
    words = (mesh, mesh.rpartition("/")[2])
    found = next((i for word in words for i, line in enumerate(lines, 1) if word and word in line), None)
    return name if found is None else f"{name}:{found}"
