"""The axis of a vortex, and its weight."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from polygons import convex, distance, holds, normal
from vortex_field import Vortex, facing

from cinegen.planning.vortices import folding, rotation_axis

X, Y, Z = np.eye(3)
angles = st.floats(-math.pi, math.pi)
vectors = arrays(float, 3, elements=st.floats(-2.0, 2.0).map(lambda x: round(x, 4)))


def direction(angle):
    return np.array([math.cos(angle), math.sin(angle), 0.0])


def unit(vector):
    assume(np.linalg.norm(vector) > 0.05)
    return vector / np.linalg.norm(vector)


@given(convex(), arrays(float, (2, 2), elements=st.floats(-3.0, 3.0)))
def test_where_the_weight_is_nothing_the_way_is_free(polygon, ends):
    """ "The vortex field can be discarded, since the QG line is free.\""""
    point, goal = (np.append(end, 0.0) for end in ends)
    assume(distance(polygon, point) > 1e-3 and not holds(polygon, point) and not holds(polygon, goal))
    if facing(goal - point, normal(polygon, point)) == 0.0:
        way = point + np.linspace(0.0, 1.0, 300)[:, None] * (goal - point)
        assert not any(holds(polygon, p) for p in way)


@given(vectors, vectors)
def test_the_vortex_begins_along_the_tangential_part_of_the_direction(n, tau):
    n = unit(n)
    tangent = tau - (tau @ n) * n
    assume(np.linalg.norm(tangent) > 1e-3)
    w = rotation_axis(n, tau)
    assert np.linalg.norm(w) == pytest.approx(1.0)
    assert np.cross(w, n) == pytest.approx(tangent / np.linalg.norm(tangent), abs=1e-9)


@given(angles, angles)
def test_in_a_plane_the_axis_is_its_normal(n, tau):
    """What space says and what the plane says are one; the sense is that of the paper."""
    assume(abs(math.sin(tau - n)) > 1e-6)
    sense = math.copysign(1.0, math.sin(tau - n))
    assert rotation_axis(direction(n), direction(tau)) == pytest.approx(sense * Z, abs=1e-9)
    assert (rotation_axis(direction(n), direction(tau), plane=Z) == sense * Z).all()


@given(angles, vectors, vectors)
def test_a_folding_vortex_comes_nearer_to_the_axis_of_the_base(n, point, base):
    n, to = direction(n), folding(point, base, Z)
    assume(np.linalg.norm(np.cross(n, to)) > 1e-3)
    velocity = Vortex(1.0, 1.0).velocity(0.1, n, rotation_axis(n, to))
    near = np.linalg.norm((point + 1e-6 * velocity - base)[:2])
    assert near < np.linalg.norm((point - base)[:2])
