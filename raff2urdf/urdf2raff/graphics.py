"""Convert the graphics of a URDF to those of a RAFF file.

RAFF names graphic files, in the file's unit of length and in the node's own frame. A mesh that has both is named as it
is. Everything else (shapes, and meshes that are placed, scaled or coloured) is written into one GLB for each link, with
its colours. Shapes that raff2urdf draws itself if a RAFF file names no graphics are left out.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from raff2urdf.errors import RaffError
from raff2urdf.graphics.bodies import BodyDrawing
from raff2urdf.graphics.body_shapes import Shape
from raff2urdf.graphics.collada import unit_of
from raff2urdf.graphics.meshes import CONVERTED, SHOWN
from raff2urdf.graphics.names import Packages, find, may_read
from raff2urdf.graphics.solids import triangles
from raff2urdf.raff.document import UNITS_PER_METRE, Document, RaffFrame, RaffNode, RaffRobot
from raff2urdf.readers.urdf import links, numbers, origin, three
from raff2urdf.readers.urdf_file import SHAPES
from raff2urdf.readers.xml_file import error_at

_NEAR = 1e-5  # of its size: a shape that differs from the skeleton's by less is the skeleton's


def units_of(tree: Any) -> str:
    """Return the unit of most meshes of a URDF, according to their scales; mm by default."""
    counted: Counter[str] = Counter()
    for mesh in tree.iterfind(".//visual//mesh"):
        scale = numbers(mesh.get("scale", "1 1 1")) or [0.0]
        counted.update(u for u, per in UNITS_PER_METRE.items() if all(abs(v * per - 1.0) <= 1e-9 for v in scale))
    return max(counted, key=counted.__getitem__, default="mm")


class GraphicsExport:
    """The graphics of one URDF.

    Args:
        tree: its root element.
        name: of the file, in errors.
        folder: of the URDF; its meshes are looked for relative to it.
        out: the folder of the RAFF file.
        stem: of the RAFF file's name: graphics are written to the folder `<stem>_graphics` next to it.
        packages: the search for packages.

    Attributes:
        files: files to be written, with their contents.
        lost: what is wrong with meshes that are missing, unreadable or empty, or where they are not allowed, by name:
            they are left out.
    """

    def __init__(self, tree: Any, name: str, folder: Path, out: Path, stem: str, packages: Packages) -> None:
        self.name, self.folder, self.out, self.stem, self.packages = name, folder, out, stem, packages
        self.links = {link.get("name"): link for link in links(tree)}
        self.colours = {m.get("name"): _rgba(m) for m in tree.iterchildren("material") if m.find("color") is not None}
        self.files: dict[Path, bytes] = {}
        self.lost: dict[str, str] = {}
        self._scenes: dict[str, tuple[Path, Any]] = {}

    def robot(self, document: Document, nodes: Mapping[str, str]) -> RaffRobot:
        """Return the document's robot with the graphic files of its nodes.

        Args:
            document: with the robot, without graphics.
            nodes: the URDF's links -> the robot's nodes.

        Raises:
            RaffError: a shape is not in URDF: with its line.
        """
        robot = document.robot()
        bodies = BodyDrawing(document, robot)
        per_metre = UNITS_PER_METRE[document.units]
        visuals: dict[str, list[Any]] = {node.node: [] for node in (robot.base, *robot.parts)}
        for link, node in nodes.items():
            visuals[node] += self.links[link].iterchildren("visual")
        if not any(visuals.values()):
            return robot
        files: dict[str, tuple[str, ...] | None] = {}
        drawn: list[RaffNode] = []  # as skeletons, since all that they showed is lost
        for part in robot.nodes.values():
            shown = visuals[part.node]
            skeletal = self._is_skeleton(shown, bodies.of(part))
            files[part.node] = None if skeletal else tuple(self._files(shown, part.node, per_metre))
            if shown and files[part.node] == ():
                drawn.append(part)
        for lost in drawn:
            files[lost.node], carrier = None, lost
            while isinstance(carrier, RaffFrame):  # its link has the bars
                carrier = robot.nodes[carrier.pred]
                files[carrier.node] = files[carrier.node] or None

        def with_files(node: Any) -> Any:
            return replace(node, filenames=files[node.node])

        return replace(robot, base=with_files(robot.base), parts=tuple(map(with_files, robot.parts)))

    def _files(self, visuals: Sequence[Any], node: str, per_metre: float) -> list[str]:
        named, baked = [], []
        for visual in visuals:
            mesh = visual.find("geometry/mesh")
            path = None if mesh is None else self._path(mesh)
            if mesh is not None and path is None:
                continue
            if mesh is not None and path is not None and self._is_plain(visual, mesh, path, per_metre):
                named.append(Path(os.path.relpath(path, self.out)).as_posix())
            else:
                baked.append(visual)
        if baked:
            file = f"{self.stem}_graphics/{node}.glb"
            self.files[self.out / file] = self._glb(baked, per_metre)
            named.append(file)
        return named

    def _path(self, mesh: Any) -> Path | None:
        """Return the file of a mesh; None if it is lost, which `lost` reports then."""
        name = mesh.get("filename", "")
        try:
            path = find(name, self.folder, packages=self.packages)
            if name not in self._scenes:
                self._scenes[name] = path, _scene(path)
            return path
        except RaffError as error:
            self.lost.setdefault(name, str(error_at(self.name, mesh, str(error))))
            return None

    def _is_plain(self, visual: Any, mesh: Any, path: Path, per_metre: float) -> bool:
        """Return whether a file can be named as it is."""
        scale = unit_of(path) * np.array(three(mesh, "scale", self.name, "1 1 1")) * per_metre
        return bool(
            path.suffix.lower() in (*SHOWN, *CONVERTED)
            and may_read(path, self.out)
            and np.abs(scale - 1.0).max() <= 1e-9
            and np.array_equal(origin(visual, self.name), np.eye(4))
            and self._colour(visual) is None
            and '"' not in str(path)
        )

    def _glb(self, visuals: Sequence[Any], per_metre: float) -> bytes:
        import trimesh

        scene = trimesh.Scene()
        for i, visual in enumerate(visuals):
            placed, colour = origin(visual, self.name), self._colour(visual)
            for j, mesh in enumerate(self._meshes(visual)):
                mesh.apply_transform(placed)
                mesh.apply_scale(per_metre)
                if colour is not None:
                    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[round(255 * c) for c in colour])
                    mesh.visual = trimesh.visual.TextureVisuals(material=material)
                scene.add_geometry(mesh, geom_name=f"visual {i} {j}", node_name=f"visual {i} {j}")
        content: bytes = scene.export(file_type="glb")
        return content

    def _meshes(self, visual: Any) -> list[Any]:
        """Return the shape of a visual in the visual's frame, metres."""
        import trimesh

        shape = _shape(visual)
        if shape is None:
            raise error_at(
                self.name,
                visual,
                "this visual has no shape: add a <box>, <cylinder>, <sphere> or <mesh> in a <geometry>",
            )
        if shape.tag == "mesh":
            path, scene = self._scenes[shape.get("filename", "")]
            scale = unit_of(path) * np.array(three(shape, "scale", self.name, "1 1 1"))
            meshes = [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh)]
            for mesh in meshes:
                mesh.apply_transform(np.diag([*scale, 1.0]))
            return meshes
        if shape.tag == "box":
            return [trimesh.creation.box(extents=three(shape, "size", self.name))]
        if shape.tag == "sphere":
            return [trimesh.creation.icosphere(subdivisions=2, radius=self._length(shape, "radius"))]
        if shape.tag in ("cylinder", "capsule"):
            make = getattr(trimesh.creation, shape.tag)
            return [make(radius=self._length(shape, "radius"), height=self._length(shape, "length"))]
        raise error_at(
            self.name, shape, f"the shape <{shape.tag}> is not in URDF: use <box>, <cylinder>, <sphere> or <mesh>"
        )

    def _length(self, shape: Any, word: str) -> float:
        values = numbers(shape.get(word, ""))
        if values is None or len(values) != 1 or values[0] <= 0.0:
            message = f'{word}="{shape.get(word)}" of <{shape.tag}> must be a number above 0'
            raise error_at(self.name, shape, message)
        return values[0]

    def _colour(self, visual: Any) -> tuple[float, ...] | None:
        material = visual.find("material")
        if material is None:
            return None
        return _rgba(material) or self.colours.get(material.get("name"))

    def _is_skeleton(self, visuals: Sequence[Any], drawn: Sequence[Shape]) -> bool:
        """Return whether shapes are those that raff2urdf draws if no file is named."""
        return len(visuals) == len(drawn) and all(map(self._is_like, visuals, drawn))

    def _is_like(self, visual: Any, drawn: Shape) -> bool:
        shape, kind, sizes = _shape(visual), drawn.kind, np.array(drawn.sizes)
        written = (
            [] if shape is None else [value for word in SHAPES[kind] for value in numbers(shape.get(word, "nan")) or []]
        )
        if shape is None or shape.tag != kind or len(written) != len(sizes):
            return False
        size = float(np.abs(sizes).max())
        placed, colour = origin(visual, self.name) - drawn.placement, self._colour(visual)
        return bool(
            np.abs(written - sizes).max() <= _NEAR * size
            and np.abs(placed[:3, :3]).max() <= _NEAR
            and np.abs(placed[:3, 3]).max() <= _NEAR * size
            and colour is not None
            and np.abs(np.array(colour)[:3] - drawn.colour).max() <= 1.0 / 255.0
            and (kind != "mesh" or self._is_solid(shape, drawn.recipe))
        )

    def _is_solid(self, mesh: Any, recipe: str) -> bool:
        """Return whether a mesh is a solid that raff2urdf draws."""
        if self._path(mesh) is None:
            return False
        (surface, *others) = [np.asarray(m.triangles) for m in self._scenes[mesh.get("filename", "")][1].dump()]
        solid = triangles(recipe)
        solid = solid[np.any(np.cross(solid[:, 1] - solid[:, 0], solid[:, 2] - solid[:, 0]) != 0.0, axis=1)]
        return not others and surface.shape == solid.shape and bool(np.abs(surface - solid).max() <= 10.0 * _NEAR)


def _scene(path: Path) -> Any:
    """Return a mesh as a scene of trimesh.

    Raises:
        RaffError: it can't be read, or holds no surface.
    """
    import trimesh

    try:
        scene = trimesh.load_scene(path)
        if not any(len(getattr(part, "faces", ())) for part in scene.geometry.values()):  # points and lines have none
            raise ValueError("it holds no surface")
    except Exception as error:  # each reader has its own errors
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RaffError(f"the mesh '{path}' can't be read: {reason[:200]}: export it again") from None
    return scene


def _shape(visual: Any) -> Any:
    geometry = visual.find("geometry")
    return None if geometry is None else next(iter(geometry.iterchildren("*")), None)


def _rgba(material: Any) -> tuple[float, ...] | None:
    colour = material.find("color")
    rgba = None if colour is None else numbers(colour.get("rgba", ""))
    return None if rgba is None or len(rgba) != 4 else tuple(min(max(value, 0.0), 1.0) for value in rgba)
