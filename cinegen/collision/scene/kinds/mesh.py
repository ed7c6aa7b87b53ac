"""A mesh: `file`, beside the scene, `scale`, m in its unit of length; `convex = "hull"` takes its hull for it.

It must be convex, or made of several convex parts that are not connected to each other.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import coal
import numpy as np

from cinegen.collision.scene.solid import Solid, hull
from cinegen.collision.scene.table import FURTHEST, LEAST, Table
from raff2urdf.graphics.meshes import CONVERTED, SHOWN, converted

if TYPE_CHECKING:
    import trimesh

_FULL = 0.999  # of its hull's volume: files have rounded numbers; the hull is what is measured


def solids(table: Table, folder: Path) -> list[Solid]:
    """As `Kind` says."""
    scale = table.size("scale") if "scale" in table else 1.0
    take_hull = "convex" in table and _wants_hull(table)
    mesh = _read(table, table.file("file", folder), scale)
    parts = [mesh] if take_hull else list(mesh.split(only_watertight=False, repair=False)) or [mesh]
    whats = ["it"] if len(parts) == 1 else [f"part {i} of {len(parts)}" for i in range(1, len(parts) + 1)]
    return [_solid(table, part, take_hull, what) for part, what in zip(parts, whats, strict=True)]


def _wants_hull(table: Table) -> bool:
    if table.text("convex") != "hull":
        raise table.wrong("convex", f"can only be 'hull', not '{table.read['convex']}'")
    return True


def _read(table: Table, path: Path, scale: float) -> trimesh.Trimesh:
    """The triangles of a file as Pinocchio reads it for a picture, in m, with equal corners made one."""
    import trimesh  # 0.5 s

    kind = path.suffix.lower()
    if kind not in SHOWN + CONVERTED:
        raise table.wrong("file", f"'{path}' can't be read: only {', '.join((*SHOWN, *CONVERTED))} can")
    try:
        files = [path] if kind in SHOWN else [drawing.path for drawing in converted(path)]
        meshes = [_triangles(file) for file in files]
    except Exception as error:  # every reader has errors of its own
        said = " ".join((str(error).partition("message: ")[2] or str(error) or type(error).__name__).split())
        raise table.wrong("file", f"'{path}' can't be read: {said[:200]}") from None
    triangles = scale * np.vstack(meshes)
    if not len(triangles) or not np.abs(triangles).max() <= FURTHEST:  # NaN too
        raise table.wrong("file", f"'{path}' can't be used: it is empty, or has numbers beyond {FURTHEST:g} m")
    corners = triangles.reshape(-1, 3)
    mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    mesh.merge_vertices(digits_vertex=9)
    mesh.update_faces(mesh.nondegenerate_faces())
    return mesh


def _triangles(path: Path) -> Any:
    """(n, 3, 3) the corners of each triangle of a file."""
    model = coal.MeshLoader().load(str(path))
    corners = np.array(model.vertices())
    faces = [model.tri_indices(i) for i in range(model.num_tris)]
    return corners[np.array([[face[0], face[1], face[2]] for face in faces], dtype=int).reshape(-1, 3)]


def _solid(table: Table, part: trimesh.Trimesh, take_hull: bool, what: str) -> Solid:
    """The hull of what hangs together.

    Raises:
        SceneError: that is something else than its hull, or has no volume.
    """
    name, remedy = table.read["file"], "write convex = 'hull' to take the hull for it, or cut it into convex parts"
    points = np.asarray(part.vertices, dtype=float)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / np.sqrt(len(points))
    if len(points) < 4 or spread[2] < max(LEAST, 1e-9 * spread[0]):
        raise table.wrong("file", f"'{name}': {what} is no solid: it is flat")
    whole = hull(points)
    if take_hull:
        return whole
    if not (part.is_watertight and part.is_winding_consistent):
        raise table.wrong("file", f"'{name}': {what} is no closed surface; {remedy}")
    full = abs(part.volume) / whole.shape.computeVolume()
    if full < _FULL:
        raise table.wrong("file", f"'{name}': {what} is not convex, it fills {full:.1%} of its hull; {remedy}")
    return whole
