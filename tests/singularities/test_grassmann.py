"""Grassmann's varieties: lines made to lie in one are recognised, and no others."""

import math

import numpy as np
import pytest
import varieties
from hypothesis import given, settings
from hypothesis import strategies as st

from cinegen.singularities.grassmann import classify, near
from cinegen.singularities.line_varieties import GrassmannClass, class_of_wrenches
from cinegen.singularities.pluecker import LineAtInfinity, PlueckerError, PlueckerLine

seeds = st.integers(0, 2**32 - 1)
HOME, X, Y, Z = np.zeros(3), *np.eye(3)
makers = pytest.mark.parametrize("maker", varieties.ALL)


def _off(line, ends):
    """How far a line is from the worse of two points."""
    return max(np.linalg.norm(line.nearest(end) - end) for end in ends)


# --- every variety ---------------------------------------------------------------------------------------------------


@makers
@pytest.mark.parametrize("noise", [0.0, 1e-9])
def test_lines_of_a_variety_are_recognised_among_others(maker, noise):
    placed = varieties.placed(maker, np.random.default_rng(2), noise)
    dependence = classify(placed.lines, placed.length)
    assert dependence.grassmann_class is placed.built.grassmann_class
    assert len(dependence.sets) == 1
    assert dependence.lines == placed.where
    assert dependence.sets[0].smallest == (placed.where,)
    assert dependence.rank == len(placed.lines) - 1
    assert dependence.grassmann_class.rank == len(placed.where) - 1
    assert dependence.sigma < max(1e-12, 10.0 * noise)


@makers
def test_what_defines_a_variety_is_found(maker):
    placed = varieties.placed(maker, np.random.default_rng(100))
    built, some = placed.built, classify(placed.lines, placed.length).sets[0]
    slack = (1e-5 if built.grassmann_class is GrassmannClass.PARABOLIC_CONGRUENCE else 1e-9) * placed.length
    finite = [point.xyz for point in some.points if not point.at_infinity]
    far = [point.xyz for point in some.points if point.at_infinity]
    for expected in built.points:
        assert min(np.linalg.norm(point - placed.point(expected)) for point in finite) < slack
    for expected in built.directions:
        assert max(abs(direction @ placed.turn @ expected) for direction in far) == pytest.approx(1.0)
    if built.pitch is None:
        assert len(finite) >= len(built.points)
        directors = some.directors
    else:
        assert some.screw.pitch == pytest.approx(built.pitch * placed.length, rel=1e-9)
        directors = (some.screw.axis,)
        assert [line.coordinates.tolist() for line in some.directors] == (
            [some.screw.axis.coordinates.tolist()] if built.grassmann_class is GrassmannClass.SPECIAL_COMPLEX else []
        )
    assert len(directors) == len(built.directors) + len(built.normals)
    near_lines = [line for line in directors if isinstance(line, PlueckerLine)]
    far_lines = [line for line in directors if isinstance(line, LineAtInfinity)]
    for ends in built.directors:
        assert min(_off(line, [placed.point(end) for end in ends]) for line in near_lines) < slack
    for normal in built.normals:
        assert max(abs(line.normal @ placed.turn @ normal) for line in far_lines) == pytest.approx(1.0)
    groups = some.groups[-len(some.planes) :] or (some.lines,)  # those of a plane come last
    for plane, group in zip(some.planes, groups, strict=False):
        for line in (placed.lines[i] for i in group):
            assert plane.normal @ line.direction == pytest.approx(0.0, abs=1e-9)
            assert plane.normal @ line.point == pytest.approx(plane.offset, abs=slack)
    assert sorted(line for group in some.groups for line in group) == list(some.lines if some.groups else ())


