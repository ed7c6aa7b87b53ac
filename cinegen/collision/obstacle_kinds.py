"""The kinds of obstacles: for each, a function that reads its keys and returns its pieces.

A new kind is a function here and a line in `KINDS`. The pieces are in the frame of the obstacle. Lengths are in m.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import coal
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.body import Piece, PlacedShape
from cinegen.collision.convex_hull import hull, is_flat, prism
from cinegen.collision.errors import SceneError
from cinegen.collision.links import link_bodies
from cinegen.collision.obstacle_meshes import MOST_VOXELS, WIDEST, mesh_pieces, voxel_pieces, voxels_of
from cinegen.collision.polygon import convex_pieces, polygon_error
from cinegen.collision.scene_table import FURTHEST, LEAST, SceneTable, read_each
from cinegen.errors import CinegenError, ClosureError, read_all
from cinegen.joints import kinematic_data
from cinegen.model import load
from raff2urdf.errors import RaffError, did_you_mean, raised_as
from raff2urdf.graphics.meshes import CONVERTED, SHOWN, converted
from raff2urdf.graphics.names import is_pointer
from raff2urdf.quantities import ANGLE, LENGTH

if TYPE_CHECKING:
    import trimesh


HEIGHT = 4.0
"""Height of obstacles that are given in the plane, m: half above it, half below. Distances between much taller shapes
lose digits."""

VOXEL = 0.02
"""Default size of the cubes around points, m."""

POINT_FILES = (".npy", ".ply", ".txt", ".xyz")
"""Suffixes of files of points."""


def pieces_of(kind: str, table: SceneTable, folder: Path) -> Sequence[PlacedShape | Piece]:
    """Return the pieces of the obstacle of a table.

    Args:
        kind: one of `KINDS`.
        table: with the keys of that kind.
        folder: folder of the files that the table names.

    Raises:
        SceneError: the kind is unknown, or a value is invalid.
    """
    if kind not in KINDS:
        raise table.error("kind", f"'{kind}' is unknown{did_you_mean(kind, tuple(KINDS))}")
    return KINDS[kind](table, folder)


def _sphere(table: SceneTable, folder: Path) -> list[PlacedShape]:
    """Sphere: `radius`."""
    return [_centred(coal.Sphere(table.size("radius")))]


def _box(table: SceneTable, folder: Path) -> list[PlacedShape]:
    """Box: `size` along x, y and z; with two numbers, an upright box in the plane."""
    x, y, z = (*table.sizes("size", 2, 3), HEIGHT)[:3]
    return [_centred(coal.Box(x, y, z))]


def _cylinder(table: SceneTable, folder: Path) -> list[PlacedShape]:
    """Cylinder: `radius`, and its axis (see `_axis`)."""
    radius, (placement, length) = read_each(lambda: table.size("radius"), lambda: _axis(table))
    return [PlacedShape(placement, coal.Cylinder(radius, length))]


def _capsule(table: SceneTable, folder: Path) -> list[PlacedShape]:
    """Capsule: `radius`, and its axis between the centres of its round ends (see `_axis`)."""
    radius, (placement, length) = read_each(lambda: table.size("radius"), lambda: _axis(table))
    return [PlacedShape(placement, coal.Capsule(radius, length))]


def _half_space(table: SceneTable, folder: Path) -> list[PlacedShape]:
    """Half-space behind a plane through the origin: `normal` points out of it, to where robots may go."""
    return [_centred(coal.Halfspace(table.direction("normal", 2, 3), 0.0))]


def _disc(table: SceneTable, folder: Path) -> list[PlacedShape]:
    """Disc in the plane: `radius`. In space it is an upright cylinder of `height`."""
    sizes = read_each(lambda: table.size("radius"), lambda: table.size("height", HEIGHT))
    return [_centred(coal.Cylinder(*sizes))]


def _polygon(table: SceneTable, folder: Path) -> list[PlacedShape]:
    """Simple polygon in the plane, convex or not: `points`. In space it is an upright prism of `height`."""
    outline, height = read_each(lambda: table.points("points", 2), lambda: table.size("height", HEIGHT))
    points = np.array(outline).reshape(-1, 2)
    if len(points) > 1 and (points[0] == points[-1]).all():  # the first point may be repeated at the end
        points = points[:-1]
    why = polygon_error(points)
    if why is not None:
        raise table.error("points", why)
    return [_centred(prism(corners, height).shape) for corners in convex_pieces(points)]


def _mesh(table: SceneTable, folder: Path) -> list[Piece]:
    """Mesh, convex or not: `file`, and `scale`, m in its unit of length; or `vertices` and `triangles`, three indices
    each. Closed parts are solid, open ones surfaces. `convex = "hull"` replaces it by its convex hull."""
    key = "vertices" if "vertices" in table else "file"
    values: dict[str, Any] = {"scale": 1.0}

    def take_hull() -> bool:
        if "convex" in table and table.text("convex") != "hull":
            raise table.error("convex", f"can only be 'hull', not '{table.read['convex']}'")
        return "convex" in table

    def triangles() -> trimesh.Trimesh:
        scale = values["scale"]
        return _mesh_of(table, scale) if key == "vertices" else _read_mesh(table, table.file("file", folder), scale)

    reads = {"scale": lambda: table.size("scale", 1.0), "convex": take_hull, "mesh": triangles}
    read_all(reads, SceneError, values)
    mesh: trimesh.Trimesh = values["mesh"]
    if not values["convex"]:
        return mesh_pieces(mesh)
    if is_flat(np.asarray(mesh.vertices, dtype=float)):
        raise table.error(key, "has no volume, it is flat: leave out convex = 'hull'")
    return [Piece(pin.SE3.Identity(), hull(np.asarray(mesh.vertices, dtype=float)).shape, None)]


def _points(table: SceneTable, folder: Path) -> list[Piece]:
    """Point cloud: `file`, and `scale`, m in its unit of length; or `points`. Each cube of a grid, of the size `voxel`
    (0.02 m), that contains a point is solid: distances are never overestimated, and underestimated by a diagonal of
    the cube at most."""
    key = "points" if "points" in table else "file"
    size, scale, cloud = read_each(
        lambda: table.size("voxel", VOXEL),
        lambda: table.size("scale", 1.0),
        lambda: table.array(key, 3) if key == "points" else _read_points(table, table.file(key, folder)),
    )
    points = scale * cloud
    bad = int((~np.isfinite(points)).any(axis=1).sum())
    if bad:
        raise table.error(key, f"has {bad} points that are not finite: remove them")
    if not len(points) or np.abs(points).max() > FURTHEST:
        raise table.error(key, f"is empty, or has coordinates beyond {FURTHEST:g} m")
    remedy = f"make voxel larger than {size:g} m"
    if np.abs(points).max() > WIDEST * size:
        raise table.error(key, f"has coordinates beyond {WIDEST} voxels; {remedy}")
    voxels = voxels_of(points, size)
    if len(voxels) > MOST_VOXELS:
        raise table.error(key, f"fills {len(voxels)} voxels, the largest number is {MOST_VOXELS}; {remedy}")
    return voxel_pieces(voxels, size)


def _robot(table: SceneTable, folder: Path) -> list[Piece]:
    """Another robot, at rest: `file`, and `joints`, the values of some of its joints, the others at home. With
    loops, the named joints keep their values, and the others follow."""
    table.know("joints")
    path = table.robot_file("file", folder)
    with raised_as(partial(table.error, "file"), (CinegenError, RaffError, OSError), "can't be loaded: "):
        mechanism = load(path)
        bodies = link_bodies(mechanism)
    q = np.array(mechanism.q_home)
    if "joints" in table:
        joints = table.table("joints")
        joints.know(*mechanism.joints)
        reads: dict[str, Callable[[], Any]] = {
            name: partial(joints.number, name, LENGTH if mechanism.is_prismatic(name) else ANGLE)
            for name in mechanism.joints
            if name in joints
        }
        values = read_all(reads | {"": joints.finish}, SceneError)
        del values[""]
        with raised_as(partial(table.error, "joints"), ClosureError, "do not allow closed loops: "):
            q = mechanism.close(mechanism.configuration(values), locked=values)
    data = kinematic_data(mechanism.model)
    pin.forwardKinematics(mechanism.model, data, q)
    return [Piece(data.oMi[body.joint] * body.placement, body.shape, body.exact) for body in bodies]


KINDS: Mapping[str, Callable[[SceneTable, Path], Sequence[PlacedShape | Piece]]] = {
    "sphere": _sphere,
    "box": _box,
    "cylinder": _cylinder,
    "capsule": _capsule,
    "half_plane": _half_space,
    "half_space": _half_space,
    "disc": _disc,
    "polygon": _polygon,
    "mesh": _mesh,
    "points": _points,
    "robot": _robot,
}


def _centred(shape: coal.ShapeBase) -> PlacedShape:
    return PlacedShape(pin.SE3.Identity(), shape)


def _axis(table: SceneTable) -> tuple[pin.SE3, float]:
    """Return the frame in the middle of an axis, whose z is along it, and the axis's length, m.

    The keys are `length`, along z of the obstacle's frame, or `ends`, two points (z is 0 for two numbers).
    """
    if "ends" not in table:
        return pin.SE3.Identity(), table.size("length")
    if "length" in table:
        raise table.error("length", "cannot be combined with ends: remove one of them")
    ends = table.points("ends", 2, 3)
    if len(ends) != 2:
        raise table.error("ends", f"must be 2 points, not {len(ends)}")
    first, second = (np.pad(point, (0, 3 - len(point))) for point in ends)
    length = float(np.linalg.norm(second - first))
    if length < LEAST:
        raise table.error("ends", "coincide: for a sphere, write kind = 'sphere'")
    rotation = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (second - first) / length).toRotationMatrix()
    return pin.SE3(rotation, (first + second) / 2.0), length


# --- meshes ------------------------------------------------------------------------------------------------------


def _read_mesh(table: SceneTable, path: Path, scale: float) -> trimesh.Trimesh:
    """Return the triangles of a file as Pinocchio reads it for display, in m, with equal corners merged."""
    import trimesh  # takes 0.5 s

    suffix = path.suffix.lower()
    if suffix not in SHOWN + CONVERTED:
        raise table.error("file", f"'{path}' has an unknown format: use {', '.join((*SHOWN, *CONVERTED))}")
    if is_pointer(path):
        raise table.error("file", f"'{path}' is a Git LFS pointer: run `git lfs pull`")
    try:
        files = [path] if suffix in SHOWN else [drawing.path for drawing in converted(path)]
        meshes = [_triangles(file) for file in files]
    except Exception as error:  # every reader has errors of its own
        text = " ".join((str(error).partition("message: ")[2] or str(error) or type(error).__name__).split())
        raise table.error("file", f"'{path}' can't be read: {text[:200]}") from None
    triangles = scale * np.vstack(meshes)
    if not len(triangles) or not np.abs(triangles).max() <= FURTHEST:  # NaN too
        raise table.error("file", f"'{path}' can't be used: it is empty, or has coordinates beyond {FURTHEST:g} m")
    corners = triangles.reshape(-1, 3)
    return _merged(table, "file", trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False))


def _triangles(path: Path) -> Any:
    """Return the corners (n, 3, 3) of all triangles of a file."""
    model = coal.MeshLoader().load(str(path))
    corners = np.array(model.vertices())
    faces = [model.tri_indices(i) for i in range(model.num_tris)]
    return corners[np.array([[face[0], face[1], face[2]] for face in faces], dtype=int).reshape(-1, 3)]


def _mesh_of(table: SceneTable, scale: float) -> trimesh.Trimesh:
    """Return the triangles of `vertices` and `triangles`, m."""
    import trimesh

    vertices, triangles = read_each(lambda: table.array("vertices", 3), lambda: table.array("triangles", 3))
    vertices, indices = scale * vertices, triangles.astype(np.int64)
    if not len(indices) or (indices != triangles).any() or indices.min() < 0 or indices.max() >= len(vertices):
        raise table.error(
            "triangles", f"must be indices of vertices, from 0 to {len(vertices) - 1}, at least one triple"
        )
    return _merged(table, "vertices", trimesh.Trimesh(vertices, indices, process=False))


def _merged(table: SceneTable, key: str, mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a mesh with equal corners merged, without triangles that have no area."""
    mesh.merge_vertices(digits_vertex=9)
    mesh.update_faces(mesh.nondegenerate_faces())
    if not len(mesh.faces):
        raise table.error(key, "has no triangle with an area")
    mesh.remove_unreferenced_vertices()
    return mesh


def _read_points(table: SceneTable, path: Path) -> Array:
    """Return the points (n, 3) of a file, in its unit."""
    import trimesh

    suffix = path.suffix.lower()
    if suffix not in POINT_FILES:
        remedy = "; pcl_pcd2ply, a tool of the Point Cloud Library, converts it to .ply" if suffix == ".pcd" else ""
        raise table.error("file", f"'{path}' has an unknown format: use {', '.join(POINT_FILES)}{remedy}")
    try:
        if suffix == ".npy":
            points = np.load(path, allow_pickle=False)
        elif suffix == ".txt":
            points = np.loadtxt(path, ndmin=2)
        else:
            cloud: Any = trimesh.load(path, process=False)
            if len(getattr(cloud, "faces", ())):
                raise ValueError("it has triangles: write kind = 'mesh'")
            points = cloud.vertices
        points = np.asarray(points, dtype=float)
        if points.ndim != 2 or points.shape[1] < 3:
            raise ValueError(f"three numbers a point are needed, its shape is {points.shape}")
    except Exception as error:  # every reader has errors of its own
        text = " ".join((str(error) or type(error).__name__).split())
        raise table.error("file", f"'{path}' can't be read: {text[:200]}") from None
    return points[:, :3]
