"""Solids that no primitive of a URDF is, as closed surfaces: tubes, cups, plates, gear wheels, belts, racks, screws.

A solid is named by its recipe, `KIND/NUMBER,NUMBER,...`: the arguments of a function here. So a text can name a solid
without a file next to it, as `solid://KIND/...`, and the same recipe makes the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise

import numpy as np

from raff2urdf.arrays import Array, ArrayLike
from raff2urdf.errors import RaffError

SCHEME = "solid"
_MOST = 600  # numbers of a recipe
_LARGEST = 1e6
_ARC = 24  # corners of a circle around a plate's points
_FEWEST_TEETH, MOST_TEETH = 3, 400
_MOST_LEVELS = 4000  # of a screw


def recipe(kind: str, *numbers: float) -> str:
    """Return the recipe of a solid, in six digits."""
    return f"{kind}/{','.join(f'{number + 0.0:.6g}' for number in numbers)}"


def triangles(text: str) -> Array:
    """Return the surface (n, 3, 3) of a recipe; corners run counter-clockwise as seen from outside.

    Raises:
        RaffError: there is no such solid.
    """
    kind, _, listed = text.partition("/")
    try:
        numbers = [float(number) for number in listed.split(",")]
        if kind not in _MAKERS or len(numbers) > _MOST or not all(abs(number) <= _LARGEST for number in numbers):
            raise ValueError
        return _MAKERS[kind](*numbers)
    except (ArithmeticError, IndexError, TypeError, ValueError):
        shown = text if len(text) < 100 else text[:100] + "..."
        raise RaffError(f"'{SCHEME}://{shown}' is no solid: one of {', '.join(_MAKERS)} with its numbers") from None


@lru_cache(64)
def stl_of(text: str) -> bytes:
    """Return a solid as binary STL. (Many links have the same.)

    Raises:
        RaffError: there is no such solid.
    """
    from raff2urdf.graphics.surface import solid, stl

    return stl(solid(np.round(triangles(text), 7)))


def tooth_numbers(ratio: float) -> tuple[int, int]:
    """Return the teeth of two wheels, the first of which turns by `ratio` revolutions for each of the second: the
    smallest numbers that have it, with 18 teeth at least, or else the nearest up to 400."""
    part = Fraction(min(abs(ratio), 1.0 / abs(ratio))).limit_denominator(120)
    small, large = max(part.numerator, 1), part.denominator if part else MOST_TEETH
    factor = max(1, min(math.ceil(18 / small), MOST_TEETH // large))
    small, large = possible_teeth(small * factor), possible_teeth(large * factor)
    return (small, large) if abs(ratio) > 1.0 else (large, small)


def possible_teeth(count: float) -> int:
    """Return the nearest number of teeth that a wheel can have."""
    return min(max(round(count), _FEWEST_TEETH), MOST_TEETH)


def _lathe(sides: float, *profile: float) -> Array:
    """A polyline of radii and heights (r, z, r, z, ...), turned about z: upwards outside."""
    turn = np.linspace(0.0, 2.0 * np.pi, _count(sides, 3), endpoint=False)
    points = np.array(profile).reshape(-1, 2)
    return _loft([_circle(turn, r, z) for r, z in points])


def _plate(half: float, radius: float, *points: float) -> Array:
    """The hull of discs about points (x, y, ...), `half` above and below z = 0, with a chamfer."""
    centres = np.array(points).reshape(-1, 2)
    outline, directions = _outline(centres, np.full(len(centres), radius))
    chamfer = 0.35 * min(half, radius)
    middle = np.tile(outline.mean(axis=0), (len(outline), 1))
    inner = outline - chamfer * directions
    levels = ((middle, -half), (inner, -half), (outline, chamfer - half), (outline, half - chamfer), (inner, half))
    return _loft([_at_height(ring, z) for ring, z in (*levels, (middle, half))])


def _wheel(teeth: float, half: float) -> Array:
    """A gear wheel of pitch radius 1 with a tooth on the x axis."""
    tips, turn = _toothed(teeth, 1.0)
    below, above = ([_circle(turn, 0.0, z), _circle(turn, tips, z)] for z in (-half, half))
    return _loft([*below, *above[::-1]])


def _ring(teeth: float, half: float, outer: float) -> Array:
    """A ring with teeth inside, of pitch radius 1, one of them on the x axis."""
    tips, turn = _toothed(teeth, -1.0)
    below, above = ([_circle(turn, tips, z), _circle(turn, outer, z)] for z in (-half, half))
    return _loft([*below, *above[::-1], below[0]])


def _bevel(teeth: float, slope: float, width: float) -> Array:
    """A bevel wheel whose pitch cone has the height `slope`, with its apex on z: pitch radius 1 at z = 0."""
    tips, turn = _toothed(teeth, 1.0)
    back = [_circle(turn, 0.0, -0.3), _circle(turn, 0.6, -0.3), _circle(turn, tips, 0.0)]
    return _loft([*back, _circle(turn, (1.0 - width) * tips, width * slope), _circle(turn, 0.0, width * slope)])


def _belt(distance: float, first: float, second: float, thick: float, half: float, crossed: float = 0.0) -> Array:
    """A belt around two wheels at x = 0 and x = `distance`, of these radii; crossed: two straight strands."""
    if crossed:  # its strands touch the wheels at the angle `turn` from the line of centres
        turn = math.acos(min(1.0, (first + second) / distance))
        strands = []
        for side in (1.0, -1.0):
            way = np.array([math.cos(turn), side * math.sin(turn)])
            strands.append(_plate(half, 0.5 * thick, *(first * way), *([distance, 0.0] - second * way)))
        return np.concatenate(strands)
    outline, directions = _outline(np.array([[0.0, 0.0], [distance, 0.0]]), np.array([first, second]))
    outer = outline + thick * directions
    rings = [_at_height(ring, z) for ring, z in ((outline, -half), (outer, -half), (outer, half), (outline, half))]
    return _loft([*rings, rings[0]])


def _rack(teeth: float, pitch: float, half: float, deep: float) -> Array:
    """A rack along x with its pitch line on y = 0, teeth upwards, `deep` below that line; an even number of teeth has a
    gap in the middle."""
    x = pitch * (np.arange(_count(teeth, 2)) - 0.5 * (_count(teeth, 2) - 1))
    tooth = ((-0.36, -0.28), (-0.14, 0.28), (0.14, 0.28), (0.36, -0.28))  # pitches, along and up
    profile = [(at + along * pitch, up * pitch) for at in x for along, up in tooth]
    rings = [np.array([[at, -deep, -half], [at, up, -half], [at, up, half], [at, -deep, half]]) for at, up in profile]
    ends = [np.tile(ring.mean(axis=0), (4, 1)) for ring in (rings[0], rings[-1])]
    return _loft([ends[0], *rings, ends[1]])


def _screw(turns: float, depth: float) -> Array:
    """A screw of radius 1 along z from 0 to 1, right-handed where `turns` is positive."""
    levels = _count(4 * max(1, math.ceil(abs(turns))) + 1, 1, _MOST_LEVELS)
    turn, heights = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False), np.linspace(0.0, 1.0, levels)
    waves = [np.abs(2.0 * ((turns * z - turn / (2.0 * np.pi)) % 1.0) - 1.0) for z in heights]
    rings = [_circle(turn, 1.0 - depth * wave, z) for wave, z in zip(waves, heights, strict=True)]
    return _loft([_circle(turn, 0.0, 0.0), *rings, _circle(turn, 0.0, 1.0)])


_MAKERS: dict[str, Callable[..., Array]] = {
    "lathe": _lathe,
    "plate": _plate,
    "wheel": _wheel,
    "ring": _ring,
    "bevel": _bevel,
    "belt": _belt,
    "rack": _rack,
    "screw": _screw,
}


def _loft(rings: Sequence[Array]) -> Array:
    """Return the surface between successive rings (n, 3) of as many corners, counter-clockwise about their order."""
    faces = []
    for low, high in pairwise(rings):
        low_next, high_next = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        faces += [np.stack([low, low_next, high_next], axis=1), np.stack([low, high_next, high], axis=1)]
    return np.concatenate(faces)


def _circle(turn: Array, radius: ArrayLike, z: float) -> Array:
    return np.column_stack([np.cos(turn) * radius, np.sin(turn) * radius, np.full(len(turn), z)])


def _at_height(ring: Array, z: float) -> Array:
    return np.column_stack([ring, np.full(len(ring), z)])


def _toothed(teeth: float, outward: float) -> tuple[Array, Array]:
    """Return radii and angles of the corners of teeth about pitch radius 1."""
    count = _count(teeth, _FEWEST_TEETH)
    module = 2.0 / count
    corners = np.array([[-0.32, -1.1], [-0.14, 0.9], [0.14, 0.9], [0.32, -1.1]])  # pitches, modules
    turn = 2.0 * np.pi / count * (np.arange(count)[:, None] + corners[:, 0]).ravel()
    return 1.0 + outward * module * np.tile(corners[:, 1], count), turn


def _outline(centres: Array, radii: Array) -> tuple[Array, Array]:
    """Return the convex outline (n, 2) of discs, counter-clockwise, and the unit vectors that point outwards."""
    turn = np.linspace(0.0, 2.0 * np.pi, _ARC, endpoint=False)
    directions = np.column_stack([np.cos(turn), np.sin(turn)])
    points = (centres[:, None, :] + radii[:, None, None] * directions).reshape(-1, 2)
    order = hull(points)
    return points[order], np.tile(directions, (len(centres), 1))[order]


def hull(points: ArrayLike) -> list[int]:
    """Return which points (n, 2) are the corners of their convex hull, counter-clockwise, by Andrew's algorithm."""
    points = np.asarray(points, dtype=float)
    order = np.lexsort((points[:, 1], points[:, 0])).tolist()

    def chain(indices: Sequence[int]) -> list[int]:
        corners: list[int] = []
        for i in indices:
            while len(corners) > 1:
                (ax, ay), (bx, by) = points[corners[-1]] - points[corners[-2]], points[i] - points[corners[-2]]
                if ax * by - ay * bx > 0.0:
                    break
                corners.pop()
            corners.append(i)
        return corners[:-1]

    return [*chain(order), *chain(order[::-1])]


def _count(number: float, least: int, most: int = MOST_TEETH) -> int:
    if number != int(number) or not least <= number <= most:
        raise ValueError
    return int(number)
