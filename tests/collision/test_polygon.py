"""Polygons and the convex pieces they are cut into, against exact fractions, ray casting and areas."""

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cinegen.collision.polygon import convex_pieces, polygon_error

integers = st.integers(-4, 4)


def _shoelace(points):
    x, y = np.array(points, dtype=float).T
    return 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _inside(points, p):
    """Ray casting: how often a ray to the right crosses the outline."""
    odd = False
    for a, b in zip(points, np.roll(points, -1, axis=0), strict=True):
        if (a[1] > p[1]) != (b[1] > p[1]) and p[0] < a[0] + (p[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]):
            odd = not odd
    return odd


def _to_outline(points, p):
    a, side = points, np.roll(points, -1, axis=0) - points
    t = np.clip(((p - a) * side).sum(axis=1) / (side * side).sum(axis=1), 0.0, 1.0)
    return float(np.linalg.norm(a + t[:, None] * side - p, axis=1).min())


def _left(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _on(a, b, p):
    return _left(a, b, p) == 0 and all(min(u, v) <= w <= max(u, v) for u, v, w in zip(a, b, p, strict=True))


def _meet(a, b, c, d):
    """Whether two closed segments have a point in common; exact on fractions."""
    sides = [_left(a, b, c), _left(a, b, d), _left(c, d, a), _left(c, d, b)]
    if sides[0] * sides[1] < 0 and sides[2] * sides[3] < 0:
        return True
    return _on(a, b, c) or _on(a, b, d) or _on(c, d, a) or _on(c, d, b)


def _is_simple(points):
    n = len(points)
    if len(set(points)) < n:
        return False
    sides = [(points[i], points[(i + 1) % n]) for i in range(n)]
    for i, j in combinations(range(n), 2):
        if (j - i) % n == 1 or (i - j) % n == 1:
            corner, (a, b) = ((i + 1) % n, (i, (j + 1) % n)) if (j - i) % n == 1 else ((j + 1) % n, (j, (i + 1) % n))
            p, q, r = points[a], points[corner], points[b]
            if _left(p, q, r) == 0 and (q[0] - p[0]) * (r[0] - q[0]) + (q[1] - p[1]) * (r[1] - q[1]) < 0:
                return False
        elif _meet(*sides[i], *sides[j]):
            return False
    return True


def _star(seed):
    """Corners around a point, none of them far from a circle: never crossing itself, seldom convex."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 30))
    angles = (np.arange(n) + rng.uniform(0.1, 0.9, n)) * 2.0 * np.pi / n
    radii = rng.uniform(0.3, 1.0, n)
    points = np.column_stack([np.cos(angles), np.sin(angles)]) * radii[:, None] * 10.0 ** rng.uniform(-2, 2)
    return points[::-1] if rng.integers(2) else points


COMB = np.array([[0, 0], [7, 0], [7, 3], [6, 3], [6, 1], [5, 1], [5, 3], [4, 3], [4, 1], [1, 1], [1, 3], [0, 3.0]])
CASES = {
    "square": (np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]), 1),
    "square with points on its sides": (np.array([[0, 0], [0.3, 0], [1, 0], [1, 0.5], [1, 1], [0, 1.0]]), 1),
    "L": (np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2.0]]), 2),
    "comb": (COMB, 4),
    "hexagon": (np.column_stack([np.cos(np.arange(6) * np.pi / 3), np.sin(np.arange(6) * np.pi / 3)]), 1),
}


@pytest.mark.parametrize("name", CASES)
def test_known_polygons_have_few_pieces(name):
    points, fewest = CASES[name]
    for turned in (points, points[::-1], np.roll(points, 2, axis=0)):
        pieces = convex_pieces(turned)
        # as few as there can be, and never more than four times as many (Hertel and Mehlhorn)
        assert len(pieces) == 1 if fewest == 1 else fewest <= len(pieces) <= 4 * fewest
        assert sum(map(_shoelace, pieces)) == pytest.approx(abs(_shoelace(points)))


@settings(max_examples=200)
@given(st.integers(0, 2**32 - 1))
def test_pieces_are_convex_and_fill_the_polygon(seed):
    points = _star(seed)
    pieces = convex_pieces(points)
    size = np.ptp(points, axis=0).max()
    assert sum(map(_shoelace, pieces)) == pytest.approx(abs(_shoelace(points)), rel=1e-9)
    for piece in pieces:
        a, b = np.roll(piece, -1, axis=0) - piece, np.roll(piece, -2, axis=0) - np.roll(piece, -1, axis=0)
        assert (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > -1e-9 * size * size).all()
        assert {tuple(corner) for corner in piece} <= {tuple(corner) for corner in points}
    rng = np.random.default_rng(seed)
    for p in rng.uniform(points.min(axis=0), points.max(axis=0), (40, 2)):
        if _to_outline(points, p) > 1e-6 * size:
            assert any(_inside(piece, p) for piece in pieces) == _inside(points, p)


@settings(max_examples=800)
@given(st.lists(st.tuples(integers, integers), min_size=3, max_size=7))
def test_a_polygon_that_crosses_or_touches_itself_is_told_from_one_that_does_not(points):
    exact = [(Fraction(x), Fraction(y)) for x, y in points]
    assert (polygon_error(np.array(points, dtype=float)) is None) == _is_simple(exact)
