"""What assembly modes are solved with: loops in complex numbers against finite differences and the model, least squares
against numpy, the trace test against what is taken away from it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from linkages import hinge, ring, slide

import cinegen
from cinegen.assembly._kernels.equations import evaluate
from cinegen.assembly._kernels.tables import ARRIVED, SINGULAR, ParameterPath
from cinegen.assembly._kernels.tracking import solve
from cinegen.assembly.distinct_solutions import DistinctSolutions
from cinegen.assembly.endgame import path_ends
from cinegen.assembly.errors import FreeMotionError
from cinegen.assembly.linkage import ACCURACY, Linkage
from cinegen.assembly.monodromy import Monodromy
from cinegen.assembly.trace_test import TraceTest
from cinegen.singularities.ball_joints import linkage_of

ROBOTS = ("five_bar", "hybrid", "delta4_linear")


@pytest.fixture(scope="module")
def hybrid(root):
    """A tripod, its linkage, and a fibre of all its solutions."""
    mechanism = cinegen.load(root / "robots" / "hybrid.raff")
    linkage = Linkage(mechanism)
    return mechanism, linkage, Monodromy(linkage).fibre()


def test_what_a_linkage_is_made_of_is_known_without_machine_code(monkeypatch, robot, built):
    def refuse(kernel, *_):
        raise AssertionError(f"{kernel.__name__} would be compiled")

    monkeypatch.setattr("cinegen.assembly.linkage.prepare", refuse)
    assert len(linkage_of(robot("gough")).bodies.centres) == 12
    p = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 2))
    moves = built(ring([hinge(p[0], motor=True), *map(hinge, p[1:])]))
    with pytest.raises(FreeMotionError):
        Linkage(moves)
    assert linkage_of(moves).idle == 1
    with pytest.raises(AssertionError, match="track would be compiled"):
        Linkage(robot("gough")).newton(np.zeros((1, 13)), np.zeros(6))


@pytest.mark.parametrize("name", ROBOTS)
def test_loops_close_and_features_are_where_the_model_has_them(robot, name):
    m = robot(name)
    linkage = Linkage(m)
    for q in m.structure.samples:
        motors, x = linkage.locked_values(q), linkage.unknowns(q)
        evaluate(linkage.tables, linkage.fixed(motors), x, linkage.scratch)
        assert np.abs(linkage.scratch.residual).max() < 1e-11
        assert np.abs(linkage.configuration(x, motors) - q)[_turns(m, q)].max(initial=0.0) < 1e-12
        m.structure.system.evaluate(q)
        features = linkage.features(x[None], motors)[0].reshape(-1, 3)
        for (body, direction), local, feature in zip(
            linkage.tables.vectors, linkage.tables.local, features, strict=False
        ):
            placement = m.structure.system.data.oMi[int(body) + linkage.root]
            expected = placement.rotation @ local if direction else placement.act(local * m.length) / m.length
            assert np.abs(feature - expected).max() < 1e-12


def _turns(m, q):
    """Where q is within half a turn of home, as `configuration` writes it."""
    return np.abs(q - m.q_home) < np.pi


@pytest.mark.parametrize("driven", ["crank", "slide"])
def test_sliding_joints_come_back_from_a_solution_in_metres(built, driven):
    """Whether the loops determine them or not. The robot is many times as long as 1 m."""
    p = np.array([[0.0, 0.0], [3.0, 9.0], [20.0, 2.0]])
    joints = [hinge(p[0], motor=driven == "crank"), hinge(p[1]), hinge(p[2])]
    m = built(ring([*joints, slide(p[2], [1.0, 0.2], driven == "slide")], 1))
    assert m.length > 5.0
    linkage = Linkage(m)
    for q in m.structure.samples:
        restored = linkage.configuration(linkage.unknowns(q), linkage.locked_values(q))
        assert restored[_turns(m, q)] == pytest.approx(q[_turns(m, q)], abs=1e-12)
        slider = next(m.q_index(name) for name in m.joints if m.is_prismatic(name))
        assert restored[slider] == pytest.approx(q[slider], abs=1e-12)
    assert any(np.abs(q[slider]) > 0.1 for q in m.structure.samples)


@pytest.mark.parametrize("algebraic", [False, True])
@pytest.mark.parametrize("name", ROBOTS)
def test_derivatives_are_those_of_the_equations_in_complex_numbers(robot, name, algebraic):
    m, rng = robot(name), np.random.default_rng(0)
    linkage = Linkage(m)
    count = len(linkage.locked)
    line = 0.5 * (rng.normal(size=(count, 2)) + 1j * rng.normal(size=(count, 2)))
    cut = rng.normal(size=len(linkage.zero_slice)) + 1j * rng.normal(size=len(linkage.zero_slice))
    path = ParameterPath(np.array([line, line]), np.array([cut, cut]), algebraic, ACCURACY)
    x = 0.7 * (rng.normal(size=len(linkage.passive) + 1) + 1j * rng.normal(size=len(linkage.passive) + 1))

    def at(x):
        evaluate(linkage.tables, path, x, linkage.scratch)
        return linkage.scratch.residual.copy()

    at(x)
    matrix, step = linkage.scratch.matrix.copy(), 1e-6
    for k in range(len(x)):
        away = np.zeros(len(x))
        away[k] = step
        difference = (at(x + away) - at(x - away)) / (2.0 * step)
        assert np.abs(difference - matrix[k]).max() < 1e-7 * (1.0 + np.abs(matrix[k]).max())


@settings(max_examples=15)
@given(st.integers(0, 10**6), st.integers(1, 7), st.integers(0, 4), st.integers(0, 3))
def test_least_squares_are_numpys(seed, columns, more, fewer):
    rng, rank = np.random.default_rng(seed), max(1, columns - fewer)
    rows = columns + more

    def general(*shape):
        return rng.normal(size=shape) + 1j * rng.normal(size=shape)

    matrix, right = general(rows, rank) @ general(rank, columns), general(rows)
    step = np.zeros(columns, dtype=complex)
    pivot = solve(matrix.T.copy(), columns, right.copy(), rank, np.zeros(columns, dtype=np.int64), step)
    expected, _, _, sigma = np.linalg.lstsq(matrix, right, rcond=1e-10)
    assert np.abs(matrix @ (step - expected)).max() < 1e-9 * np.abs(right).max() / (sigma[rank - 1] / sigma[0])
    assert pivot > 0.0
    assert np.count_nonzero(step) <= rank


def test_the_trace_test_finds_what_is_missing(hybrid):
    """Of either of the two sets."""
    mechanism, linkage, fibre = hybrid
    home, rng = linkage.locked_values(mechanism.q_home), np.random.default_rng(3)
    trace = TraceTest(linkage, home, rng, lambda: False, lambda _: None)
    led = linkage.track(fibre.solutions, linkage.straight(fibre.locked, trace.locked)).arrived
    traced = trace.run(led[:14])
    assert traced.complete
    assert traced.degree == fibre.traced.degree
    distinct = DistinctSolutions(lambda solutions: linkage.features(solutions, trace.locked))
    assert distinct.add(traced.solutions) == 16
    assert distinct.add(led) == 0


def test_what_ends_in_a_double_point_is_found_there(hybrid):
    """Two solutions that meet, from values of the motors between those where they are real and complex."""
    mechanism, linkage, fibre = hybrid
    start, goal = linkage.locked_values(mechanism.q_home), 1.6 * linkage.locked_values(mechanism.q_home)
    goal[~linkage.driving] = start[~linkage.driving]

    def real(s):
        ends = path_ends(linkage, fibre.solutions, fibre.locked, start + s * (goal - start))
        return int((np.abs(ends.features.imag).max(axis=1) < 1e-6).sum())

    low, high, many = 0.0, 1.0, real(0.0)
    assert real(1.0) != many
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if real(middle) == many else (low, middle)
    for s in (low, high):
        ends = path_ends(linkage, fibre.solutions, fibre.locked, start + s * (goal - start))
        assert ends.count(ARRIVED) + ends.count(SINGULAR) == 16
        between = np.abs(ends.features[:, None] - ends.features[None]).max(axis=2) + np.eye(16)
        assert (between.min(axis=1) < 1e-4).sum() >= 2
