"""Loops that are redundant but for rounded numbers: they are recognised, and healed or relaxed."""

from __future__ import annotations

import copy
from collections import Counter
from itertools import product
from pathlib import Path

import mechanisms
import numpy as np
import pinocchio as pin
import pytest
from rounding import largest_change, rounded
from variants import slow

import cinegen
import raff2urdf
from cinegen.ik.step import Status
from cinegen.loops.clusters import subsystems
from cinegen.model.healing import by_geometry, moved, twists_of
from cinegen.model.intended import errors, relations
from cinegen.model.load import build
from raff2urdf.conversion import describe
from raff2urdf.near_redundancy import near_redundancy

MINITAUR = Path(__file__).parents[1] / "model/data/minitaur/minitaur_constrained.sdf"
LEGS = tuple(f"lower_leg_{end}_{side}_link" for end in ("front", "back") for side in ("leftL", "rightL"))
MOTORS = {str(i) for i in range(8)}

EXACT = {  # text, mobility
    "four_bar": (mechanisms.four_bar(2), 1),
    "four_bar_rigid": (mechanisms.four_bar(rigid=True), 1),
    "parallelogram": (mechanisms.parallelogram(1), 1),
    "five_bar": (mechanisms.five_bar(1), 2),
    "hexagon": (mechanisms.polygon(6, 2), 3),
    "3rrr": (mechanisms.planar_3rrr(), 3),
    "sarrus": (mechanisms.sarrus(2), 1),
    "sarrus_rigid": (mechanisms.sarrus(rigid=True), 1),
    "bennett": (mechanisms.bennett(), 1),
}


def described(text):
    document = raff2urdf.loads(text)
    return describe(document, document.robot(None), Path())


@pytest.fixture(scope="module")
def minitaur():
    with pytest.warns(cinegen.CinegenWarning, match="nearly redundant") as warned:
        mechanism = cinegen.load(MINITAUR)
    return mechanism, [str(one.message) for one in warned]


@pytest.fixture(scope="module")
def relaxed():
    with pytest.warns(cinegen.CinegenWarning, match="nearly redundant"):
        return cinegen.load(MINITAUR, relax=True)


def dragged(mechanism, nodes, ticks, size, seed=0, hold=25):
    """Statuses and the largest closure while nodes follow random targets around where they are at home."""
    solver, rng = cinegen.Solver(mechanism, dt=0.001), np.random.default_rng(seed)
    tasks = [solver.add_task(node) for node in nodes]
    homes = [pin.SE3(task.target) for task in tasks]
    statuses, closure = Counter(), 0.0
    for k in range(ticks):
        if k % hold == 0:
            for task, home in zip(tasks, homes, strict=True):
                target = pin.SE3(home)
                target.translation = target.translation + size * rng.normal(size=3)
                task.target = target
        step = solver.step()
        statuses[step.status] += 1
        closure = max(closure, step.closure)
    return statuses, closure


# --- Minitaur: its hips are tilted by 4.6e-5 rad, and its poses are rounded to 1e-6 m and 1e-6 rad ------------------


def test_one_warning_names_loops_gaps_and_what_is_done(minitaur):
    _, (message,) = minitaur
    for side in ("front_left", "front_right", "back_left", "back_right"):
        assert f"loop 'constraint_{side}' (revolute) by 0.00" in message
    assert message.count("mm and") == 8
    assert message.count("healed: placements changed by up to") == 4


def test_each_leg_is_a_five_bar_with_two_motors(minitaur):
    mechanism, _ = minitaur
    assert mechanism.mobility == 8  # 24 joints; of each leg's five rows, the one along the hinge is redundant
    assert set(mechanism.actuated) == MOTORS
    assert {loop.kind.name for loop in mechanism.loops} == {"REVOLUTE"}
    for own, at in subsystems(mechanism.own_system()):
        assert near_redundancy(own, mechanism.q_home[at]) is None


def test_relaxed_legs_also_swing_sideways(relaxed):
    assert {loop.kind.name for loop in relaxed.loops} == {"BALL"}
    assert relaxed.mobility == 12  # of each leg's six joints three are determined: the knees are universal joints


def test_as_written_nearly_nothing_moves():
    mechanism = cinegen.load(MINITAUR, relax=False)
    statuses, _ = dragged(mechanism, LEGS, 100, 0.05)
    assert mechanism.mobility < 8
    assert statuses[Status.REFUSED] > 50


