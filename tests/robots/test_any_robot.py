"""Mechanisms that nobody drew: random trees, random loops, and linkages whose mobility is known by other means."""

import math

import making
import numpy as np
import pytest
from hand import DT, check
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from ticking import ticked

import cinegen
import raff2urdf
from raff2urdf.loops.mobility import analyse

SEEDS = st.integers(0, 2**32 - 1)


def load(text: str) -> cinegen.Mechanism:
    return cinegen.load(f"RAFF any\n{text}")


def converted(text: str) -> int:
    """The mobility that the converter counts, without Pinocchio."""
    document = raff2urdf.loads(f"RAFF any\n{text}")
    return analyse(document, document.robot()).mobility


def loaded(mechanism: making.Mechanism, digits: int | None = 6) -> cinegen.Mechanism:
    """As a file that says so many digits of it; all of the geometry, where a rounded one could not be assembled."""
    overconstrained = len(mechanism.constraint_rows()) > np.count_nonzero(mechanism.singular_values() > 1e-6)
    return load(mechanism.text(digits=None if overconstrained else digits))


# --- loops -------------------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(SEEDS)
def test_random_loops_leave_the_mobility_that_screw_theory_says(seed):
    """One to four loops, coupled or not, between links, frames and the base, closed as rigid, prismatic, revolute and
    ball; the file's numbers rounded wherever a rounded mechanism still can be assembled."""
    rng = np.random.default_rng(seed)
    loops = int(rng.integers(1, 5))
    mechanism = making.graph(rng, int(rng.integers(2, 7 * loops + 3)), loops)
    mobility = mechanism.mobility()
    assume(mobility is not None)
    if seed % 2:
        mechanism = mechanism.moved(making.somewhere(rng, 3.0))
    built = loaded(mechanism)
    assert built.closure(built.q_home) <= 1e-12
    assert built.mobility == mobility
    assert len(built.actuated) == mobility


@settings(max_examples=20)
@given(SEEDS)
def test_platforms_on_legs_have_the_mobility_of_gruebler_and_kutzbach(seed):
    """M = (freedoms of all joints) - 6 (legs - 1), for whatever legs, cut anywhere, in any unit, written with rounded
    numbers: generic geometry is never overconstrained."""
    rng = np.random.default_rng(seed)
    words = [
        ["UPS", "RUS", "PUS"],
        ["RRS", "PRS", "RPS"],
        ["SPS", "RSS", "UPS"],
        ["UPS", "RUS", "PUS", "RRS", "RPS", "RSR", "RRRRR", "UPU", "SPS", "UPRR"],
    ][int(rng.integers(4))]
    legs = [str(rng.choice(words)) for _ in range(int(rng.integers(2, 7)))]
    expected = sum({"R": 1, "P": 1, "U": 2, "S": 3}[letter] for word in legs for letter in word) - 6 * (len(legs) - 1)
    mechanism = making.platform(rng, legs, str(rng.choice(["rigid", "joint"])))
    sigma = mechanism.singular_values()
    assume(mechanism.mobility() == max(0, expected))
    assume(not ((sigma > 1e-9) & (sigma < 0.02)).any())  # well away from singularities
    built = loaded(mechanism, digits=5)
    assert built.closure(built.q_home) <= 1e-12
    assert built.mobility == max(0, expected)


@pytest.mark.parametrize(("body", "mobility"), [
    pytest.param("link 1 { parameters { alpha 30 d 100 theta 10 } type 2 pred 0 }"
        "link 2 { parameters { alpha 90 d 500 theta 20 } type 2 pred 1 } frame 3 { parameters { r 300 } pred 2 }"
        "frame 4 { parameters { alpha 90 d 500 r 300 } pred 1 } constraint { frame 3 frame 4 type 2 }", 2,
        id="a door on two hinges"),
    pytest.param("link 1 { parameters { d 100 theta 5 } type 2 pred 0 } frame 2 { parameters { d 100 } pred 0 }"
        "constraint { link 1 frame 2 type 2 }", 1, id="a single joint and its double"),
    pytest.param("link 1 { parameters { d 100 } type 2 pred 0 } link 2 { parameters { d 100 } type 2 pred 0 }"
        "constraint { link 1 link 2 } constraint { link 1 link 2 }", 1, id="the same loop twice"),
])  # fmt: skip
def test_small_and_odd_loops_are_counted_right(body, mobility):
    text = f"robot r {{ {body} }}"
    assert converted(text) == mobility
    mechanism = load(text)
    assert mechanism.mobility == mobility
    assert len(mechanism.actuated) == mobility
    end = mechanism.nodes[-1]
    assert mechanism.jacobian(mechanism.q_home, end).shape == (6, mechanism.model.nv)
    solver = cinegen.Solver(mechanism, DT)
    solver.add_task(end, translation=3, rotation=0).target.translation += 0.01
    for _ in range(20):
        check(mechanism, solver.q.copy(), solver.step())


