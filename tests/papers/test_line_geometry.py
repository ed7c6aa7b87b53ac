"""Elementary geometry of lines against points and planes, computed without moments."""

import math

import numpy as np
import pytest
import varieties
from hypothesis import given
from hypothesis import strategies as st
from line_geometry import distance, mutual_moment, transversals

from cinegen.singularities.pluecker import LineAtInfinity, PlueckerLine

seeds = st.integers(0, 2**32 - 1)


def _random(rng):
    return PlueckerLine.through(*rng.normal(size=(2, 3)))


def _closest(p, d, q, e):
    """The points of two lines that are nearest to each other, by least squares over both parameters."""
    s, t = np.linalg.lstsq(np.column_stack([d, -e]), q - p, rcond=None)[0]
    return p + s * d, q + t * e


def _apart(a, b):
    p, q = _closest(a.point, a.direction, b.point, b.direction)
    return np.linalg.norm(p - q)


# --- two lines --------------------------------------------------------------------------------------------------------


@given(seeds)
def test_the_mutual_moment_is_distance_times_sine(seed):
    rng = np.random.default_rng(seed)
    a, b = _random(rng), _random(rng)
    sine = math.sin(math.acos(min(1.0, abs(a.direction @ b.direction))))
    assert abs(mutual_moment(a, b)) == pytest.approx(_apart(a, b) * sine, abs=1e-7)
    assert mutual_moment(a, b) == pytest.approx(mutual_moment(b, a))
    assert distance(a, b) == pytest.approx(_apart(a, b), abs=1e-9)


# --- several lines ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("maker", "count"), [
    (varieties.hyperbolic, 2),
    (varieties.hyperbolic_one_far, 2),
    (varieties.parabolic, 1),
    (varieties.parabolic_far, 1),
    (varieties.elliptic, 0),
])  # fmt: skip
def test_four_lines_of_a_congruence_are_met_by_its_directors(maker, count, seed):
    variety = varieties.placed(maker, np.random.default_rng(seed), others=0)
    across = transversals(variety.lines[:4], variety.length)
    assert not across.infinitely_many
    assert len(across.lines) == count
    for line in across.lines:
        if isinstance(line, LineAtInfinity):
            assert abs(line.normal @ variety.turn @ variety.built.normals[0]) == pytest.approx(1.0)
        else:
            slack = (1e-8 if count == 2 else 1e-6) * variety.length  # a double root is half as accurate
            assert min(_apart(line, variety.line(ends)) for ends in variety.built.directors) < slack
            assert all(_apart(line, other) < slack for other in variety.lines[:4])
