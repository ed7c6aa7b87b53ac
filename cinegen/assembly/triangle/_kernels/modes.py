"""All placements for many sets of leg lengths, one after the other: what Python calls."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.assembly.triangle._kernels.circles import find_circles, sort_circles, write_equations
from cinegen.assembly.triangle._kernels.companion import ROWS
from cinegen.assembly.triangle._kernels.plane import ROOTS as COSINES
from cinegen.assembly.triangle._kernels.plane import cosines
from cinegen.assembly.triangle._kernels.pose import LEGS, polish, write_placement, write_points
from cinegen.assembly.triangle._kernels.roots import COMPLEX, INFINITE, LOST, REAL, follow, is_real
from cinegen.assembly.triangle._kernels.space import DEGREE as HIGHEST
from cinegen.assembly.triangle._kernels.space import directions
from cinegen.jit.compiled import Array, Table, compiled, entry

Complex = NDArray[np.complex128]

MODES = 16
KEYS = 10  # by which placements are sorted: height of the platform's middle, coordinates of its points
# what is counted of each set of lengths: placements; roots, a multiple one as often as it is one: real, complex, at
# infinity, lost; and what happened
PLACEMENTS, REALS, COMPLEXES, INFINITES, LOSTS, OUTCOME, COUNTS_WIDTH = range(7)
SOLVED, APART, CURVE, UNSETTLED = range(4)
"""Outcomes: APART is two legs of a pair that can't meet, CURVE a determinant that is zero everywhere."""

_ZERO = 1e-13  # the least pivot of a determinant that is zero everywhere
_SAME = 3e-7  # of the longest leg: nearer placements are one
_LEVEL = 1e-9  # of the longest leg: coordinates that are nearer are equal where placements are sorted
_OFF = 1e-12  # of the longest leg: a placement whose legs are further off is none


class Robot(NamedTuple):
    """A manipulator, as the kernels know it.

    Attributes:
        geometry: (3, GEOMETRY_WIDTH) of the pairs of legs.
        pairs: (6,) legs, two by two.
        sides: (3,) distances of the platform points 12-34, 12-56, 34-56.
        base: (6, 3) base points.
        platform: (3, 3) platform points, in the order of the pairs.
        own: (3, 3) their axes.
        legs: (6,) which pair a leg belongs to.
        up: (3,) unit vector: the direction in which placements are sorted.
        plane: (1,) whether the base points are in one plane; then all f of the geometry are its normal.
    """

    geometry: Array
    pairs: Table
    sides: Array
    base: Array
    platform: Array
    own: Array
    legs: Table
    up: Array
    plane: Table


class Scratch(NamedTuple):
    """Room for one set of lengths; the roots are left there."""

    quadratics: Array
    blocks: Array
    wide: Array
    matrix: Array
    points: Array
    axes: Array
    placement: Array
    keys: Array
    steps: Array
    roots: Complex
    root_times: Table
    known: Table
    choice: Complex
    newton: Complex


def scratch() -> Scratch:
    """Room for the kernels here."""
    return Scratch(
        quadratics=np.empty((6, 3)),
        blocks=np.empty((HIGHEST + 1, ROWS, ROWS)),
        wide=np.empty((ROWS, ROWS * (HIGHEST + 1))),
        matrix=np.empty((MODES, MODES)),
        points=np.empty((3, 3)),
        axes=np.empty((3, 3)),
        placement=np.empty((4, 4)),
        keys=np.empty((MODES + 1, KEYS)),
        steps=np.empty((LEGS + 4, LEGS + 1)),
        roots=np.empty((MODES + 1, 3), dtype=complex),
        root_times=np.empty(MODES + 1, dtype=np.int64),
        known=np.zeros(1, dtype=np.int64),
        choice=np.empty((5, 3), dtype=complex),
        newton=np.empty((6, 3), dtype=complex),
    )


@entry
def eliminate_in_plane(
    robot: Robot, lengths: Array, room: Scratch, circles: Array, equations: Array, found: Array, counts: Table
) -> None:
    """Where the base points are in one plane, for each of the lengths (m, 6): half of all exp(i p34).

    The largest circle is taken as that of p12, the next as that of p34.

    Args:
        robot: whose.
        lengths: of the legs.
        room: scratch.
        circles: (m, 3, CIRCLES_WIDTH), the largest first.
        equations: (m, 3, EQUATION_WIDTH) of the distances.
        found: (m, 2, MODES) real and imaginary parts; the inverse of each is that of the mirror image.
        counts: (m, COUNTS_WIDTH) the outcome; the rest is zero.
    """
    for m in range(lengths.shape[0]):
        if _begin(robot, lengths[m], circles[m], equations[m], counts[m]):
            regular = cosines(equations[m], room.quadratics, room.blocks, room.wide, room.matrix, found[m])
            _judge(regular, counts[m])
            for i in range(COSINES):
                w = _with_cosine(complex(found[m, 0, i], found[m, 1, i]))
                found[m, 0, i], found[m, 1, i] = w.real, w.imag


@entry
def eliminate_in_space(
    robot: Robot, lengths: Array, room: Scratch, circles: Array, equations: Array, found: Array, counts: Table
) -> None:
    """As `eliminate_in_plane`, for base points anywhere: all exp(i p34)."""
    for m in range(lengths.shape[0]):
        if _begin(robot, lengths[m], circles[m], equations[m], counts[m]):
            regular = directions(equations[m], room.quadratics, room.blocks, room.wide, room.matrix, found[m])
            _judge(regular, counts[m])


