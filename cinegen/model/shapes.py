"""The visual and collision shapes of a mechanism."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import coal
import pinocchio as pin
from lxml import etree

from cinegen.errors import LoadError, warn
from cinegen.model.stick import stick_figure
from raff2urdf.errors import RaffError
from raff2urdf.graphics.collada import unit_of
from raff2urdf.graphics.meshes import CONVERTED, SHOWN, Drawing, converted
from raff2urdf.graphics.names import Packages, find
from raff2urdf.graphics.skeleton import MARK
from raff2urdf.graphics.solids import SCHEME
from raff2urdf.readers import TEXT
from raff2urdf.readers.urdf import three
from raff2urdf.readers.xml_file import parse_xml

if TYPE_CHECKING:
    from cinegen.model.mechanism_model import MechanismSource


_AT_ONCE = 50  # links


class Shapes(NamedTuple):
    """The shapes of a URDF's links.

    Attributes:
        objects: the shapes.
        unchecked: links with meshes that are lost, and why: where a link has no other shape, its sticks collide.
        lost: a sentence about these meshes, empty without one.
    """

    objects: list[pin.GeometryObject]
    unchecked: Mapping[str, str]
    lost: str


def visual_shapes(model: pin.Model, source: MechanismSource) -> Shapes:
    """Return the visual shapes of a URDF's links; a stick figure if there are none.

    One warning names the first mesh that is lost: missing, unreadable, empty, a pointer of Git LFS, or where it is not
    allowed. Where a link has no other shape, the sticks of its body are drawn.

    Args:
        model: of the same URDF.
        source: the URDF, and where its meshes are searched.

    Raises:
        LoadError: the shapes can't be read for another reason.
    """
    return _with_sticks(model, source, parse_xml(source.urdf, source.name), stick_figure(model))


def collision_shapes(model: pin.Model, source: MechanismSource) -> Shapes:
    """Return the collision shapes of a URDF's links; the bars of a stick figure if there are no shapes at all.

    A link without collision shapes collides by its visual shapes. One warning names the first mesh that is lost, as
    that of `visual_shapes`.

    Args:
        model: of the same URDF.
        source: the URDF, and where its meshes are searched.

    Raises:
        LoadError: the shapes can't be read for another reason.
    """
    tree = parse_xml(source.urdf, source.name)
    for link in tree.iterchildren("link"):
        collisions = list(link.iterchildren("collision"))
        for visual in list(link.iterchildren("visual")) if collisions else ():
            link.remove(visual)
        for collision in collisions:
            collision.tag = "visual"
    return _with_sticks(model, source, tree, _bars(stick_figure(model, coal.Capsule)))  # with fast distances


def geometry_model(objects: Iterable[pin.GeometryObject]) -> pin.GeometryModel:
    """Return shapes as Pinocchio takes them."""
    model = pin.GeometryModel()
    for shape in objects:
        model.addGeometryObject(shape)
    return model


def has_collision_shapes(tree: Any) -> bool:
    """Return whether a URDF's tree has collision shapes of the robot: not only those of a skeleton, which, as what is
    drawn does, meet at common points of links."""
    return not all((shape.get("name") or "").startswith(MARK) for shape in tree.iter("collision"))


def lost_meshes(source: MechanismSource) -> str:
    """Return a sentence about meshes that can't be found, as `visual_shapes` warns of them; empty without one.

    None is read.
    """
    tree = parse_xml(source.urdf, source.name)
    return _sentence(_Meshes(tree, source).lost)


def _with_sticks(model: pin.Model, source: MechanismSource, tree: Any, sticks: Iterable[pin.GeometryObject]) -> Shapes:
    """Return the <visual> elements of a URDF's tree, which is changed, as shapes; and sticks where meshes are lost."""
    _keep_shapes(tree)
    drawn = {link.get("name") for link in tree.iterchildren("link") if link.find("visual") is not None}
    meshes = _Meshes(tree, source)
    shapes = meshes.read(model)
    if sentence := _sentence(meshes.lost):
        warn(sentence)
    if not shapes:
        return Shapes(list(sticks), meshes.links, sentence)
    left = {link.get("name") for link in tree.iterchildren("link") if link.find("visual") is not None}
    joints = {model.frames[model.getFrameId(link, pin.FrameType.BODY)].parentJoint for link in drawn - left}
    needed = [stick for stick in sticks if stick.parentJoint in joints] if joints else []
    return Shapes(shapes + needed, meshes.links, sentence)


def _sentence(lost: Mapping[str, str]) -> str:
    if not lost:
        return ""
    more = f"; and {len(lost) - 1} more mesh{'es' * (len(lost) > 2)}" if len(lost) > 1 else ""
    return f"{next(iter(lost.values()))}{more}; sticks are drawn instead"