@makers
def test_forces_of_the_coefficients_hold_each_other_and_the_gained_motion_lengthens_no_leg(maker):
    placed = varieties.placed(maker, np.random.default_rng(7))
    dependence = classify(placed.lines, placed.length)
    some = dependence.sets[0]
    forces = [c * placed.lines[i].direction for c, i in zip(some.coefficients, some.smallest[0], strict=True)]
    moments = [np.cross(placed.lines[i].point, f) for f, i in zip(forces, some.smallest[0], strict=True)]
    assert np.linalg.norm(some.coefficients) == pytest.approx(1.0)
    assert np.abs(some.coefficients).min() > 1e-3
    assert sum(forces) == pytest.approx(np.zeros(3), abs=1e-12)
    assert sum(moments) == pytest.approx(np.zeros(3), abs=1e-11 * placed.length)
    assert len(dependence.uncontrolled) == 6 - dependence.rank
    for screw in dependence.uncontrolled:
        w, v = screw.coordinates[:3], screw.coordinates[3:]
        size = np.linalg.norm(v + np.cross(w, placed.lines[0].point)) + placed.length * np.linalg.norm(w)
        for line in placed.lines:
            assert line.direction @ (v + np.cross(w, line.point)) == pytest.approx(0.0, abs=1e-9 * size)


@makers
def test_lines_beside_a_variety_are_near_not_in(maker):
    placed = varieties.placed(maker, np.random.default_rng(300), noise=1e-4)
    assert classify(placed.lines, placed.length) is None
    dependence = near(placed.lines, placed.length, 3e-3)
    assert dependence.grassmann_class is placed.built.grassmann_class
    assert dependence.lines == placed.where
    assert 1e-7 < dependence.sigma < 3e-3
    assert dependence.text().startswith("nearly: ")
    assert dependence.sigma == pytest.approx(varieties.nearness(placed.lines, placed.length))


# --- all lines together ---------------------------------------------------------------------------------------------


def _sixes(maker, rng, noise=0.0):
    """As many lines of a variety as can be made, moved and scaled; and the length."""
    while True:
        try:
            built = maker(rng, 6)
        except TypeError:
            built = maker(rng)
        length, turn, shift = 10.0 ** rng.uniform(-3.0, 3.0), varieties.rotation(rng), rng.normal(size=3)
        segments = [[end + noise * rng.normal(size=3) for end in ends] for ends in built.segments]
        lines = [PlueckerLine.through(*(length * (turn @ end + shift) for end in ends)) for ends in segments]
        vectors = varieties.LineFrame.of(lines, length).coordinates(lines)
        if np.linalg.svd(vectors, compute_uv=False)[built.grassmann_class.rank - 1] > 0.1:
            return built, lines, length


@makers
@pytest.mark.parametrize("noise", [0.0, 1e-9])
def test_the_class_of_all_lines_is_that_of_their_variety(maker, noise):
    built, lines, length = _sixes(maker, np.random.default_rng(1), noise)
    dependence, rank = classify(lines, length), built.grassmann_class.rank
    assert dependence.class_of_all is built.grassmann_class
    assert dependence.rank == dependence.forces.order == rank
    assert dependence.motions.order == 6 - rank
    assert class_of_wrenches(dependence.forces) is built.grassmann_class
    assert dependence.as_dict()["class_of_all"] == built.grassmann_class.title


def test_two_lines_that_do_not_meet_are_skew():
    rng = np.random.default_rng(0)
    for _ in range(20):
        lines = [PlueckerLine.through(*rng.normal(size=(2, 3))) for _ in range(2)]
        assert classify([*lines, *lines], 1.0).class_of_all is GrassmannClass.SKEW_LINES
    assert GrassmannClass.SKEW_LINES.title == "skew lines (2a)"
    assert classify([PlueckerLine.through(*rng.normal(size=(2, 3))) for _ in range(6)], 1.0) is None


