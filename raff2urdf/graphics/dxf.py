"""Read the surfaces of a DXF file, by ezdxf: 3DFACE, SOLID and TRACE, polyface and polygon meshes (POLYLINE), MESH,
and all of these in blocks (INSERT), which may be rotated, scaled, mirrored, repeated and nested.

Colours are those of AutoCAD's index or true colours, of the entity itself, its layer or its block. Hidden entities are
left out: layers that are off or frozen, invisible entities, paper space. Lines, arcs and texts have no surface and are
left out. Solids (3DSOLID and the like) have one, but in a proprietary format: they are left out too, and listed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ezdxf.colors import BYBLOCK, BYLAYER, aci2rgb, int2rgb
from ezdxf.document import Drawing
from ezdxf.entities.dxfgfx import DXFGraphic
from ezdxf.entities.insert import Insert
from ezdxf.entities.mesh import Mesh
from ezdxf.entities.polyline import DXFVertex, Polyface, Polyline
from ezdxf.entities.solid import Face3d, Solid
from ezdxf.filemanagement import readfile
from ezdxf.math import Matrix44, Vec3

from raff2urdf.errors import Problem, RaffError
from raff2urdf.graphics.surface import Colour, ColouredSurface, Point, Polygons

MOST_IN_BLOCKS = 500_000
"""Largest number of entities in blocks. A short file can stand for more than any memory holds: a block of ten
blocks, of ten blocks each, and so on."""

_SURFACES = ("SURFACE", "EXTRUDEDSURFACE", "LOFTEDSURFACE", "PLANESURFACE", "REVOLVEDSURFACE", "SWEPTSURFACE")
_SOLIDS = ("3DSOLID", "BODY", "REGION", *_SURFACES)

_WHITE = (255, 255, 255)
_BY_DEFAULT = 7  # AutoCAD's index of white


def read(path: str | Path) -> tuple[list[ColouredSurface], str | None]:
    """Return the surfaces of a file, one for each colour, and what was left out; None if nothing was.

    Raises:
        RaffError: it can't be read, is wrong, or holds no surface.
    """
    try:
        document = readfile(path)
        reader = _Reader(document)
        reader.draw(document.modelspace(), _Surroundings())
        surfaces = reader.polygons.surfaces()
        if not surfaces:
            content = f"only {_listed(reader.others)}" if reader.others else "nothing visible"
            raise RaffError(f"holds no faces or meshes, {content}")
    except OSError as error:
        raise _wrong(path, error.strerror or "this is no DXF file") from None
    except RaffError as error:
        raise _wrong(path, error.problems[0].message) from None
    except Exception as error:  # of any type, StopIteration too, if a file is damaged
        raise _wrong(path, f"damaged: {error or type(error).__name__}") from None
    solids = Counter({kind: count for kind, count in reader.others.items() if kind in _SOLIDS})
    return surfaces, f"without its {_listed(solids)}: solids can't be read" if solids else None


def _wrong(path: str | Path, message: str) -> RaffError:
    return RaffError(Problem(message, str(path)))


@dataclass(frozen=True, slots=True)
class _Surroundings:
    """Properties that an entity inherits from the INSERT around it; at first, from the drawing."""

    placement: Matrix44 | None = None
    colour: Colour = (*_WHITE, 255)
    layer: str = "0"
    blocks: tuple[str, ...] = ()  # that are being drawn


@dataclass(slots=True)
class _Reader:
    document: Drawing
    polygons: Polygons = field(default_factory=Polygons)
    others: Counter[str] = field(default_factory=Counter)  # types of visible entities without a surface
    in_blocks: int = 0

    def draw(self, entities: Iterable[Any], around: _Surroundings) -> None:
        for entity in entities:
            if around.blocks:
                self.count_in_blocks()
            if not isinstance(entity, DXFGraphic) or entity.dxf.get("invisible", 0):
                continue
            layer = self.layer_of(entity, around)
            if self.is_hidden(layer, isinstance(entity, Insert)):
                continue
            if isinstance(entity, Insert):
                self.insert(entity, layer, around)
                continue
            drawn = False
            for corners, face in _faces(entity):
                drawn = True
                self.polygons.add(_placed(corners, around.placement), self.colour(face, layer, around))
            if not drawn:
                self.others[entity.dxftype()] += 1

    def insert(self, entity: Insert, layer: str, around: _Surroundings) -> None:
        name = entity.dxf.name
        block = entity.block()
        if block is None:
            raise RaffError(f"the block '{name}' is missing")
        if name in around.blocks:
            raise RaffError(f"block '{name}' contains itself")
        colour = self.colour(entity, layer, around)
        for instance in entity.multi_insert() if entity.mcount > 1 else (entity,):
            self.count_in_blocks()  # an empty block may be repeated a thousand million times
            placement = instance.matrix44() if around.placement is None else instance.matrix44() @ around.placement
            self.draw(block, _Surroundings(placement, colour, layer, (*around.blocks, name)))

    def count_in_blocks(self) -> None:
        self.in_blocks += 1
        if self.in_blocks > MOST_IN_BLOCKS:
            raise RaffError(f"its blocks have more than {MOST_IN_BLOCKS} entities in all")

    def layer_of(self, entity: DXFGraphic, around: _Surroundings) -> str:
        """Return the layer of an entity; of one on layer 0 of a block, that of the INSERT."""
        layer: str = entity.dxf.get("layer", "0")
        return around.layer if layer == "0" else layer

    def is_hidden(self, name: str, is_block: bool) -> bool:
        """Return whether a layer is hidden. A frozen layer hides a block with its content, one that is off does not."""
        if not self.document.layers.has_entry(name):
            return False
        layer = self.document.layers.get(name)
        return layer.is_frozen() or (layer.is_off() and not is_block)

    def colour(self, entity: DXFGraphic, layer: str, around: _Surroundings) -> Colour:
        opacity = round(255 * (1.0 - entity.transparency))
        if entity.dxf.hasattr("true_color"):
            return (*int2rgb(entity.dxf.true_color), opacity)
        index = entity.dxf.get("color", BYLAYER)
        if index == BYBLOCK:
            return around.colour
        if index == BYLAYER:
            return (*self.layer_colour(layer), opacity)
        return (*_of_index(index), opacity)

    def layer_colour(self, name: str) -> tuple[int, int, int]:
        if not self.document.layers.has_entry(name):
            return _WHITE
        layer = self.document.layers.get(name)
        return layer.rgb or _of_index(layer.color)


def _faces(entity: DXFGraphic) -> Iterator[tuple[Sequence[Vec3], DXFGraphic]]:
    """Yield the polygons of an entity, in its own block's coordinates, and the entities with their colours."""
    if isinstance(entity, Face3d | Solid):
        yield entity.wcs_vertices(), entity
    elif isinstance(entity, Mesh):
        points = [Vec3(point) for point in entity.vertices]
        for face in entity.faces:
            if len(face) > 2:
                yield [_vertex(points, index, entity) for index in face], entity
    elif isinstance(entity, Polyface):
        for *corners, record in entity.faces():
            if len(corners) > 2:
                yield [corner.dxf.location for corner in corners], record if _has_colour(record) else entity
    elif isinstance(entity, Polyline) and entity.is_polygon_mesh:
        for corners in _grid(entity):
            yield corners, entity


