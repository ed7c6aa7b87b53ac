"""The smallest singular value alone: of matrices whose singular values are known, and as a sampler gives it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from quick_kernels import quick

from cinegen.ik.batch import BatchEvaluator
from cinegen.jit.smallest import smallest_singular_value


def smallest(a):
    rows, n = a.shape
    return quick(smallest_singular_value)(np.array(a, order="C"), rows, n, np.zeros(n), np.zeros(n))


def with_values(rng, rows, values):
    n = len(values)
    left, right = np.linalg.qr(rng.normal(size=(rows, n)))[0], np.linalg.qr(rng.normal(size=(n, n)))[0]
    return (left * values) @ right


@given(
    st.integers(0, 2**32), st.integers(1, 18), st.integers(0, 6), st.floats(-17.0, 0.0), st.integers(1, 3),
    st.sampled_from((1e-8, 1.0, 1e8)),
)  # fmt: skip
def test_it_is_right_to_rounding_however_small_and_however_often_it_occurs(seed, n, more, power, times, scale):
    rng = np.random.default_rng(seed)
    values = rng.uniform(1.0, 2.0, n)
    values[:times] = 10.0**power
    computed = smallest(scale * with_values(rng, n + more, values)) / scale
    assert computed == pytest.approx(values.min(), rel=1e-12, abs=2e-15 * n)


@pytest.mark.parametrize("a", [np.zeros((3, 2)), np.ones((4, 3)), np.c_[np.eye(5), np.zeros(5)]])
def test_dependent_columns_have_0(a):
    assert smallest(a) <= 1e-15


@pytest.mark.parametrize("name", ["arm7", "five_bar", "delta4"])
@pytest.mark.parametrize("counted", [(3, 3), (3, 0), (2, 1)])
def test_a_sampler_that_is_asked_for_less_gives_the_same(robot, name, counted):
    mechanism = robot(name)
    home = [mechanism.q_home[mechanism.q_index(joint)] for joint in mechanism.actuated]
    steps = np.random.default_rng(0).normal(size=(20, len(home))) * 0.01
    motors = home + np.cumsum(steps, axis=0)
    whole = BatchEvaluator(mechanism, mechanism.end, *counted, (), True).follow(motors)
    less = BatchEvaluator(mechanism, mechanism.end, *counted, (), True, whole=False).follow(motors)
    assert np.isfinite(whole.q).any()
    for attribute in ("q", "closure", "passive_sigma"):
        np.testing.assert_array_equal(getattr(whole, attribute), getattr(less, attribute))
    np.testing.assert_allclose(less.singular_values[:, -1], whole.singular_values[:, -1], atol=1e-13)
    assert less.placements.shape == less.jacobians.shape == (20, 0, 0)