@entry
def find_placements(
    robot: Robot,
    lengths: Array,
    room: Scratch,
    circles: Array,
    equations: Array,
    found: Array,
    placements: Array,
    times: Table,
    counts: Table,
) -> None:
    """All placements, from what an elimination found.

    Args:
        robot: whose.
        lengths: of the legs.
        room: scratch; has the roots of the last lengths afterwards.
        circles: as eliminated.
        equations: as eliminated.
        found: as eliminated.
        placements: (m, MODES, 4, 4) the first of which are written.
        times: (m, MODES) how many of the sixteen roots each of them is.
        counts: (m, COUNTS_WIDTH) with the outcome; is completed.
    """
    for m in range(lengths.shape[0]):
        if counts[m, OUTCOME] == SOLVED:
            _find_roots(robot, equations[m], room, found[m], counts[m])
            _place(robot, lengths[m], room, circles[m], placements[m], times[m], counts[m])


@compiled
def _begin(robot: Robot, lengths: Array, circles: Array, equations: Array, counts: Table) -> bool:
    for i in range(COUNTS_WIDTH):
        counts[i] = 0
    if not find_circles(robot.geometry, robot.pairs, lengths, circles):
        counts[OUTCOME], counts[COMPLEXES] = APART, MODES
        return False
    sort_circles(circles)
    write_equations(circles, robot.sides, equations)
    return True


@compiled
def _judge(regular: float, counts: Table) -> None:
    if not regular > _ZERO:
        counts[OUTCOME] = UNSETTLED if regular < 0.0 else CURVE
        counts[LOSTS] = MODES


@compiled
def _find_roots(robot: Robot, equations: Array, room: Scratch, found: Array, counts: Table) -> None:
    """Leaves in room the distinct finite roots that eigenvalues lead to, and counts the others."""
    known, each = 0, _each(robot)
    for i in range(MODES // each):
        w = complex(found[0, i], found[1, i])
        kind = follow(equations, w, each == 2, known, room.roots, room.root_times, room.choice, room.newton)
        if kind in (REAL, COMPLEX):
            known += 1
        elif kind == INFINITE:
            counts[INFINITES] += each
        elif kind == LOST:
            counts[LOSTS] += each
    room.known[0] = known


@compiled
def _place(
    robot: Robot, lengths: Array, room: Scratch, circles: Array, placements: Array, times: Table, counts: Table
) -> None:
    """Placements of the roots that are real; the others are counted."""
    each = _each(robot)
    for i in range(room.known[0]):
        root, often = room.roots[i], room.root_times[i]
        if not is_real(root):
            counts[COMPLEXES] += each * often
            continue
        for image in range(each):
            if image == 1:
                for k in range(3):
                    root[k] = root[k].conjugate()
            write_points(circles, root, room.points)
            if _insert(robot, lengths, room, often, placements, times, counts):
                counts[REALS] += often
            else:
                counts[LOSTS] += often


@compiled
def _each(robot: Robot) -> int:
    """How many solutions an eigenvalue stands for: where the base points are in a plane, a mirror image too."""
    return 2 if robot.plane[0] != 0 else 1


@compiled
def _with_cosine(c: complex) -> complex:
    """One exp(i p) with this cosine; the other one is its inverse."""
    root = np.sqrt(c - 1.0) * np.sqrt(c + 1.0)
    return complex(c + root if (root * c.conjugate()).real >= 0.0 else c - root)


@compiled
def _insert(
    robot: Robot, lengths: Array, room: Scratch, often: int, placements: Array, times: Table, counts: Table
) -> bool:
    """Puts the placement of three points where it belongs among those that are there; False if it is none."""
    points, n, key = room.points, counts[PLACEMENTS], room.keys[MODES]
    longest = 0.0
    for leg in range(LEGS):
        longest = max(longest, lengths[leg])
    key[0] = 0.0
    for k in range(3):
        for i in range(3):
            key[1 + 3 * k + i] = points[k, i]
            key[0] += points[k, i] * robot.up[i] / 3.0
    place = n
    for other in range(n - 1, -1, -1):
        order, same = 0, True
        for i in range(KEYS):
            gap = key[i] - room.keys[other, i]
            if abs(gap) > _SAME * longest:
                same = False
            if order == 0 and abs(gap) > _LEVEL * longest:
                order = 1 if gap > 0.0 else -1
        if same:
            times[other] += often
            return True
        if order > 0:
            place = other
    placement = room.placement
    write_placement(points, robot.platform, robot.own, room.axes, placement)
    if not polish(robot.base, robot.platform, robot.legs, lengths, placement, room.steps) <= _OFF:
        return False
    for other in range(n, place, -1):
        times[other] = times[other - 1]
        for i in range(KEYS):
            room.keys[other, i] = room.keys[other - 1, i]
        for i in range(4):
            for j in range(4):
                placements[other, i, j] = placements[other - 1, i, j]
    times[place] = often
    for i in range(KEYS):
        room.keys[place, i] = key[i]
    for i in range(4):
        for j in range(4):
            placements[place, i, j] = placement[i, j]
    counts[PLACEMENTS] += 1
    return True
