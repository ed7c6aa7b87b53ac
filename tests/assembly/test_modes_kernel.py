"""What assembly modes are solved with: loops in complex numbers against finite differences and the model, least squares
against numpy, the trace test against what is taken away from it."""

from __future__ import annotations

import numpy as np
import pytest
from linkages import hinge, ring, slide

import cinegen
from cinegen.assembly._kernels import ARRIVED, SINGULAR
from cinegen.assembly.endgame import path_ends
from cinegen.assembly.linkage import DistinctSolutions, FreeMotionError, Linkage
from cinegen.assembly.monodromy import Monodromy
from cinegen.assembly.trace_test import TraceTest
from cinegen.singularities.ball_joints import linkage_of


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
        found = linkage.configuration(linkage.unknowns(q), linkage.locked_values(q))
        assert found[_turns(m, q)] == pytest.approx(q[_turns(m, q)], abs=1e-12)
        slider = next(m.q_index(name) for name in m.joints if m.is_prismatic(name))
        assert found[slider] == pytest.approx(q[slider], abs=1e-12)
    assert any(np.abs(q[slider]) > 0.1 for q in m.structure.samples)


def test_the_trace_test_finds_what_is_missing(hybrid):
    """Of either of the two sets."""
    mechanism, linkage, fibre = hybrid
    home, rng = linkage.locked_values(mechanism.q_home), np.random.default_rng(3)
    trace = TraceTest(linkage, home, rng, lambda: False, lambda _: None)
    led = linkage.track(fibre.solutions, linkage.straight(fibre.locked, trace.locked)).arrived
    traced = trace.run(led[:14])
    assert traced.complete
    assert traced.degree == fibre.traced.degree
    found = DistinctSolutions(lambda solutions: linkage.features(solutions, trace.locked))
    assert found.add(traced.solutions) == 16
    assert found.add(led) == 0


def test_what_ends_in_a_double_point_is_found_there(hybrid):
    """Two solutions that meet, from values of the motors between those where they are real and complex."""
    mechanism, linkage, fibre = hybrid
    start, goal = linkage.locked_values(mechanism.q_home), 1.6 * linkage.locked_values(mechanism.q_home)
    goal[~linkage.driving] = start[~linkage.driving]

    def real(s):
        found = path_ends(linkage, fibre.solutions, fibre.locked, start + s * (goal - start))
        return int((np.abs(found.features.imag).max(axis=1) < 1e-6).sum())

    low, high, many = 0.0, 1.0, real(0.0)
    assert real(1.0) != many
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if real(middle) == many else (low, middle)
    for s in (low, high):
        found = path_ends(linkage, fibre.solutions, fibre.locked, start + s * (goal - start))
        assert found.count(ARRIVED) + found.count(SINGULAR) == 16
        between = np.abs(found.features[:, None] - found.features[None]).max(axis=2) + np.eye(16)
        assert (between.min(axis=1) < 1e-4).sum() >= 2
