"""What is held clear stays clear, on all of its way; and moves as freely as that allows."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from clearings import among, around, at, ball, point_among, wall
from hypothesis import given, settings
from hypothesis import strategies as st
from ticking import away, ticked

from cinegen import Solver, Status
from cinegen.collision import PlanningError
from cinegen.ik import Posture
from cinegen.planning.clearance_barrier import STOP, ClearanceBarrier, is_clear, path_clearance

DT = 0.01
EXACT = 3e-6  # m: as exact as distances to hulls and cylinders are
seeds = st.integers(0, 2**32 - 1)


def kept(clearance, safety, q=None, **options):
    solver = Solver(clearance.mechanism, DT, q, **options)
    solver.barriers = [ClearanceBarrier(clearance, safety)]
    return solver


def densely(clearance, path, count=9):
    """m: the least distance at many configurations of a path."""
    model = clearance.mechanism.model
    between = (pin.interpolate(model, *ends, t) for ends in pairwise(path) for t in np.linspace(0.0, 1.0, count))
    return min(map(clearance.least, between))


# --- never nearer ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["planar_3r", "arm7", "five_bar", "delta4"])
@settings(max_examples=20)
@given(
    seed=seeds,
    accelerated=st.booleans(),
    every=st.sampled_from([1, 15, 200]),
    wishing=st.booleans(),
    rotation=st.sampled_from([0, 3]),
)
def test_whatever_leads_it_nothing_comes_nearer_than_the_safety_distance(
    robot, name, seed, accelerated, every, wishing, rotation
):
    """Targets that stand, leap now and then, or in every tick, near and ten lengths away."""
    mechanism, rng = robot(name), np.random.default_rng(seed)
    self_checked = name in ("arm7", "planar_3r")
    clearance = among(name, around(name, seed % 7), self_pairs=self_checked)
    safety = min(0.02 * mechanism.length, 0.5 * clearance.least(mechanism.q_home))
    solver = kept(clearance, safety, acceleration=20.0 if accelerated else None)
    if wishing:
        aim = mechanism.close(mechanism.q_home + 0.3 * rng.normal(size=mechanism.model.nq))
        solver.objectives = [Posture(aim, rate=5.0)]
    node = mechanism.nodes[-1]
    task = solver.add_task(node, rotation=rotation)
    path = [solver.q]
    for tick in range(25 if name == "delta4" else 60):
        if tick % every == 0:
            task.target = away(mechanism, node, rng, float(rng.choice([0.3, 1.0, 10.0])))
        step = solver.step()
        assert step.closure <= 1e-9
        path.append(step.q)
    if not mechanism.is_constrained:
        assert densely(clearance, path, 4) >= safety - EXACT
    assert min(clearance.least(q) for q in path) >= safety - EXACT
    assert path_clearance(clearance, np.array(path), 0.05) >= (1.0 - 0.05) * safety - EXACT
    assert np.abs(path[-1] - path[0]).max() > 1e-3


# --- and as near to the target as that allows ----------------------------------------------------------------------


@settings(max_examples=40)
@given(seed=seeds)
def test_along_a_wall_a_point_goes_to_the_nearest_point_to_its_target(seed):
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0.0, 2.0 * np.pi)
    normal = np.array([np.cos(turn), np.sin(turn), 0.0])
    clearance = point_among([wall(normal, -0.3)])
    solver = kept(clearance, 0.05)
    target = np.append(rng.uniform(-1.5, 1.5, 2), 0.0)
    solver.add_task("mobile", at(*target), translation=2, rotation=0, axes="world")
    step = ticked(solver, 200)
    beyond = max(STOP * 0.05 - 0.3 - normal @ target, 0.0)
    assert np.append(step.q, 0.0) == pytest.approx(target + beyond * normal, abs=1e-6)
    assert step.status is (Status.BARRED if beyond > 1e-5 else Status.FOLLOWING)
    assert bool(step.active_barriers) == (beyond > 1e-5)


# --- what is too near already --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("led", "deep"), [("not", -0.04), ("in", -0.04), ("in", 0.01), ("out", 0.03), ("there", 0.03)])
def test_what_an_obstacle_was_put_onto_only_goes_away(led, deep):
    """And gets away, whether it is pulled or not."""
    clearance = point_among([ball(0.1, 3.0, 0.0, 0.0)])
    solver = kept(clearance, 0.05)
    targets = {"in": at(0.3, 0.0, 0.0), "out": at(-1.0, 0.2, 0.0), "there": at(0.0, 0.0, 0.0)}
    if led in targets:
        solver.add_task("mobile", targets[led], translation=2, rotation=0, axes="world")
    solver.step()
    solver.q = np.zeros(2)
    clearance.move(0, at(0.1 + deep, 0.0, 0.0))
    last = clearance.least(solver.q)
    assert last == pytest.approx(deep, abs=1e-9)
    for _ in range(60):
        now = clearance.least(solver.step().q)
        assert now >= min(last, 0.05) - 1e-12
        last = now
    assert last >= 0.05


def past_a_ball(begin, least):
    """A clearance, and the two ends of a straight path past a ball on which a point is `begin` (m) from its surface at
    both ends and `least` (m) halfway, by Pythagoras."""
    height = 0.1 + least
    aside = np.sqrt((0.1 + begin) ** 2 - height**2)
    clearance = point_among([ball(0.1, 0.0, -height, 0.0)])
    return clearance, np.array([-aside, 0.0]), np.array([aside, 0.0])


@pytest.mark.parametrize("begin", [1e-4, 0.04])
@pytest.mark.parametrize("part", [-1.0, 0.0, 0.45])
def test_a_path_on_which_what_is_too_near_comes_much_nearer_still_is_not_clear(begin, part):
    """Though it ends as far away as it began."""
    clearance, first, last = past_a_ball(begin, part * begin)
    assert clearance.least(first) == pytest.approx(begin, abs=1e-9)
    assert clearance.least(last) == pytest.approx(begin, abs=1e-9)
    assert clearance.least(np.zeros(2)) == pytest.approx(part * begin, abs=1e-9)
    assert not is_clear(clearance, first, last, 0.05)
    assert is_clear(clearance, first, 1.5 * first, 0.05), "it may go away"


@pytest.mark.parametrize("name", ["arm7", "planar_3r", "delta4"])
@settings(max_examples=16)
@given(seed=seeds, accelerated=st.booleans())
def test_a_robot_that_an_obstacle_was_put_near_goes_away_from_it(robot, name, seed, accelerated):
    """At the speed of its joints, which is far less than what would do at once."""
    mechanism, rng = robot(name), np.random.default_rng(seed)
    far = 10.0 * mechanism.length
    clearance = among(name, [ball(0.1 * mechanism.length, far, far, far)], self_pairs=False)
    safety = 0.05 * mechanism.length
    solver = Solver(mechanism, 1e-3, acceleration=50.0 if accelerated else None)
    solver.barriers = [ClearanceBarrier(clearance, safety)]
    node = mechanism.nodes[-1]
    if rng.random() < 0.7:
        solver.add_task(node, away(mechanism, node, rng, 0.5), rotation=0)
    link = int(rng.choice(np.flatnonzero([b.joint > 0 for b in clearance.bodies[:-1]])))
    place = clearance.bodies[link]
    clearance.update(mechanism.q_home)
    middle = clearance._data.oMi[place.joint].act(place.centre)
    aside = rng.normal(size=3) * (1.0, 1.0, 0.0 if name == "planar_3r" else 1.0)
    aside /= np.linalg.norm(aside)
    reach = place.radius + 0.1 * mechanism.length
    clearance.move(0, at(*(middle + aside * reach)))
    before = clearance.distances(mechanism.q_home)
    for _ in range(40):
        last = clearance.distances(solver.q)
        now = clearance.distances(solver.step().q)
        assert (now >= np.minimum(last - 1e-9, safety - EXACT)).all()
    near = clearance.near(mechanism.q_home, before.min() + 1e-9)
    parted = np.abs(near.rows).max(initial=0.0) > 0.1 * mechanism.length  # joints can part them
    alone = (before < STOP * safety).sum() == 1  # others may stand in the way
    if before.min() < 0.8 * safety and parted and alone and not accelerated:
        assert now.min() > before.min()


# --- all along a way -----------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(seed=seeds, size=st.sampled_from([0.02, 0.3, 2.0]))
def test_a_way_is_clear_only_where_nothing_on_it_is_too_near(robot, seed, size):
    mechanism, rng = robot("arm7"), np.random.default_rng(seed)
    clearance = among("arm7", around("arm7", seed % 5), self_pairs=False)
    q = mechanism.q_home + 0.5 * rng.normal(size=7)
    to = q + size * rng.normal(size=7)
    least = densely(clearance, [q, to], 60)
    for safety in (0.3 * abs(least), 0.999 * abs(least), 1.1 * abs(least) + 0.01):
        if clearance.least(q) < safety:
            continue
        if is_clear(clearance, q, to, safety):
            assert least >= safety - EXACT
        elif size < 0.1:  # and where there is room enough it says so
            assert least < 1.05 * safety + 1e-3


@settings(max_examples=60)
@given(seed=seeds, size=st.sampled_from([0.02, 0.3, 1.0]), sharp=st.sampled_from([0.01, 0.05, 0.3]))
def test_the_least_along_a_path_is_below_what_is_seen_on_it_and_hardly_so(robot, seed, size, sharp):
    mechanism, rng = robot("planar_3r"), np.random.default_rng(seed)
    clearance = among("planar_3r", around("planar_3r", seed % 5), self_pairs=False)
    path = mechanism.q_home + np.cumsum(size * rng.normal(size=(6, 3)), axis=0)
    seen, bound = densely(clearance, path, 200), path_clearance(clearance, path, sharp)
    assert bound <= max(seen, 0.0) + EXACT
    if seen > 0.02 * mechanism.length:
        assert bound >= (1.0 - sharp) * seen - 1e-3 * size - EXACT
    if bound < 0.0:
        assert seen < 1e-3


@pytest.mark.parametrize(("safety", "rate"), [(-0.1, 1.0), (np.nan, 1.0), (np.inf, 1.0), (0.1, 0.0), (0.1, np.nan)])
def test_safety_distances_and_rates_that_make_no_sense_are_refused(safety, rate):
    with pytest.raises(PlanningError, match="the rate of approach" if safety == 0.1 else "the safety distance is"):
        ClearanceBarrier(point_among([]), safety, rate)


def test_what_held_is_told_by_pair_and_stays_when_somebody_looks_elsewhere():
    clearance = point_among([ball(0.1, 3.0, 0.0, 0.0), ball(0.1, 0.3, 0.0, 0.0)])
    solver = kept(clearance, 0.05)
    keep = solver.barriers[0]
    solver.add_task("mobile", at(1.0, 0.0, 0.0), translation=2, rotation=0, axes="world")
    step = ticked(solver, 30)
    held = [clearance.names(int(keep.pairs[row]))[1] for row in step.active_barriers]
    assert held == ["ball"]
    assert keep.pairs[step.active_barriers[0]] == 1
    clearance.near(np.array([3.0, 0.3]), 0.5)
    assert keep.pairs[step.active_barriers[0]] == 1
