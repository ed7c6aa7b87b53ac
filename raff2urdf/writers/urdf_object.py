"""URDFs as objects of yourdfpy, `yourdfpy.URDF`, and their XML.

yourdfpy imports trimesh, which takes half a second: this module is imported where a URDF is made, never where one is
read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import yourdfpy
from lxml import etree
from yourdfpy.urdf import filename_handler_magic

from raff2urdf.arrays import ArrayLike
from raff2urdf.errors import RaffError
from raff2urdf.inertia import Inertia
from raff2urdf.placement import roll_pitch_yaw, translation
from raff2urdf.writers.xml_text import text_of

_ROUNDED = 1e-6  # relative error of a rotation's rows, and of an inertia's symmetry


class ExactUrdf(yourdfpy.URDF):  # type: ignore[misc]  # yourdfpy has no types
    """A URDF without a scene, whose XML has all that its links and joints hold: yourdfpy's own writer leaves out three
    elements of a joint, and its angles lose half of their digits near a pitch of 90 degrees.

    Args:
        robot: its links and joints.
        filename_handler: returns the file of a mesh by its name; by default yourdfpy's, which searches it.
        folder: in which that one searches.

    Attributes:
        folder: relative to which the text names its meshes.
    """

    def __init__(
        self, robot: yourdfpy.Robot, filename_handler: Callable[[str], str] | None = None, folder: str | Path = ""
    ) -> None:
        super().__init__(robot, build_scene_graph=False, filename_handler=filename_handler, mesh_dir=str(folder))
        handler = self._filename_handler
        self._searches = getattr(handler, "func", None) is filename_handler_magic
        self.folder = Path(handler.keywords["dir"] if self._searches else "")

    def text(self) -> str:
        """Return the text of its file; numbers read back to the same doubles.

        Raises:
            RaffError: a link or a joint can't be written: which, and why.
        """
        with self._named(""):
            return text_of(self.write_xml().getroot())

    def _write_link(self, xml_parent: etree._Element, link: yourdfpy.Link) -> None:
        with self._named(f"link '{link.name}' of "):
            super()._write_link(xml_parent, link)

    def _write_joint(self, xml_parent: etree._Element, joint: yourdfpy.Joint) -> None:
        with self._named(f"joint '{joint.name}' of "):
            for word in ("name", "type", "parent", "child"):
                if not isinstance(value := getattr(joint, word), str):
                    raise TypeError(f"its {word} must be a string, not {value!r}")
            super()._write_joint(xml_parent, joint)
            for tag in ("mimic", "calibration", "safety_controller"):  # which yourdfpy reads only
                if (part := getattr(joint, tag)) is not None:
                    values = {word: str(value) for word, value in vars(part).items() if value is not None}
                    etree.SubElement(xml_parent[-1], tag, values)

    def _write_geometry(self, xml_parent: etree._Element, geometry: yourdfpy.Geometry | None) -> None:
        self.clear_errors()
        self._validate_geometry(geometry or yourdfpy.Geometry())
        if self.errors:
            raise ValueError(self.errors[0].msg)
        super()._write_geometry(xml_parent, geometry)

    def _write_inertia(self, xml_parent: etree._Element, inertia: ArrayLike | None) -> None:
        matrix = np.zeros((3, 3)) if inertia is None else np.asarray(inertia, dtype=float)
        if matrix.shape != (3, 3) or not np.abs(matrix - matrix.T).max() <= _ROUNDED * np.abs(matrix).max():
            raise ValueError("its inertia must be a symmetric (3, 3) matrix")
        super()._write_inertia(xml_parent, inertia)

    def _write_texture(self, xml_parent: etree._Element, texture: yourdfpy.Texture | None) -> None:
        if texture is not None and texture.filename is not None:  # as yourdfpy reads an empty element
            super()._write_texture(xml_parent, texture)

    def _write_mesh(self, xml_parent: etree._Element, mesh: yourdfpy.Mesh) -> None:
        name = mesh.filename if self._searches else self._filename_handler(mesh.filename)
        self._write_scale(etree.SubElement(xml_parent, "mesh", filename=name), mesh.scale)

    def _write_origin(self, xml_parent: etree._Element, origin: ArrayLike | None) -> None:
        if origin is None:
            return
        placed = np.asarray(origin, dtype=float)
        turned = placed[:3, :3] if placed.shape == (4, 4) and np.isfinite(placed).all() else np.zeros((3, 3))
        if not (np.abs(turned @ turned.T - np.eye(3)).max() <= _ROUNDED and np.linalg.det(turned) > 0.0):
            raise ValueError("its origin must be a (4, 4) matrix of a rotation and a translation")
        rows = {"xyz": placed[:3, 3].tolist(), "rpy": roll_pitch_yaw(placed)}
        texts = {word: " ".join(str(value + 0.0) for value in row) for word, row in rows.items()}  # no -0.0
        if xml_parent.tag == "inertial" and not any(rows["rpy"]):  # axes are the link's, nearly always
            texts["rpy"] = "0 0 0"
        etree.SubElement(xml_parent, "origin", texts)

    @contextmanager
    def _named(self, part: str) -> Iterator[None]:
        """Report values that can't be written by the part of the robot that has them."""
        try:
            yield
        except (AttributeError, IndexError, TypeError, ValueError) as error:
            raise RaffError(f"{part}robot '{self.robot.name}' can't be written as URDF: {error}") from None


def inertial(body: Inertia | None) -> yourdfpy.Inertial | None:
    """Return the inertia of a link, in its own axes, as an object; None if it is not known."""
    return body and yourdfpy.Inertial(translation(body.centre), float(body.mass), body.matrix + 0.0)


def geometry(kind: str, sizes: ArrayLike, file: str = "") -> yourdfpy.Geometry:
    """Return a shape as an object; `raff2urdf.writers.tree_at_home.shape_of` is the inverse.

    Args:
        kind: box, cylinder, sphere or mesh.
        sizes: m: sides (3,) of a box; radius and length of a cylinder along z; radius of a sphere; scales (3,) of a
            mesh.
        file: of a mesh.
    """
    make = {"box": yourdfpy.Box, "cylinder": yourdfpy.Cylinder, "sphere": yourdfpy.Sphere, "mesh": yourdfpy.Mesh}[kind]
    values = np.asarray(sizes, dtype=float)
    arguments = {"box": (values,), "mesh": (file, values)}.get(kind, values.tolist())
    return yourdfpy.Geometry(**{kind: make(*arguments)})


def material_of(name: str, rgba: ArrayLike) -> yourdfpy.Material:
    """Return a colour, red, green, blue and opacity (4,) from 0 to 1, as an object."""
    return yourdfpy.Material(name, yourdfpy.Color(np.asarray(rgba, dtype=float)))
