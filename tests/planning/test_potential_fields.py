"""The FIRAS potential against finite differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from polygons import convex, distance, holds, normal

from cinegen.planning.descent import CONTACT, Firas

lengths = st.floats(-2.0, 2.0).map(lambda x: round(x, 4))
points = arrays(float, 3, elements=lengths)


def slopes(value, point, step=1e-6):
    """Central differences."""
    return np.array([(value(point + e) - value(point - e)) / (2.0 * step) for e in step * np.eye(3)])


@given(convex(), points, st.floats(0.2, 3.0))
def test_firas_has_the_gradient_of_its_value_around_any_convex_polygon(polygon, point, reach):
    point = point * [1.0, 1.0, 0.0]
    d = distance(polygon, point)
    assume(not holds(polygon, point) and d > 0.02 and abs(d - reach) > 1e-4)
    field = Firas(0.3, reach)
    wanted = slopes(lambda p: float(field.value(distance(polygon, p))), point)
    got = field.gradient(d, normal(polygon, point))
    assert got == pytest.approx(wanted, abs=1e-4 * (1.0 + np.linalg.norm(got)))


def test_firas_ends_at_its_reach_and_is_continuous_there():
    field, n = Firas(2.0, 0.5), np.array([1.0, 0.0, 0.0])
    assert field.value([0.25, 0.5, 0.7]) == pytest.approx([4.0, 0.0, 0.0])
    assert field.gradient([0.25, 0.5, 9.0], [n, n, n])[:, 0] == pytest.approx([-64.0, 0.0, 0.0])
    assert 0.0 < field.value(0.5 - 1e-7) < 1e-12
    assert -1e-4 < field.gradient(0.5 - 1e-7, n)[0] < 0.0


@pytest.mark.parametrize("d", [CONTACT, 0.0, -0.1, math.nan])
def test_at_contact_the_potential_is_infinite_and_has_no_gradient(d):
    assert Firas(1.0, 1.0).value(d) == math.inf
    assert np.isnan(Firas(1.0, 1.0).gradient(d, [1.0, 0.0, 0.0])).all()