def test_the_smallest_set_and_all_lines_may_be_of_different_classes():
    """Three of six lines that meet two lines are a flat pencil."""
    points = ((1, 1), (1, 2), (1, -1), (2, 3), (-1, 2), (-2, -3))
    dependence = classify([PlueckerLine.through(s * X, Z + t * Y) for s, t in points], 1.0)
    assert dependence.grassmann_class is GrassmannClass.FLAT_PENCIL
    assert dependence.class_of_all is GrassmannClass.HYPERBOLIC_CONGRUENCE
    assert dependence.rank == 4
    assert [some.lines for some in dependence.sets] == [(0, 1, 2), (0, 1, 3, 4, 5)]
    assert dependence.motions.text() == (
        "any combination of a rotation about the axis through (0, 0, 1) m along (0, 1, 0) and a rotation about the "
        "axis through (0, 0, 0) m along (1, 0, 0)"
    )
    bundle = [PlueckerLine.along(HOME, direction) for direction in (X, Y, Z, X + Y + Z)]
    dependence = classify([*bundle, PlueckerLine.along(X, Y), PlueckerLine.along(2 * Y, Y + X)], 1.0)
    assert dependence.grassmann_class is GrassmannClass.BUNDLE
    assert dependence.class_of_all is GrassmannClass.DEGENERATE_CONGRUENCE


# --- none, several, larger -------------------------------------------------------------------------------------------


@settings(max_examples=200)
@given(seeds, st.integers(1, 6), st.floats(1e-3, 1e3))
def test_lines_at_random_are_independent(seed, count, length):
    rng = np.random.default_rng(seed)
    lines = [PlueckerLine.through(*(length * rng.normal(size=(2, 3)))) for _ in range(count)]
    if varieties.nearness(lines, length) > 1e-5:  # all but one in a hundred thousand
        assert classify(lines, length) is None
        assert near(lines, length, 1e-5) is None


def test_two_sets_that_span_different_varieties_are_both_named():
    rng = np.random.default_rng(3)
    first, second = varieties.flat_pencil(rng), varieties.parallels_in_plane(rng)
    turn = varieties.rotation(rng)
    ends = first.segments + [tuple(turn @ end + [3, 1, 2] for end in segment) for segment in second.segments]
    dependence = classify([PlueckerLine.through(*ends[i]) for i in (0, 3, 1, 4, 2, 5)], 1.0)
    assert [some.lines for some in dependence.sets] == [(0, 2, 4), (1, 3, 5)]
    assert dependence.rank == 4
    assert dependence.text().startswith("legs 1, 3 and 5 meet in one point")
    assert "; legs 2, 4 and 6 are parallel" in dependence.text()


@pytest.mark.parametrize(
    ("maker", "count"),
    [(varieties.one_line, 4), (varieties.flat_pencil, 5), (varieties.plane, 6), (varieties.elliptic, 6)],
)
def test_more_lines_of_one_variety_are_one_set(maker, count):
    built = maker(np.random.default_rng(11), count)
    dependence = classify([PlueckerLine.through(*ends) for ends in built.segments], 1.0)
    size = built.grassmann_class.rank + 1
    assert dependence.grassmann_class is built.grassmann_class
    assert [some.lines for some in dependence.sets] == [tuple(range(count))]
    assert len(dependence.sets[0].smallest) == math.comb(count, size)
    assert dependence.rank == size - 1


# --- words and errors ------------------------------------------------------------------------------------------------


def _along(*pairs):
    return [PlueckerLine.along(*pair) for pair in pairs]


def test_numbers_and_units():
    lines = _along((Y, X), (Y, Y), (Y, Z), (HOME, X), (Y, X + Y + Z))
    dependence = classify(lines, 0.1)
    assert dependence.text() == "legs 1, 2, 3 and 5 meet in one point, (0, 1, 0)"
    assert dependence.text("m") == "legs 1, 2, 3 and 5 meet in one point, (0, 1, 0) m"


@pytest.mark.parametrize(("ask", "says"), [
    (lambda: classify([], 1.0), "0 lines"),
    (lambda: classify(_along(*[(HOME, X)] * 7), 1.0), "7 lines"),
    (lambda: classify(_along((HOME, X)), -1.0), "positive"),
    (lambda: near(_along((HOME, X)), 1.0, 3.0), "between 0 and 1"),
])  # fmt: skip
def test_what_can_not_be_asked_says_why(ask, says):
    with pytest.raises(PlueckerError, match=says):
        ask()