class _Meshes:
    """The meshes of the <visual> elements of a URDF's tree. Elements whose meshes are lost are removed from it.

    Attributes:
        lost: what is wrong with each mesh that is lost, by its name: where it is named first, why, and the remedy.
        links: names of links that name them, with the same texts.
    """

    def __init__(self, tree: Any, source: MechanismSource) -> None:
        self.tree, self.source = tree, source
        self.lost: dict[str, str] = {}
        self.links: dict[str, str] = {}
        self._files: list[tuple[Any, str, Path]] = []  # that Pinocchio reads: visual, name and file
        is_own = source.owner is None  # a recording or a map can't open folders
        folders = {name: Path(folder) for name, folder in source.packages if is_own}
        packages = Packages(folders, can_be_given=is_own)
        for visual in list(tree.iter("visual")):
            for mesh in visual.iter("mesh"):
                name = mesh.get("filename", "")
                try:
                    path = _find(name, source, packages)
                    self._files.append((visual, name, path))
                    mesh.set("filename", str(path))
                    if (unit := unit_of(path)) != 1.0:
                        scale = three(mesh, "scale", source.name, "1 1 1")
                        mesh.set("scale", " ".join(repr(unit * factor) for factor in scale))
                except RaffError as error:
                    self._lose(visual, name, str(error))
                    break

    def read(self, model: pin.Model) -> list[pin.GeometryObject]:
        """Return the <visual> elements as shapes.

        Raises:
            LoadError: they can't be read, though their meshes can.
        """
        for visual, name, path in self._files:
            if visual.getparent() is not None and path.suffix.lower() not in SHOWN:
                try:
                    _replace(visual, _converted(path))
                except RaffError as error:
                    self._lose(visual, name, str(error))
        try:
            return self._built(model)
        except (ValueError, RuntimeError):  # which names one at most
            for visual, name, path in self._files:
                if visual.getparent() is not None and (why := _why_unreadable(str(path))):
                    self._lose(visual, name, why)
        try:
            return self._built(model)
        except (ValueError, RuntimeError) as error:
            raise LoadError(f"{self.source.name}: the shapes of '{model.name}' can't be read: {error}") from None

    def _built(self, model: pin.Model) -> list[pin.GeometryObject]:
        """Build shapes, of some links at a time: Pinocchio's time grows with the third power of their number."""
        bare, objects, loader = copy.deepcopy(self.tree), list[pin.GeometryObject](), coal.CachedMeshLoader()
        etree.strip_elements(bare, "visual")
        links = list(zip(bare.iterchildren("link"), self.tree.iterchildren("link"), strict=True))
        for first in range(0, len(links), _AT_ONCE):
            for link, complete in links[first : first + _AT_ONCE]:
                link.extend(copy.deepcopy(complete.findall("visual")))
            text = etree.tostring(bare, encoding="unicode")
            built = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL, mesh_loader=loader)
            objects += built.geometryObjects
            for link, _ in links[first : first + _AT_ONCE]:
                etree.strip_elements(link, "visual")
        return objects

    def _lose(self, visual: Any, name: str, why: str) -> None:
        text = self.lost.setdefault(name, f"{_where(self.source.name, name)}: {why}")
        self.links.setdefault(visual.getparent().get("name"), text)
        visual.getparent().remove(visual)


def _find(mesh: str, source: MechanismSource, packages: Packages) -> Path:
    """Return a mesh by its name.

    Raises:
        RaffError: it is missing, or is where it is not allowed.
    """
    if source.folder is None and source.owner is None and not mesh.startswith(f"{SCHEME}://"):
        return Path(mesh)
    owner = None if source.owner is None else Path(source.owner)
    try:
        return find(mesh, Path(source.folder or source.owner or ""), owner, packages)
    except RaffError as error:
        if source.name != TEXT:
            raise
        raise RaffError(f"{error}: a text names files from the folder that was current when it was loaded") from None


def _bars(figure: Iterable[pin.GeometryObject]) -> list[pin.GeometryObject]:
    """Return a stick figure without the drums that mark its joints' axes, except those of links without bars."""
    solids = list(figure)
    barred = {solid.parentJoint for solid in solids if solid.name.startswith("bar ")}
    return [solid for solid in solids if solid.name.startswith("bar ") or solid.parentJoint not in barred]


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
        raise RaffError(f"the mesh '{path}' can't be read: {reason[:200]}: export it again") from None


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


def _why_unreadable(path: str) -> str | None:
    """Return why a mesh can't be read, with the remedy; None if it can."""
    try:
        coal.MeshLoader().load(path)
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).partition("message: ")[2].replace(f"Could not load resource {path}", "").split())
        reason = reason.partition(" Hint: ")[0] or " ".join(str(error).split())
        return f"the mesh '{path}' can't be read: {reason.rstrip('.')}: export it again"
    return None


def _where(name: str, mesh: str) -> str:
    """Return the file and the line that names a mesh; the URDF may have been made from an SDF or an MJCF."""
    try:
        lines = Path(name).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return name
    words = (mesh, mesh.rpartition("/")[2])
    number = next((i for word in words for i, line in enumerate(lines, 1) if word and word in line), None)
    return name if number is None else f"{name}:{number}"
