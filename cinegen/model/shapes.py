"""The visual and collision shapes of a mechanism."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import coal
import pinocchio as pin
from lxml import etree

from cinegen.errors import LoadError, warn
from cinegen.model.stick import stick_figure
from raff2urdf.errors import RaffError
from raff2urdf.graphics.meshes import CONVERTED, SHOWN, Drawing, converted
from raff2urdf.graphics.names import find
from raff2urdf.readers import TEXT
from raff2urdf.readers.xml_file import parse_xml

if TYPE_CHECKING:
    from cinegen.model.mechanism import MechanismSource

_MOST = 10  # meshes that a warning names


def shapes(model: pin.Model, source: MechanismSource) -> pin.GeometryModel:
    """Return the visual shapes of a URDF's links; a stick figure if there are none.

    One warning names the meshes that are missing, or where they are not allowed. Where a link has no other shape, the
    sticks of its body are drawn.

    Args:
        model: of the same URDF.
        source: the URDF, and where its meshes are searched.

    Raises:
        LoadError: a mesh can't be read; with the line that names it.
    """
    tree = parse_xml(source.urdf, source.name)
    bare, lost = _remove_lost(tree, source)
    found = _read(tree, model, source)
    sticks = stick_figure(model)
    if lost:
        more = f"; and {len(lost) - _MOST} more" if len(lost) > _MOST else ""
        warn(f"{'; '.join(lost[:_MOST])}{more}; sticks are drawn instead")
    if not found.geometryObjects:
        return sticks
    joints = {model.frames[model.getFrameId(link, pin.FrameType.BODY)].parentJoint for link in bare}
    for stick in sticks.geometryObjects:
        if stick.parentJoint in joints:
            found.addGeometryObject(stick)
    return found


def collision_shapes(model: pin.Model, source: MechanismSource) -> pin.GeometryModel:
    """Return the collision shapes of a URDF's links; the bars of a stick figure if there are no shapes at all.

    A link without collision shapes collides by its visual shapes.

    Args:
        model: of the same URDF.
        source: the URDF, and where its meshes are searched.

    Raises:
        LoadError: a mesh is missing, can't be read, or is where it is not allowed; with the line that names it.
    """
    tree = parse_xml(source.urdf, source.name)
    for link in tree.iterchildren("link"):
        collisions = list(link.iterchildren("collision"))
        for visual in list(link.iterchildren("visual")) if collisions else ():
            link.remove(visual)
        for collision in collisions:
            collision.tag = "visual"
    found = _read(tree, model, source)
    return found if found.geometryObjects else _bars(stick_figure(model))


def _find(mesh: str, source: MechanismSource) -> Path:
    """Return a mesh by its name.

    Raises:
        RaffError: it is missing, or is where it is not allowed.
    """
    if source.folder is None and source.owner is None:
        return Path(mesh)
    owner = None if source.owner is None else Path(source.owner)
    try:
        return find(mesh, Path(source.folder or source.owner or ""), owner)
    except RaffError as error:
        if source.name != TEXT:
            raise
        raise RaffError(f"{error}: a text names files from the folder that was current when it was loaded") from None


def _remove_lost(tree: Any, source: MechanismSource) -> tuple[list[str], list[str]]:
    """Remove the visuals of a URDF's tree whose meshes can't be found; return the links that have no others, and what
    is wrong with each mesh, where it is named first."""
    bare, lost = list[str](), dict[str, str]()
    for link in tree.iterchildren("link"):
        visuals = list(link.iterchildren("visual"))
        for visual in visuals:
            for filename in [mesh.get("filename", "") for mesh in visual.iter("mesh")]:
                try:
                    _find(filename, source)
                except RaffError as error:
                    lost.setdefault(filename, f"{_where(source.name, filename)}: {error}")
                    link.remove(visual)
                    break
        if visuals and link.find("visual") is None:
            bare.append(link.get("name"))
    return bare, list(lost.values())


def _read(tree: Any, model: pin.Model, source: MechanismSource) -> pin.GeometryModel:
    """Return the <visual> elements of a URDF's tree, which is changed, as shapes.

    Raises:
        LoadError: a mesh is missing, can't be read, or is where it is not allowed; with the line that names it.
    """
    name = source.name
    _keep_shapes(tree)
    meshes: list[tuple[str, str]] = []  # files that Pinocchio reads, and where they are named
    for visual in list(tree.iter("visual")):
        for mesh in visual.iter("mesh"):
            filename = mesh.get("filename", "")
            try:
                path = _find(filename, source)
                mesh.set("filename", str(path))
                if path.suffix.lower() not in SHOWN:
                    _replace(visual, _converted(path))
            except RaffError as error:
                raise LoadError(f"{_where(name, filename)}: {error}") from None
            meshes.append((str(path), _where(name, filename)))
    text = etree.tostring(tree, encoding="unicode")
    try:
        return pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL)
    except (ValueError, RuntimeError) as error:
        for path_of_mesh, where in meshes:
            _check(path_of_mesh, where)
        raise LoadError(f"{name}: the shapes of '{model.name}' can't be read: {error}") from None


def _bars(figure: pin.GeometryModel) -> pin.GeometryModel:
    """Return a stick figure without the drums that mark its joints' axes, except those of links without bars; with
    round ends, because distances between capsules are fast."""
    kept, barred = pin.GeometryModel(), {s.parentJoint for s in figure.geometryObjects if s.name.startswith("bar ")}
    for solid in figure.geometryObjects:
        if solid.name.startswith("bar ") or solid.parentJoint not in barred:
            if isinstance(solid.geometry, coal.Cylinder):
                solid.geometry = coal.Capsule(solid.geometry.radius, 2.0 * solid.geometry.halfLength)
            kept.addGeometryObject(solid)
    return kept


def _converted(path: Path) -> list[Drawing]:
    """Return a file that Pinocchio does not read, or hangs on, as files that it reads.

    Raises:
        RaffError: it can't be read here either.
    """
    if path.suffix.lower() not in CONVERTED:
        raise RaffError(f"the mesh '{path}' can't be read: only {', '.join((*SHOWN, *CONVERTED))} can")
    try:
        return converted(path)
    except Exception as error:  # every reader has errors of its own
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RaffError(f"the mesh '{path}' can't be read: {reason[:200]}") from None


def _replace(visual: Any, drawings: Sequence[Drawing]) -> None:
    """Replace a visual by one for each drawing."""
    for drawing in drawings:
        copied = copy.deepcopy(visual)
        copied.find("geometry/mesh").set("filename", str(drawing.path))
        if copied.find("material") is None and drawing.colour is not None:
            rgba = " ".join(str(channel / 255.0) for channel in drawing.colour)
            material = etree.SubElement(copied, "material", name=f"colour {rgba}")
            etree.SubElement(material, "color", rgba=rgba)
        visual.addnext(copied)
    visual.getparent().remove(visual)


def _keep_shapes(tree: Any) -> None:
    """Remove elements that shapes do not need, or that are repeated: Pinocchio refuses some of them.

    The placements of the links come from the model.
    """
    tree.set("name", tree.get("name") or "robot")
    known: set[str | None] = set()
    for element in list(tree.iter("collision", "inertial")):
        element.getparent().remove(element)
    for joint in tree.iterchildren("joint"):
        joint.set("type", "fixed")
        for element in list(joint.iterchildren()):
            if element.tag not in ("parent", "child"):
                joint.remove(element)
    for material in list(tree.iterchildren("material")):
        if material.get("name") in known:
            tree.remove(material)
        known.add(material.get("name"))


def _check(path: str, where: str) -> None:
    """Raise LoadError if a mesh can't be read."""
    try:
        coal.MeshLoader().load(path)
    except (ValueError, RuntimeError) as error:
        reason = str(error).partition("message: ")[2] or str(error)
        raise LoadError(f"{where}: the mesh '{path}' can't be read: {' '.join(reason.split())}") from None


def _where(name: str, mesh: str) -> str:
    """Return the file and the line that names a mesh; the URDF may have been made from an SDF or an MJCF."""
    try:
        lines = Path(name).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return name
    words = (mesh, mesh.rpartition("/")[2])
    found = next((i for word in words for i, line in enumerate(lines, 1) if word and word in line), None)
    return name if found is None else f"{name}:{found}"
