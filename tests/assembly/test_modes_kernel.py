"""What assembly modes are solved with: loops in complex numbers against finite differences and the model, least squares
against numpy, the trace test against what is taken away from it."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from linkages import hinge, ring, slide

import cinegen
from cinegen.assembly._kernels.equations import evaluate
from cinegen.assembly._kernels.tables import ParameterPath
from cinegen.assembly._kernels.tracking import solve
from cinegen.assembly.distinct_solutions import DistinctSolutions
from cinegen.assembly.elimination import BITS, DegenerateError, closures
from cinegen.assembly.errors import FreeMotionError
from cinegen.assembly.linkage import ACCURACY, Linkage
from cinegen.assembly.monodromy import Monodromy
from cinegen.assembly.trace_test import TraceTest
from cinegen.balls import frame, precise
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


# --- six revolute joints ----------------------------------------------------------------------------------------------
# Closures of six revolute joints by elimination: against the loop itself, and where there is nothing to count.


RIGHT = math.pi / 2.0


def step(a, d, alpha) -> pin.SE3:
    return pin.SE3(pin.exp3(np.array([alpha, 0.0, 0.0])), np.array([a, 0.0, d]))


def turn(angle) -> pin.SE3:
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), np.zeros(3))


def closed(steps, angles) -> tuple[list[pin.SE3], np.ndarray]:
    """A loop that is closed at these angles: the last placement brings it back."""
    placement = pin.SE3.Identity()
    for k, (constant, angle) in enumerate(zip(steps, angles, strict=True)):
        placement = placement * turn(angle) * (constant if k < 5 else pin.SE3.Identity())
    return [*steps[:5], placement.inverse()], np.array(angles)


def counted(loop):
    with precise(BITS):
        return closures([frame(constant.rotation, constant.translation) for constant in loop])


def gap(loop, angles) -> float:
    placement = pin.SE3.Identity()
    for constant, angle in zip(loop, angles, strict=True):
        placement = placement * turn(angle) * constant
    return float(np.abs(placement.homogeneous - np.eye(4)).max())


def near(angles, other) -> float:
    return float(np.abs((angles - other + math.pi) % (2.0 * math.pi) - math.pi).max())


def general(rng):
    return [step(*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3.0, 3.0)) for _ in range(6)]


def almost_parallel(rng, off):
    """Joints 2, 3 and 4 of a UR, off by this much."""
    a, d = (0.0, -0.6, -0.57, 0.0, 0.0, 0.0), (0.18, 0.0, 0.0, 0.17, 0.12, 0.1)
    alpha = (RIGHT, 0.0, 0.0, RIGHT, -RIGHT, 0.0)
    return [step(*(np.array(numbers) + off * rng.normal(size=3))) for numbers in zip(a, d, alpha, strict=True)]


@pytest.mark.parametrize(("made", "seed"), [
    (general, 0), (general, 1), *(((lambda rng, off=off: almost_parallel(rng, off)), 2) for off in (
        1e-3, 1e-6, 1e-9, 1e-13))
])  # fmt: skip
def test_as_many_closures_as_real_roots_and_the_known_one_is_among_them(made, seed):
    rng = np.random.default_rng(seed)
    loop, angles = closed(made(rng), rng.uniform(-3.0, 3.0, 6))
    roots = counted(loop)
    assert len(roots.angles) == roots.real
    assert roots.real % 2 == 0
    assert max(gap(loop, solved) for solved in roots.angles) < 1e-12
    assert min(near(solved, angles) for solved in roots.angles) < 1e-10
    assert all(near(solved, other) > 1e-6 for k, solved in enumerate(roots.angles) for other in roots.angles[:k])


@settings(max_examples=10)
@given(st.integers(0, 10**6), st.floats(-10.0, -1.0), st.integers(1, 5))
def test_closures_do_not_depend_on_where_the_loop_begins(seed, exponent, first):
    rng = np.random.default_rng(seed)
    loop, angles = closed(almost_parallel(rng, 10.0**exponent), rng.uniform(-3.0, 3.0, 6))
    roots, turned = counted(loop), counted([*loop[first:], *loop[:first]])
    assert roots.real == turned.real
    assert min(near(solved, angles) for solved in roots.angles) < 1e-6
    for solved in roots.angles:
        assert min(near(np.roll(solved, -first), other) for other in turned.angles) < 1e-6


def test_a_loop_that_can_not_be_closed_has_no_real_root():
    rng = np.random.default_rng(0)
    loop, _ = closed(general(rng), rng.uniform(-3.0, 3.0, 6))
    loop[5].translation = np.array([50.0, 0.0, 0.0])
    assert counted(loop).real == len(counted(loop).angles) == 0


def test_axes_that_are_exactly_special_are_not_counted():
    rng = np.random.default_rng(1)
    loop, _ = closed(almost_parallel(rng, 0.0), rng.uniform(-3.0, 3.0, 6))
    with pytest.raises(DegenerateError):
        counted(loop)


def test_a_loop_whose_first_and_last_axis_are_one_line_turns_about_it_and_is_not_counted():
    rng = np.random.default_rng(2)
    steps = general(rng)
    loop, angles = closed(steps, rng.uniform(-3.0, 3.0, 6))
    loop[5] = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.4]))
    inner = pin.SE3.Identity()
    for constant, angle in zip(loop[1:5], angles[1:5], strict=True):
        inner = inner * turn(angle) * constant
    loop[0] = (inner * loop[5]).inverse()
    assert gap(loop, [0.7, *angles[1:5], -0.7]) < 1e-12
    with pytest.raises(DegenerateError):
        counted(loop)


def test_two_closures_that_coincide_are_both_found_though_rounding_may_make_them_complex():
    """At angles of 0 all axes are at right angles to x, about which nothing rotates: a singularity."""
    loop, angles = closed(general(np.random.default_rng(3)), np.zeros(6))
    roots = counted(loop)
    assert sum(near(solved, angles) < 1e-6 for solved in roots.angles) == 2