def _grid(mesh: Polyline) -> Iterator[list[Vec3]]:
    """Yield the quadrangles of a polygon mesh: of its own points, or of those of its smooth surface."""
    frame = DXFVertex.SPLINE_FRAME_CONTROL_POINT
    points = [vertex.dxf.location for vertex in mesh.vertices if not vertex.dxf.flags & frame]
    m, n = mesh.dxf.get("m_count", 0), mesh.dxf.get("n_count", 0)
    if mesh.dxf.get("smooth_type", 0):
        m, n = mesh.dxf.get("m_smooth_density", m), mesh.dxf.get("n_smooth_density", n)
    if m * n != len(points):
        raise RaffError(f"a polygon mesh of {m} x {n} points has {len(points)} points")
    for i in range(m if mesh.is_m_closed else m - 1):
        for j in range(n if mesh.is_n_closed else n - 1):
            down, right = (i + 1) % m, (j + 1) % n
            yield [points[n * a + b] for a, b in ((i, j), (down, j), (down, right), (i, right))]


def _vertex(points: Sequence[Vec3], index: int, entity: DXFGraphic) -> Vec3:
    if not 0 <= index < len(points):
        raise RaffError(f"a {entity.dxftype()} of {len(points)} points refers to point {index + 1}")
    return points[index]


def _placed(corners: Sequence[Vec3], placement: Matrix44 | None) -> list[Point]:
    """Return corners in the drawing's coordinates. Their order is reversed if the surface is mirrored."""
    if placement is None:
        return [corner.xyz for corner in corners]
    placed = [corner.xyz for corner in placement.transform_vertices(corners)]
    return placed[::-1] if placement.determinant() < 0.0 else placed


def _has_colour(entity: DXFGraphic) -> bool:
    return bool(entity.dxf.hasattr("true_color") or entity.dxf.get("color", BYLAYER) != BYLAYER)


def _of_index(index: int) -> tuple[int, int, int]:
    return tuple(aci2rgb(index if 0 < index < 256 else _BY_DEFAULT))  # type: ignore[return-value]


def _listed(kinds: Counter[str]) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
