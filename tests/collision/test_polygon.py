"""Polygons and the convex pieces they are cut into, against shapely."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LinearRing, Polygon, unary_union

from cinegen.collision.polygon import convex_pieces, polygon_error

integers = st.integers(-4, 4)


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
        assert sum(Polygon(piece).area for piece in pieces) == pytest.approx(Polygon(points).area)


@settings(max_examples=200)
@given(st.integers(0, 2**32 - 1))
def test_pieces_are_convex_and_fill_the_polygon(seed):
    points = _star(seed)
    pieces = convex_pieces(points)
    size = np.ptp(points, axis=0).max()
    whole, parts = Polygon(points), [Polygon(piece) for piece in pieces]
    assert sum(part.area for part in parts) == pytest.approx(whole.area, rel=1e-9)
    assert unary_union(parts).symmetric_difference(whole).area <= 1e-9 * size * size
    for piece in pieces:
        a, b = np.roll(piece, -1, axis=0) - piece, np.roll(piece, -2, axis=0) - np.roll(piece, -1, axis=0)
        assert (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > -1e-9 * size * size).all()
        assert {tuple(corner) for corner in piece} <= {tuple(corner) for corner in points}


@settings(max_examples=800)
@given(st.lists(st.tuples(integers, integers), min_size=3, max_size=7))
def test_a_polygon_that_crosses_or_touches_itself_is_told_from_one_that_does_not(points):
    is_simple = len(set(points)) == len(points) and LinearRing(points).is_simple
    assert (polygon_error(np.array(points, dtype=float)) is None) == is_simple
