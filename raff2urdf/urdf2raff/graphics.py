"""The graphics of a URDF for a RAFF file.

RAFF names graphic files, in the file's unit of length and in the node's own frame. A mesh that is just that is named as
it is. All else (shapes, and meshes that are placed, scaled or coloured) is written into one GLB for each link, which
holds colours. What raff2urdf draws itself where a RAFF file names nothing is left out.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raff2urdf.document import UNITS_PER_METRE, Document, RaffRobot
from raff2urdf.errors import RaffError
from raff2urdf.graphics.meshes import CONVERTED, SHOWN
from raff2urdf.graphics.names import find
from raff2urdf.graphics.skeleton import SkeletonDrawing
from raff2urdf.placement import from_origin
from raff2urdf.readers.urdf import links, numbers, origin, three

Array = NDArray[np.float64]

_NEAR = 1e-5  # of its size: a shape that differs from the skeleton's by less is the skeleton's


def units_of(tree: Any) -> str:
    """The unit that most meshes of a URDF are in: mm unless their scales say another."""
    counted: dict[str, int] = {}
    for visual in tree.iter("visual"):
        for mesh in visual.iter("mesh"):
            scale = numbers(mesh.get("scale", "1 1 1")) or [0.0]
            for unit, per_metre in UNITS_PER_METRE.items():
                if all(abs(value * per_metre - 1.0) <= 1e-9 for value in scale):
                    counted[unit] = counted.get(unit, 0) + 1
    return max(counted, key=counted.__getitem__, default="mm")


class Carried:
    """The graphics of one URDF.

    Args:
        tree: its root element.
        name: what errors call it.
        folder: its own; its meshes are looked for from there.
        out: the folder of the RAFF file.
        stem: of the RAFF file's name: what is written goes to `<stem>_graphics` beside it.

    Attributes:
        written: files to be written, with their bytes.
    """

    def __init__(self, tree: Any, name: str, folder: Path, out: Path, stem: str) -> None:
        self.name, self.folder, self.out, self.stem = name, folder, out, stem
        self.links = {link.get("name"): link for link in links(tree)}
        self.colours = {m.get("name"): _rgba(m) for m in tree.iterchildren("material") if m.find("color") is not None}
        self.written: dict[Path, bytes] = {}

    def robot(self, document: Document, nodes: Mapping[str, str]) -> RaffRobot:
        """The document's robot with the graphic files of its nodes.

        Args:
            document: with the robot, without graphics.
            nodes: the URDF's links -> the robot's nodes.

        Raises:
            RaffError: a mesh is missing, can't be read, or lies where it must not: with its line.
        """
        robot = document.robot()
        skeleton = SkeletonDrawing(document, robot)
        per_metre = UNITS_PER_METRE[document.units]
        drawn = {part.node: skeleton.draw(part) for part in (robot.base, *robot.parts)}
        seen: dict[str, list[Any]] = {node: [] for node in drawn}
        for link, node in nodes.items():
            seen[node] += self.links[link].iterchildren("visual")
        files: dict[str, tuple[str, ...] | None] = {}
        for node, visuals in seen.items():
            plain = not any(seen.values()) or self._as_drawn(visuals, drawn[node])
            files[node] = None if plain else tuple(self._files(visuals, node, per_metre))
        base = replace(robot.base, filenames=files["base"])
        return replace(robot, base=base, parts=tuple(replace(p, filenames=files[p.node]) for p in robot.parts))

    def _files(self, visuals: Sequence[Any], node: str, per_metre: float) -> list[str]:
        named, baked = [], []
        for visual in visuals:
            mesh = visual.find("geometry/mesh")
            path = None if mesh is None else self._path(mesh)
            if mesh is not None and path is not None and self._is_plain(visual, mesh, path, per_metre):
                named.append(Path(os.path.relpath(path, self.out)).as_posix())
            else:
                baked.append(visual)
        if baked:
            file = f"{self.stem}_graphics/{node}.glb"
            self.written[self.out / file] = self._glb(baked, per_metre)
            named.append(file)
        return named

    def _path(self, mesh: Any) -> Path:
        try:
            return find(mesh.get("filename", ""), self.folder)
        except RaffError as error:
            raise RaffError(f"{self.name}:{mesh.sourceline}: {error}") from None

    def _is_plain(self, visual: Any, mesh: Any, path: Path, per_metre: float) -> bool:
        """Whether a file can be named as it is."""
        scale = np.array(three(mesh, "scale", self.name, "1 1 1")) * per_metre
        placed = from_origin(*origin(visual, self.name))
        return bool(
            path.suffix.lower() in (*SHOWN, *CONVERTED)
            and np.abs(scale - 1.0).max() <= 1e-9
            and np.array_equal(placed, np.eye(4))
            and self._colour(visual) is None
            and '"' not in str(path)
            and len(self._scene(mesh).geometry)  # so that what can't be read is told now
        )

    def _glb(self, visuals: Sequence[Any], per_metre: float) -> bytes:
        import trimesh

        scene = trimesh.Scene()
        for i, visual in enumerate(visuals):
            placed, colour = from_origin(*origin(visual, self.name)), self._colour(visual)
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
        """The shape of a visual in the visual's frame, metres."""
        import trimesh

        shape = (
            next(iter(visual.find("geometry").iterchildren("*")), None) if visual.find("geometry") is not None else None
        )
        if shape is None:
            raise RaffError(f"{self.name}:{visual.sourceline}: a visual without a shape")
        if shape.tag == "mesh":
            scale = np.array(three(shape, "scale", self.name, "1 1 1"))
            stretch = np.diag([*scale, 1.0])
            found = [mesh for mesh in self._scene(shape).dump() if isinstance(mesh, trimesh.Trimesh)]
            for mesh in found:
                mesh.apply_transform(stretch)
            return found
        if shape.tag == "box":
            return [trimesh.creation.box(extents=three(shape, "size", self.name))]
        if shape.tag == "sphere":
            return [trimesh.creation.icosphere(subdivisions=2, radius=self._length(shape, "radius"))]
        if shape.tag in ("cylinder", "capsule"):
            make = getattr(trimesh.creation, shape.tag)
            return [make(radius=self._length(shape, "radius"), height=self._length(shape, "length"))]
        raise RaffError(f"{self.name}:{shape.sourceline}: the shape <{shape.tag}> is none of URDF's")

    def _length(self, shape: Any, word: str) -> float:
        found = numbers(shape.get(word, ""))
        if found is None or len(found) != 1 or found[0] <= 0.0:
            message = f'{word}="{shape.get(word)}" of <{shape.tag}> must be a number above 0'
            raise RaffError(f"{self.name}:{shape.sourceline}: {message}")
        return found[0]

    def _scene(self, mesh: Any) -> Any:
        import trimesh

        path = self._path(mesh)
        try:
            scene = trimesh.load_scene(path)
            if scene.is_empty:
                raise ValueError("it holds no surface")
        except Exception as error:  # every reader has errors of its own
            said = " ".join(str(error).split()) or type(error).__name__
            raise RaffError(f"{self.name}:{mesh.sourceline}: the mesh '{path}' can't be read: {said[:200]}") from None
        return scene

    def _colour(self, visual: Any) -> tuple[float, ...] | None:
        material = visual.find("material")
        if material is None:
            return None
        return _rgba(material) or self.colours.get(material.get("name"))

    def _as_drawn(self, visuals: Sequence[Any], drawn: Sequence[Any]) -> bool:
        """Whether shapes are those that raff2urdf draws where no file is named."""
        if len(visuals) != len(drawn):
            return False
        return all(self._like(visual, own) for visual, own in zip(visuals, drawn, strict=True))

    def _like(self, visual: Any, drawn: Any) -> bool:
        geometry = visual.find("geometry")
        shape = None if geometry is None else next(iter(geometry.iterchildren("*")), None)
        own = next((k, v) for k, v in vars(drawn.geometry).items() if v is not None)
        if shape is None or shape.tag != own[0]:
            return False
        said = [numbers(shape.get(word, "")) for word in ("size", "radius", "length") if shape.get(word)]
        want = [np.ravel(getattr(own[1], word)) for word in ("size", "radius", "length") if hasattr(own[1], word)]
        if len(said) != len(want) or any(a is None or len(a) != len(b) for a, b in zip(said, want, strict=True)):
            return False
        size = max(float(np.abs(b).max()) for b in want)
        placed = from_origin(*origin(visual, self.name)) - (np.eye(4) if drawn.origin is None else drawn.origin)
        sizes = max(float(np.abs(np.array(a) - b).max()) for a, b in zip(said, want, strict=True))
        colour = self._colour(visual)
        return bool(
            sizes <= _NEAR * size
            and np.abs(placed[:3, :3]).max() <= _NEAR
            and np.abs(placed[:3, 3]).max() <= _NEAR * size
            and colour is not None
            and np.abs(np.array(colour) - drawn.material.color.rgba).max() <= 1.0 / 255.0
        )


def _rgba(material: Any) -> tuple[float, ...] | None:
    colour = material.find("color")
    found = None if colour is None else numbers(colour.get("rgba", ""))
    return None if found is None or len(found) != 4 else tuple(min(max(value, 0.0), 1.0) for value in found)
