"""Table 2 of Merlet's paper as conditions that can be run: where a TSSM is singular, row by row.

J-P. Merlet, "Symbolic computation for the determination of the minimal direct kinematics polynomial and the singular
configurations of parallel manipulators", section 3. The table prints what each condition determines, the functions A,
B, C, D and F it does not: they are derived here.

Leg i goes from the base's point A_i, in the plane z = 0, to the platform's point B1 (legs 1, 2), B3 (3, 4) or B5 (5,
6). The two legs of a pair span a plane: pi1, pi3, pi5, with the normals n1, n3, n5. It cuts the base in the pair's base
line; those of pi1 and pi3 meet in I13.

*All singularities.* While the legs are held, each B moves across its plane only: with the velocity r n. Such velocities
belong to a rigid motion where no side e of the platform's triangle changes its length:

    r1 n1.e13 = r3 n3.e13     r3 n3.e35 = r5 n5.e35     r5 n5.e51 = r1 n1.e51

and there is one that is not zero where

    F = (n1.e13) (n3.e35) (n5.e51) - (n3.e13) (n5.e35) (n1.e51) = 0

By Ceva's theorem: pi1, pi3, pi5 cut the platform's plane in three lines through one point (or parallel). Each factor is
linear in the position (x0, y0, z0) of the platform, as n1.e13 = (B1 - A1).(e13 x (A2 - A1)) up to its sign. Rows of the
table are where this happens for a reason of its own: with fewer than six legs, or with one line that all meet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.singularities.line_varieties import GrassmannClass
from cinegen.singularities.pluecker import PlueckerLine

COORDINATES = ("x0", "y0", "z0", "psi", "theta", "phi")
"""Of a pose (6,): the platform's position and Euler's angles (rad), R = Rz(psi) Rx(theta) Rz(phi)."""

_REAL = 1e-9  # imaginary part of a root, relative, below which it is real
_ROUNDING = 1e-13  # of what they are a difference of: coefficients that are 0


class GeometryError(CinegenError):
    """Points that do not make a TSSM."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """A TSSM, a triangle on six legs, two to a corner, over a flat base: the ends of its legs.

    Attributes:
        base: (6, 3) A1 ... A6, z = 0.
        platform: (3, 3) B1, B3, B5 in the platform's own frame, z = 0.
    """

    base: Array
    platform: Array

    def __post_init__(self) -> None:
        base, platform = np.asarray(self.base, dtype=float), np.asarray(self.platform, dtype=float)
        for name, points, shape in (("base", base, (6, 3)), ("platform", platform, (3, 3))):
            if points.shape != shape or not np.isfinite(points).all() or points[:, 2].any():
                raise GeometryError(f"the {name} of a TSSM is {shape[0]} points (x, y, 0); given was {points.tolist()}")
        object.__setattr__(self, "base", base)
        object.__setattr__(self, "platform", platform)

    @property
    def length(self) -> float:
        """The characteristic length: how far the platform's points are from their centroid, on average."""
        return float(np.linalg.norm(self.platform - self.platform.mean(axis=0), axis=1).mean())

    def corners(self, pose: Array) -> Array:
        """(3, 3) B1, B3, B5 in the base's frame at a pose (6,)."""
        return np.asarray(pose[:3] + self.platform @ _rotation(pose).T)

    def lines(self, pose: ArrayLike) -> tuple[PlueckerLine, ...]:
        """The six legs' lines, from the base to the platform, at a pose (6,)."""
        corners = np.repeat(self.corners(np.asarray(pose, dtype=float)), 2, axis=0)
        return tuple(PlueckerLine.through(a, b) for a, b in zip(self.base, corners, strict=True))

    def relabelled(self, order: Sequence[int]) -> Geometry:
        """The same robot with other names: its leg i is this one's leg order[i], counted from 0. So a row that speaks
        of legs 1, 2, 3 and 5 is asked of others. Poses stay what they are.

        Raises:
            GeometryError: legs that share a corner would be parted.
        """
        pairs = [index // 2 for index in order[::2]]
        if sorted(order) != list(range(6)) or pairs != [index // 2 for index in order[1::2]]:
            raise GeometryError(
                f"{list(order)} parts legs that share a corner of the platform; keep 0 1, 2 3, 4 5 side by side"
            )
        return Geometry(self.base[list(order)], self.platform[pairs])


@dataclass(frozen=True, eq=False)
class Row:
    """A row of Table 2.

    Attributes:
        name: as printed, or ours where it is missing.
        printed: the condition as printed; empty where it is missing.
        grassmann_class: of the variety that the lines span.
        legs: the smallest dependent set, as in the paper: from 1.
        determined: coordinates of a pose that the condition determines; the others are free.
        solve: the poses (k, 6) that satisfy it and keep the free coordinates of a pose (6,); not finite where there are
            none. Its docstring derives the condition.
        residual: how far a pose (6,) is from satisfying it, dimensionless; 0 where it does.
    """

    name: str
    printed: str
    grassmann_class: GrassmannClass
    legs: tuple[int, ...]
    determined: tuple[str, ...]
    solve: Callable[[Geometry, Array], Array]
    residual: Callable[[Geometry, Array], float]

    def complete(self, tssm: Geometry, pose: ArrayLike) -> Array:
        """(k, 6) the poses that satisfy the condition and keep the free coordinates of a pose (6,); k = 0 where there
        is none, as the platform is parallel to the base or the coordinates belong to no real pose.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            poses = self.solve(tssm, np.asarray(pose, dtype=float))
        return np.asarray(poses[np.isfinite(poses).all(axis=1)])


def concurrency(tssm: Geometry, pose: Array) -> float:
    """F over the sizes of its normals and sides: 0 at every singularity of a TSSM and nowhere else, between -2 and 2.

    F itself is the determinant of the legs' unit Pluecker vectors, times the legs' lengths, times -1.
    """
    corners = tssm.corners(pose)
    normals, sides = _normals(tssm, corners), _sides(corners)
    size = np.linalg.norm(normals, axis=1).prod() * np.linalg.norm(sides, axis=1).prod()
    return _ceva(tssm, corners) / float(size)


# --- plane: a variety of rank 3 --------------------------------------------------------------------------------------


def _complete_plane(tssm: Geometry, pose: Array) -> Array:
    """Legs 3 and 5 go through B1, where legs 1 and 2 end: four lines through one point.

    B1 then lies on A3B3 and on A5B5, so A3 and A5 lie in the platform's plane, which cuts the base along A3A5. The node
    line of Euler's angles is along (cos psi, sin psi): tan psi = (ya3 - ya5) / (xa3 - xa5), with the symmetry of the
    paper's robot, A5 = (-xa4, ya4), as printed. Then B1 is where A3 + s R (b1 - b3) and A5 + t R (b1 - b5) meet.
    """
    poses = []
    for psi in _both(tssm.base[2] - tssm.base[4]):
        turned = _with(pose, psi=psi)
        rotation = _rotation(turned)
        b1, b3, b5 = tssm.platform
        directions = np.column_stack([rotation @ (b1 - b3), -rotation @ (b1 - b5)])
        s = np.linalg.lstsq(directions, tssm.base[4] - tssm.base[2], rcond=None)[0][0]
        poses.append(_placed(turned, tssm.base[2] + s * directions[:, 0] - rotation @ b1))
    return np.array(poses)


def _residual_plane(tssm: Geometry, pose: Array) -> float:
    corners = tssm.corners(pose)
    return _largest(
        _heading(tssm.base[2] - tssm.base[4], pose),
        _from_line(corners[0], tssm.base[2], corners[1]) / tssm.length,
        _from_line(corners[0], tssm.base[4], corners[2]) / tssm.length,
    )


# --- congruences: varieties of rank 4 --------------------------------------------------------------------------------


def _complete_degenerate(tssm: Geometry, pose: Array) -> Array:
    """Leg 5 goes through B1, where legs 1 and 2 end, and B1 lies in the plane of legs 3 and 4: three lines through a
    point of the plane of the two others.

    B1 = A5 + s R (b1 - b5), and (B1 - A3).(e13 x (A4 - A3)) = 0 is linear in s.
    """
    rotation = _rotation(pose)
    b1, b3, b5 = tssm.platform
    way = rotation @ (b1 - b5)
    across = np.cross(rotation @ (b3 - b1), tssm.base[3] - tssm.base[2])
    s = across @ (tssm.base[2] - tssm.base[4]) / (across @ way)
    return np.array([_placed(pose, tssm.base[4] + s * way - rotation @ b1)])


def _residual_degenerate(tssm: Geometry, pose: Array) -> float:
    corners = tssm.corners(pose)
    return _largest(
        _from_line(corners[0], tssm.base[4], corners[2]) / tssm.length, _from_pair(tssm, corners, corners[0], 1)
    )


def _complete_two_pencils(tssm: Geometry, pose: Array) -> Array:
    """B3 lies in the plane of legs 1 and 2, B1 in that of legs 3 and 4: the line B1B3 goes through I13.

    Both are linear in the position: (B1 - A1).(e13 x (A2 - A1)) = 0 and (B1 - A3).(e13 x (A4 - A3)) = 0, two equations
    for x0 and y0. Legs 1, 2, 3, 4 make two flat pencils that share the line B1B3; with any fifth leg they belong to a
    hyperbolic congruence, with one director through B1 in the plane of legs 3 and 4, one through B3 in that of 1 and 2.
    """
    return _in_planes(tssm, pose, 0, ((1, 0), (1, 1)))


def _residual_two_pencils(tssm: Geometry, pose: Array) -> float:
    corners = tssm.corners(pose)
    return _largest(_from_pair(tssm, corners, corners[1], 0), _from_pair(tssm, corners, corners[0], 1))


def _complete_hyperbolic(tssm: Geometry, pose: Array) -> Array:
    """Leg 5 meets the two lines that legs 1, 2, 3, 4 meet: B1B3, and the line common to pi1 and pi3.

    Leg 5 meets B1B3 where it lies in the platform's plane: A5 in it is linear in the position, and gives y0 for each x0
    and z0. It meets the other where that line crosses the platform's plane: so the lines of pi1, pi3 and pi5 in the
    platform's plane, that of pi5 being leg 5, go through one point. That is F = 0 again, and linear in what is left:
    see `_slid`.
    """
    return np.array([_slid(tssm, pose)])


def _residual_hyperbolic(tssm: Geometry, pose: Array) -> float:
    return _largest(_from_platform(tssm, pose, 4), concurrency(tssm, pose))


# --- complexes: varieties of rank 5 ----------------------------------------------------------------------------------


def _complete_fichter(tssm: Geometry, pose: Array) -> Array:
    """The platform is parallel to the base, and turned by a quarter: Fichter's singularity.

    With theta = 0 the sides e are horizontal, n1.e13 = z0 (u1y e13x - u1x e13y) with u1 = A2 - A1, and F is z0^3 times
    a function of chi = psi + phi. As the sides of a triangle add up to 0 that function is a cos chi + b sin chi, with a
    and b its values for chi = 0 and pi / 2: two solutions, which differ by pi. For a robot with a mirror, a = 0.
    """
    chi = np.arctan2(-_level(tssm, 0.0), _level(tssm, 0.5 * np.pi))
    return np.array([_with(pose, theta=0.0, phi=chi + half - pose[3]) for half in (0.0, np.pi)])


def _residual_fichter(tssm: Geometry, pose: Array) -> float:
    size = np.hypot(_level(tssm, 0.0), _level(tssm, 0.5 * np.pi))
    return _largest(2.0 * np.sin(0.5 * pose[4]), _level(tssm, pose[3] + pose[5]) / size)


def _complete_general(tssm: Geometry, pose: Array) -> Array:
    """F = 0 is a cubic in z0.

    Its leading coefficient sees the sides' horizontal parts M e, with M the first two rows and columns of R. As it
    vanishes with det M = cos theta it is cos theta times something linear in M: for a robot with a mirror,
    cos theta (p M11 + q M22), with p and q of the geometry. It vanishes at theta = +- pi / 2, and where
    tan psi tan phi = (p + q cos theta) / (q + p cos theta), with p = q where psi + phi = +- pi / 2; there are fewer z0
    then. (This reads like what is left of the printed side condition, which taken by its word is neither necessary nor
    sufficient.)
    """
    roots = _by_height(tssm, pose).roots()
    heights = roots.real[np.abs(roots.imag) <= _REAL * (1.0 + np.abs(roots))] * tssm.length
    return np.array([_with(pose, z0=height) for height in heights]).reshape(-1, 6)


def _residual_general(tssm: Geometry, pose: Array) -> float:
    return abs(concurrency(tssm, pose))


def _complete_special(tssm: Geometry, pose: Array) -> Array:
    """B5 lies in the planes of legs 1 and 2, and of 3 and 4: all six legs meet the line I13 B5.

    (B5 - A1).(e15 x (A2 - A1)) = 0 and (B5 - A3).(e35 x (A4 - A3)) = 0: two linear equations for x0 and y0.
    """
    return _in_planes(tssm, pose, 2, ((0, 0), (1, 1)))


def _residual_special(tssm: Geometry, pose: Array) -> float:
    corners = tssm.corners(pose)
    return _largest(_from_pair(tssm, corners, corners[2], 0), _from_pair(tssm, corners, corners[2], 1))


def _complete_hunt(tssm: Geometry, pose: Array) -> Array:
    """Legs 5 and 6 lie in the platform's plane: all six legs meet the side B1B3.

    The platform's plane cuts the base along A5A6, which gives psi, and A5 in it gives z0.
    """
    poses = []
    for psi in _both(tssm.base[5] - tssm.base[4]):
        turned = _with(pose, psi=psi)
        normal = _rotation(turned)[:, 2]
        z0 = normal[:2] @ (tssm.base[4] - pose[:3])[:2] / normal[2]
        poses.append(_with(turned, z0=z0))
    return np.array(poses)


def _residual_hunt(tssm: Geometry, pose: Array) -> float:
    return _largest(_from_platform(tssm, pose, 4), _from_platform(tssm, pose, 5))


# --- two flat pencils again ------------------------------------------------------------------------------------------


def _complete_crossed(tssm: Geometry, pose: Array) -> Array:
    """Legs 3 and 5 lie in the platform's plane and cross in a point of the plane of legs 1 and 2: two flat pencils, of
    legs 1 and 2 and of legs 3 and 5, that share the line from B1 to that point.

    The platform's plane cuts the base along A3A5: psi as in the row "plane". With A5 it then holds A3, legs 3 and 5 are
    the lines of pi3 and pi5 in it, and F = 0 means that they cross on that of pi1.
    """
    return np.array([_slid(tssm, _with(pose, psi=psi)) for psi in _both(tssm.base[2] - tssm.base[4])])


def _residual_crossed(tssm: Geometry, pose: Array) -> float:
    return _largest(_from_platform(tssm, pose, 2), _from_platform(tssm, pose, 4), concurrency(tssm, pose))


# --- what they share -------------------------------------------------------------------------------------------------


def _rotation(pose: Array) -> Array:
    """(3, 3) Rz(psi) Rx(theta) Rz(phi)."""
    return np.asarray(Rotation.from_euler("ZXZ", pose[3:]).as_matrix())


def _with(pose: Array, **values: float) -> Array:
    """A pose with other values of some coordinates."""
    changed = pose.copy()
    for name, value in values.items():
        changed[COORDINATES.index(name)] = value
    return changed


def _placed(pose: Array, position: Array) -> Array:
    return np.concatenate([position, pose[3:]])


def _both(way: Array) -> tuple[float, float]:
    """The two psi for which the node line is along a horizontal direction."""
    psi = float(np.arctan2(way[1], way[0]))
    return psi, psi + np.pi


def _sides(corners: Array) -> Array:
    """(3, 3) e13, e35, e51."""
    return np.asarray(np.roll(corners, -1, axis=0) - corners)


def _normals(tssm: Geometry, corners: Array) -> Array:
    """(3, 3) n1, n3, n5: of the planes of the pairs of legs."""
    return np.cross(tssm.base[::2] - corners, tssm.base[1::2] - corners)


def _in_planes(tssm: Geometry, pose: Array, corner: int, conditions: tuple[tuple[int, int], tuple[int, int]]) -> Array:
    """(1, 6) the pose of given z0 where a corner lies, for each (other, pair) of two, in the plane through that pair's
    base line along the side to the other corner."""
    rotation = _rotation(pose)
    offset = rotation @ tssm.platform[corner]
    rows, right = [], []
    for other, pair in conditions:
        first, second = tssm.base[2 * pair], tssm.base[2 * pair + 1]
        normal = np.cross(rotation @ (tssm.platform[other] - tssm.platform[corner]), second - first)
        rows.append(normal[:2])
        right.append(normal @ (first - offset) - normal[2] * pose[2])
    (a, b), (c, d) = rows
    determinant = a * d - b * c
    x0, y0 = (right[0] * d - b * right[1]) / determinant, (a * right[1] - c * right[0]) / determinant
    return np.array([_with(pose, x0=x0, y0=y0)])


def _slid(tssm: Geometry, pose: Array) -> Array:
    """(6,) the pose of given z0 and angles with A5 in the platform's plane and F = 0.

    The platform is slid in its plane along that plane's line in the base. On this line the planes of the leg pairs have
    fixed points: with x along it, (t, 0) and the corner (b + s, h) are joined by h x - (b + s - t) y = h t. Three such
    lines go through one point where the determinant of their coefficients vanishes: linear in the shift s.
    """
    normal = _rotation(pose)[:, 2]
    slope = normal[:2]  # normal.(A5 - position) = 0 is a line in the plane of x0 and y0
    start = np.array([0.0, 0.0, pose[2]])
    start[:2] = slope * (normal @ (tssm.base[4] - start)) / (slope @ slope)
    way = np.array([-slope[1], slope[0], 0.0]) * tssm.length / np.linalg.norm(slope)
    f0, f1 = (_ceva(tssm, tssm.corners(_placed(pose, start + shift * way))) for shift in (0.0, 1.0))
    return _placed(pose, start + f0 / (f0 - f1) * way)


def _ceva(tssm: Geometry, corners: Array) -> float:
    """F."""
    before, after = _factors(_normals(tssm, corners), _sides(corners))
    return float(before.prod() - after.prod())


def _factors(normals: Array, sides: Array) -> tuple[Array, Array]:
    """(n1.e13, n3.e35, n5.e51) and (n3.e13, n5.e35, n1.e51)."""
    return np.einsum("ij,ij->i", normals, sides), np.einsum("ij,ij->i", np.roll(normals, -1, axis=0), sides)


def _by_height(tssm: Geometry, pose: Array) -> Polynomial:
    """F as a cubic in z0 / length: each factor is linear in it."""
    at = [tssm.corners(_with(pose, z0=height * tssm.length)) for height in (0.0, 1.0)]
    zero, unit = (np.array(_factors(_normals(tssm, corners), _sides(corners))) for corners in at)
    before, after = (
        Polynomial([a[0], b[0]]) * Polynomial([a[1], b[1]]) * Polynomial([a[2], b[2]])
        for a, b in zip(zero, unit - zero, strict=True)
    )
    size = max(np.abs(before.coef).max(), np.abs(after.coef).max())
    return Polynomial((before - after).coef).trim(_ROUNDING * size)


def _level(tssm: Geometry, chi: float) -> float:
    """F / z0^3 where the platform is parallel to the base and turned by chi."""
    c, s = np.cos(chi), np.sin(chi)
    sides = _sides(tssm.platform)[:, :2] @ np.array([[c, s], [-s, c]])
    bases = (tssm.base[1::2] - tssm.base[::2])[:, :2]

    def product(shift: int) -> float:
        u = np.roll(bases, -shift, axis=0)
        return float(np.prod(u[:, 1] * sides[:, 0] - u[:, 0] * sides[:, 1]))

    return product(0) - product(1)


def _heading(way: Array, pose: Array) -> float:
    """The sine between the node line and a horizontal direction."""
    x, y = way[:2] / np.linalg.norm(way[:2])
    return float(x * np.sin(pose[3]) - y * np.cos(pose[3]))


def _from_line(point: Array, a: Array, b: Array) -> float:
    return float(np.linalg.norm(PlueckerLine.through(a, b).nearest(point) - point))


def _from_pair(tssm: Geometry, corners: Array, point: Array, pair: int) -> float:
    """Return the distance of a point from the plane of a pair of legs, in characteristic lengths."""
    normal = _normals(tssm, corners)[pair]
    return float(normal @ (point - corners[pair]) / np.linalg.norm(normal)) / tssm.length


def _from_platform(tssm: Geometry, pose: Array, leg: int) -> float:
    """Return the distance of a leg's base point from the platform's plane, in characteristic lengths."""
    return float(_rotation(pose)[:, 2] @ (tssm.base[leg] - pose[:3])) / tssm.length


def _largest(*conditions: float) -> float:
    return float(np.abs(conditions).max())


ALL_LEGS = (1, 2, 3, 4, 5, 6)

ROWS = (
    Row(
        "plane",
        "tan psi = (ya3 - ya4) / (xa3 + xa4), x0 = A(psi, theta, phi), y0 = B(...), z0 = C(...)",
        GrassmannClass.BUNDLE,
        (1, 2, 3, 5),
        ("x0", "y0", "z0", "psi"),
        _complete_plane,
        _residual_plane,
    ),
    Row(
        "degenerate congruence",
        "x0 = A(psi, theta, phi), y0 = B(psi, theta, phi), z0 = C(psi, theta, phi)",
        GrassmannClass.DEGENERATE_CONGRUENCE,
        (1, 2, 3, 4, 5),
        ("x0", "y0", "z0"),
        _complete_degenerate,
        _residual_degenerate,
    ),
    Row(
        "hyperbolic congruence (first case)",
        "x0 = A(z0, psi, theta, phi), y0 = B(z0, psi, theta, phi)",
        GrassmannClass.TWO_PENCILS,
        (1, 2, 3, 4),
        ("x0", "y0"),
        _complete_two_pencils,
        _residual_two_pencils,
    ),
    Row(
        "hyperbolic congruence (second case)",
        "y0 = A(x0, z0, psi, theta, phi), F(x0, z0, psi, theta, phi) = 0",
        GrassmannClass.HYPERBOLIC_CONGRUENCE,
        (1, 2, 3, 4, 5),
        ("x0", "y0"),
        _complete_hyperbolic,
        _residual_hyperbolic,
    ),
    Row(
        "general complex (first case)",
        "theta = phi = 0, psi = +- pi / 2",
        GrassmannClass.GENERAL_COMPLEX,
        ALL_LEGS,
        ("theta", "phi"),
        _complete_fichter,
        _residual_fichter,
    ),
    Row(
        "general complex (second case)",
        "theta = +- pi / 2 or psi = phi, A(x0, y0, psi, theta, phi) z0^3 + B(...) z0^2 + C(...) z0 + D(...) = 0",
        GrassmannClass.GENERAL_COMPLEX,
        ALL_LEGS,
        ("z0",),
        _complete_general,
        _residual_general,
    ),
    Row(
        "special complex",
        "x0 = A(z0, psi, theta, phi), y0 = B(z0, psi, theta, phi)",
        GrassmannClass.SPECIAL_COMPLEX,
        ALL_LEGS,
        ("x0", "y0"),
        _complete_special,
        _residual_special,
    ),
    Row(
        "special complex (Hunt)",
        "",
        GrassmannClass.SPECIAL_COMPLEX,
        ALL_LEGS,
        ("z0", "psi"),
        _complete_hunt,
        _residual_hunt,
    ),
    Row(
        "two flat pencils",
        "",
        GrassmannClass.TWO_PENCILS,
        (1, 2, 3, 5),
        ("x0", "y0", "psi"),
        _complete_crossed,
        _residual_crossed,
    ),
)
"""Table 2 in its order, then two rows that it lacks. Each for one naming of the legs: see `Geometry.relabelled`."""