@pytest.mark.parametrize("nodes", [LEGS[:1], LEGS])
@pytest.mark.parametrize("size", [0.1, *slow(0.01)])
@pytest.mark.parametrize("remedy", ["minitaur", "relaxed"])
def test_no_tick_is_refused(remedy, nodes, size, request):
    found = request.getfixturevalue(remedy)
    mechanism = found if remedy == "relaxed" else found[0]
    statuses, closure = dragged(mechanism, nodes, 3000, size, seed=len(nodes))
    assert statuses[Status.REFUSED] == 0
    assert closure <= 1e-10


def test_the_healed_geometry_is_that_of_another_process(minitaur):
    mechanism, _ = minitaur
    again = copy.deepcopy(mechanism)
    np.testing.assert_array_equal(again.q_home, mechanism.q_home)
    assert again.mobility == mechanism.mobility


# --- others ----------------------------------------------------------------------------------------------------------


DIGITS = (3, 4, 6, 9)
FEW = [("four_bar", 3), ("3rrr", 4), ("sarrus", 6), ("bennett", 3)]


@pytest.mark.parametrize(
    ("name", "digits"), [*FEW, *slow(*(pair for pair in product(EXACT, DIGITS) if pair not in FEW))]
)
def test_rounded_mechanisms_are_healed(name, digits, recwarn):
    text, mobility = EXACT[name]
    urdf, constraints = described(text)
    for seed in (1, 2):
        written = rounded(urdf, constraints, digits, seed)
        with pytest.warns(cinegen.CinegenWarning, match="healed"):
            mechanism = build(*written, relax=None)
        assert mechanism.mobility == mobility
        assert largest_change(written[0], mechanism.source.urdf) < 4.0 * 10.0**-digits
        statuses, closure = dragged(mechanism, [mechanism.end], 300, 0.1 * mechanism.length, seed)
        assert statuses[Status.REFUSED] == 0
        assert closure <= 1e-10


@pytest.mark.parametrize("name", EXACT)
def test_exact_mechanisms_stay_as_they_are(name, recwarn):
    urdf, constraints = described(EXACT[name][0])
    mechanism = build(urdf, constraints, relax=None)
    assert mechanism.source.urdf == urdf
    assert not [one for one in recwarn if "redundant" in str(one.message)]


def test_a_gap_that_is_no_rounding_is_an_error():
    urdf, constraints = described(mechanisms.four_bar(2))
    constraints["loops"][0]["first"]["placement"][2][3] += 0.1
    with pytest.raises(cinegen.ClosureError):
        build(urdf, constraints, relax=None)


@pytest.mark.parametrize("name", ["sarrus", "3rrr", "bennett"])
def test_derivatives_by_the_geometry_are_those_of_differences(name):
    mechanism = build(*described(EXACT[name][0]))
    system, rng = mechanism.own_system(), np.random.default_rng(0)
    count, twists = mechanism.model.njoints - 1, twists_of(system)
    step = 1e-6 * rng.normal(size=(twists, 6))
    step[count : 2 * count] = 0.0  # bodies behind joints: `moved` leaves them
    q = system.integrate(mechanism.q_home, 0.1 * rng.normal(size=mechanism.model.nv))
    ahead, back = moved(system, step.ravel()), moved(system, -step.ravel())
    system.evaluate(q)
    change = (ahead.evaluate(q)[0] - back.evaluate(q)[0]) / 2.0
    np.testing.assert_allclose(by_geometry(system) @ step.ravel(), change, atol=1e-11)
    wanted = relations(system)
    change = (errors(ahead, wanted, twists)[0] - errors(back, wanted, twists)[0]) / 2.0
    np.testing.assert_allclose(errors(system, wanted, twists)[1] @ step.ravel(), change, atol=1e-11)


def test_loops_that_no_joint_can_open_are_not_nearly_redundant():
    class Rigid:
        def evaluate(self, q):
            return np.zeros(6), np.zeros((6, len(q)))

        def integrate(self, q, step):
            return q + step

    assert near_redundancy(Rigid(), np.zeros(0)) is None
    assert near_redundancy(Rigid(), np.zeros(2)) is None