FIXED_LINK = "link 1 { parameters { d 100 } type 0 pred 0 }"


@pytest.mark.parametrize("body", [
    "",
    f"{FIXED_LINK} frame 2 {{ pred 1 }}",
    f"{FIXED_LINK} frame 2 {{ parameters {{ d 100 }} pred 0 }} constraint {{ link 1 frame 2 }}",
])  # fmt: skip
def test_robots_without_joints_stand_still(body):
    mechanism = load(f"robot r {{ {body} }}")
    solver = cinegen.Solver(mechanism, 0.01)
    solver.add_task(mechanism.nodes[-1]).target.translation += 1.0
    assert mechanism.mobility == len(solver.step().q) == 0
    assert mechanism.jacobian(mechanism.q_home, mechanism.nodes[-1]).shape == (6, 0)


# --- what does not matter ----------------------------------------------------------------------------------------


def any_closed(rng: np.random.Generator) -> making.Mechanism:
    """A mechanism with loops and a tool."""
    makers = [
        lambda: making.platform(rng, ["UPS", "RUS", "PUS"], str(rng.choice(["rigid", "joint"]))),
        lambda: making.platform(rng, ["RPS", "RRS", "PRS"], "joint"),
        lambda: making.platform(rng, ["UPU"] * 3),
        lambda: making.parallelograms(rng, 3, 3),
        lambda: making.ring([making.somewhere(rng) for _ in range(8)], None, int(rng.integers(8))),
        lambda: making.ring(making.sarrus(rng), None, int(rng.integers(6))),
        lambda: making.ring(making.bennett(rng), None, int(rng.integers(4))),
        lambda: making.ring(making.planar(rng.normal(size=(6, 2)))),
    ]
    return makers[int(rng.integers(len(makers)))]()


@settings(max_examples=15)
@given(SEEDS, st.sampled_from([1e-9, 1e-6, 1e-3, 1e3, 1e6]))
def test_a_robot_of_micrometres_moves_like_its_twin_of_metres(seed, factor):
    mechanism = any_closed(np.random.default_rng(seed))
    sigma = mechanism.singular_values()
    assume(not ((sigma > 1e-9) & (sigma < 0.05)).any())  # well away from singularities
    original = load(mechanism.text(joint_digits=None))
    other = load(mechanism.scaled(factor).text(joint_digits=None, units="um" if factor < 1.0 else "m"))
    assert other.length == pytest.approx(factor * original.length, rel=1e-12)
    solvers = [cinegen.Solver(each, DT) for each in (original, other)]
    tasks = [solver.add_task("tool", rotation=0) for solver in solvers]
    rng = np.random.default_rng(seed)
    for tick in range(40):
        if tick % 20 == 0:
            away = rng.normal(size=3)
            for task, each in zip(tasks, (original, other), strict=True):
                task.target.translation = each.placement(each.q_home, "tool").translation + 0.3 * each.length * away
        steps = [solver.step() for solver in solvers]
        assert steps[0].status is steps[1].status
        assert steps[1].q / other.scale == pytest.approx(steps[0].q / original.scale, abs=1e-5)


# --- driving them ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("closed_to_a_ring", [False, True])
def test_chains_of_many_joints_load_close_and_follow(closed_to_a_ring):
    count, rng = 60, np.random.default_rng(60)
    around = np.linspace(0.0, 1.8 * math.pi, count)
    axes = [making.axis((math.cos(t), math.sin(t), 0.1 * t), making.direction(rng)) for t in around]
    bodies = [making.Body(i + 1, i, place) for i, place in enumerate(axes)]
    chain = making.Mechanism((*bodies, making.Body(making.TOOL, count, axes[-1], None, 'name "tool"')))
    mechanism = loaded(making.ring(axes) if closed_to_a_ring else chain)
    assert mechanism.mobility == count - 6 * closed_to_a_ring
    solver = cinegen.Solver(mechanism, dt=1.0)
    solver.add_task("tool").target.translation += np.array([0.1, 0.2, 0.1])
    metres, angle = ticked(solver, 300).errors[0]
    assert max(metres / mechanism.length, angle) <= 1e-9
