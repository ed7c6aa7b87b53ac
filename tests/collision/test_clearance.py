"""Distances to what is around a mechanism: here, how joints shorten them, and all along a motion."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from clearings import among, around, at, ball, measured, obstacles_of, point_among, some, wall, within_limits
from hypothesis import given, settings
from hypothesis import strategies as st
from repository import load

from cinegen.collision import PlanningError
from cinegen.collision.body import Body
from cinegen.collision.clearance import Clearance
from cinegen.collision.mobile_robot import mobile_body as body
from cinegen.collision.mobile_robot import mobile_robot as mobile
from cinegen.jit import foreign
from cinegen.planning.vortices import Vortices

seeds = st.integers(0, 2**32 - 1)
ROBOTS = ["arm7", "two_arms", "delta4"]

KINDS = {
    "turn": pin.JointModelRZ,
    "slide": pin.JointModelPX,
    "ball": pin.JointModelSpherical,
    "free": pin.JointModelFreeFlyer,
    "planar": pin.JointModelPlanar,
    "any way": lambda: pin.JointModelRevoluteUnaligned(np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)),
    "without end": pin.JointModelRUBY,
}


class Tree:
    """As much of a mechanism as `Clearance` asks for: a tree of joints."""

    def __init__(self):
        self.model, self.length, self.loops = pin.Model(), 1.0, ()

    @property
    def scale(self):
        return np.ones(self.model.nv)

    def difference(self, start, end):
        return pin.difference(self.model, start, end)


def boat():
    """What moves freely."""
    tree = Tree()
    tree.model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    return tree


def random_tree(rng, count):
    tree = Tree()
    for k in range(count):
        kind = KINDS[str(rng.choice(list(KINDS)))]
        parent = 0 if k == 0 else int(rng.integers(max(0, k - 1), k + 1))
        place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3) * 0.4)
        tree.model.addJoint(parent, kind(), place, f"joint{k}")
    return tree


SHAPES = (coal.Capsule(0.05, 0.4), coal.Box(0.1, 0.4, 0.2), coal.Cylinder(0.1, 0.5), coal.Sphere(0.1))


def random_scene(rng, shapes=SHAPES):
    """A tree, its bodies, obstacles with a wall below, and all pairs of bodies."""
    tree = random_tree(rng, int(rng.integers(1, 6)))
    bodies = []
    for j in range(1, tree.model.njoints):
        place = pin.SE3(pin.exp3(rng.normal(size=3)), 0.3 * rng.normal(size=3))
        bodies.append(Body(f"link{j}", j, place, shapes[rng.integers(len(shapes))]))
    places = (pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3)) for _ in range(3))
    obstacles = [some(kind, place, 0.3) for kind, place in zip(("ball", "box", "capsule"), places, strict=True)]
    self_pairs = [(i, k) for k in range(len(bodies)) for i in range(k)]
    return tree, bodies, obstacles_of([*obstacles, wall([0.0, 0.0, 1.0], -1.0)]), self_pairs


def configuration(name, rng):
    return load(name).q_home + rng.uniform(-0.3, 0.3, load(name).model.nq) * load(name).scale


# --- distances ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ROBOTS)
def test_distances_are_those_that_coal_measures_between_bodies_where_their_joints_are(name):
    clearance, rng = among(name, around(name, 3)), np.random.default_rng(0)
    for _ in range(5):
        q = configuration(name, rng)
        assert clearance.distances(q) == pytest.approx(measured(clearance, q), abs=3e-6)  # as exact as hulls are
        assert clearance.least(q) == clearance.distances(q).min()


def test_where_coal_keeps_results_elsewhere_they_are_copied(monkeypatch):
    obstacles, rng = around("arm7", 1), np.random.default_rng(1)
    usual = among("arm7", obstacles)
    usual.distances(load("arm7").q_home)
    odd = iter(range(10**6))
    monkeypatch.setattr(foreign, "address", lambda array, of=foreign.address: of(array) + 8 * (next(odd) % 64))
    clearance = among("arm7", obstacles)
    clearance.distances(load("arm7").q_home)
    monkeypatch.undo()
    for made, is_in_place in ((usual, True), (clearance, False)):
        kinematics = made._kinematics
        in_place = made.results.is_in_place, kinematics.frames_in_place, kinematics.screws_in_place
        assert in_place == (is_in_place,) * 3
    for _ in range(5):
        q, to = within_limits("arm7", rng), within_limits("arm7", rng)
        assert (clearance.distances(q) == usual.distances(q)).all()
        near, other = clearance.near(q, 0.3), usual.near(q, 0.3)
        assert (near.pairs == other.pairs).all()
        assert (near.rows == other.rows).all()
        assert np.array_equal(clearance.motion_bounds(q, to), usual.motion_bounds(q, to))


def test_without_obstacles_nothing_is_near():
    clearance = Clearance(mobile(), [body(0.1)], [])
    q = np.zeros(2)
    assert clearance.least(q) == np.inf
    assert clearance.near(q, 1.0).rows.shape == (0, 2)
    assert all(array.shape == (0,) for array in clearance.motion_bounds(q, q + 1.0))
    vortices = Vortices(clearance, 1.0, 0.1)
    assert (vortices.deflect(q, np.ones(2), frozenset) == 1.0).all()
    assert len(vortices.states) == 0


def test_a_robot_without_joints_meets_nothing(raff):
    stone = raff("robot r { base { } }")
    base = Body("base", 0, at(0, 0, 0), coal.Sphere(0.1))
    clearance = Clearance(stone, [base], obstacles_of([ball(0.1, 0.0, 0.0, 0.0)]))
    q = stone.q_home
    assert clearance.least(q) == np.inf
    assert clearance.near(q, 1.0).rows.shape == (0, 0)
    assert clearance.motion_bounds(q, q)[0].shape == (0,)


@pytest.mark.parametrize("shape", [coal.Halfspace(np.array([1.0, 0.0, 0.0]), 0.0), coal.Plane(np.eye(3)[0], 0.0)])
def test_a_link_without_end_is_refused(shape):
    endless = Body("endless", 2, at(0, 0, 0), shape)
    with pytest.raises(PlanningError, match="'endless' moves and is unbounded"):
        Clearance(mobile(), [endless], [])


# --- what is near ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ROBOTS)
def test_rows_of_nearest_points_are_how_distances_change(name):
    """By central differences of coal's distances, where these are smooth: the nearest points stay where they are."""
    clearance, rng = among(name, around(name, 7)), np.random.default_rng(7)
    nv, step, checked = load(name).model.nv, 1e-5, 0
    for _ in range(4):
        q = configuration(name, rng)
        near = clearance.near(q, 3.0 * load(name).length)
        pairs, distances, rows = near.pairs.copy(), near.distances.copy(), near.rows.copy()
        at_q = clearance.distances(q)
        slopes = np.zeros((len(clearance.pairs), nv))
        curved = np.zeros(len(clearance.pairs))
        for j in range(nv):
            way = step * np.eye(nv)[j]
            ahead, behind = (clearance.distances(pin.integrate(load(name).model, q, s * way)) for s in (1.0, -1.0))
            slopes[:, j] = (ahead - behind) / (2.0 * step)
            curved = np.maximum(curved, np.abs(ahead + behind - 2.0 * at_q) / step)
        for pair, i in zip(*np.unique(near.pairs, return_index=True), strict=True):  # the first: the nearest points
            assert pairs[i] == pair
            assert distances[i] == at_q[pair]
            shapes = {type(clearance.bodies[int(b)].shape) for b in clearance.pairs[pair]}
            if clearance.memory.excess[pair] != 0.0:  # not of these shapes: in test_exact_distances, as exactly
                continue
            if at_q[pair] < 1e-3 or curved[pair] > 0.01 or not shapes <= {coal.Capsule, coal.Sphere, coal.Box}:
                continue
            assert rows[i] == pytest.approx(-slopes[pair], abs=2e-4 * load(name).length), clearance.names(pair)
            checked += 1
    assert checked > 20


def test_however_much_is_near_none_of_it_is_left_out():
    obstacles = [ball(0.01, 0.5 + 1e-3 * i, 0.4, 0.0) for i in range(400)] + [ball(0.1, 0.2, 0.0, 0.0)]
    clearance = point_among(obstacles)
    near = clearance.near(np.zeros(2), 2.0)
    assert sorted(near.pairs) == list(range(401))
    assert near.distances.min() == pytest.approx(0.1)
    arm = among("arm7", around("arm7", 4, count=12))
    near = arm.near(load("arm7").q_home, 100.0)
    assert set(near.pairs.tolist()) == set(range(len(arm.pairs)))
    assert len(near.pairs) > 2 * len(arm.pairs)


@settings(max_examples=60)
@given(seed=seeds)
def test_a_motion_that_keeps_all_rows_of_a_link_keeps_its_distance(seed):
    """To second order; also one in which the nearest point leaps from one end to the other."""
    rng = np.random.default_rng(seed)
    tree, q = boat(), np.zeros(7)
    rod = Body("rod", 1, at(0, 0, 0), coal.Capsule(0.05, 0.8))
    clearance = Clearance(tree, [rod], obstacles_of([wall([0.0, 0.0, 1.0], -0.5)]))
    q[3:7] = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
    near = clearance.near(q, 10.0)
    rows, room = near.rows.copy(), near.distances.copy()
    assert len(rows) == 2
    v = rng.normal(size=6)
    for _ in range(20):  # by projections, until all rows are kept
        for row in rows:
            v -= max(row @ v, 0.0) / (row @ row) * row
    v *= 1e-3 / np.linalg.norm(v)
    after = clearance.distances(pin.integrate(tree.model, q, v))[0]
    assert after >= room[0] - 1e-6


# --- all along a motion ------------------------------------------------------------------------------------------


@settings(max_examples=160)
@given(seed=seeds, size=st.sampled_from([1e-3, 0.05, 0.5, 3.0]))
def test_no_distance_changes_more_than_its_bound_anywhere_on_the_way(seed, size):
    rng = np.random.default_rng(seed)
    tree, bodies, given_, self_pairs = random_scene(rng, SHAPES[:1])
    clearance = Clearance(tree, bodies, given_, self_pairs)
    q = pin.integrate(tree.model, pin.neutral(tree.model), rng.normal(size=tree.model.nv))
    motion = size * rng.normal(size=tree.model.nv)
    to = pin.integrate(tree.model, q, motion)
    before, bounds = (array.copy() for array in clearance.motion_bounds(q, to))
    assert before == pytest.approx(measured(clearance, q), abs=1e-9)
    seen = np.array([clearance.distances(pin.interpolate(tree.model, q, to, t)) for t in np.linspace(0.0, 1.0, 41)])
    # coal looks for overlaps with a tolerance of its own
    assert (np.abs(seen - before) <= bounds + 1e-5).all()
    assert (np.abs(np.diff(seen, axis=0)).sum(axis=0) <= bounds + 4e-4).all()  # not even all ups and downs together


def check_uncertain(clearance, q, motion, straight, safety, rng):
    """Pairs that are not uncertain keep the distance at random configurations of the motion, and at its ends."""
    model = clearance.mechanism.model
    left = clearance.uncertain(q, motion, safety, clearance.every_pair, straight)
    if left is None:
        assert measured(clearance, q).min() < safety + 1e-5
        return 0
    kept = np.setdiff1d(clearance.every_pair, left)
    for t in (-1.0, 1.0, *rng.uniform(-1.0, 1.0, 4)):
        aside = np.sign(rng.normal(size=model.nv)) * rng.choice([1.0, rng.random()])
        moved = aside * motion if straight is None else t * straight + aside * (motion - np.abs(straight))
        assert (measured(clearance, pin.integrate(model, q, moved))[kept] >= safety - 1e-5).all()
    return len(kept)


@settings(max_examples=60)
@given(seed=seeds, size=st.sampled_from([1e-3, 0.02, 0.1, 0.5]))
def test_pairs_that_are_certain_keep_the_distance_whatever_was_measured_before(seed, size):
    rng = np.random.default_rng(seed)
    tree, bodies, given_, self_pairs = random_scene(rng)
    clearance = Clearance(tree, bodies, given_, self_pairs)
    q = pin.integrate(tree.model, pin.neutral(tree.model), rng.normal(size=tree.model.nv))
    for step in range(6):
        q = pin.integrate(tree.model, q, 0.5 * size * rng.normal(size=tree.model.nv))
        if step % 3 == 2:
            i = int(rng.integers(3))
            moved = clearance.bodies[len(bodies) + i].placement * pin.exp6(size * rng.normal(size=6))
            given_[i] = given_[i].moved(moved)
            clearance.move(i, moved)
            fresh = Clearance(tree, bodies, given_, self_pairs)
            clearance.bodies = fresh.bodies  # for the yardstick only, which places bodies by these
        straight = size * rng.normal(size=tree.model.nv)
        motion = np.abs(straight) * rng.choice([1.0, 1.3])
        safety = float(rng.choice([1e-9, 0.01, 0.1]))
        check_uncertain(clearance, q, motion, (None, straight)[step % 2], safety, rng)
        if step % 4 == 3:
            expected = measured(clearance, q)
            assert set(np.flatnonzero(expected < 0.1 - 1e-5)) <= set(clearance.nearer(q, 0.1).tolist())
            assert set(clearance.nearer(q, 0.1).tolist()) <= set(np.flatnonzero(expected < 0.1 + 1e-5))
            assert clearance.distances(q) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("name", ["arm7", "delta4", "gough", "two_arms"])
def test_most_pairs_are_certain_on_short_motions_of_a_robot_among_obstacles(name):
    clearance, rng = among(name, around(name, 3)), np.random.default_rng(0)
    mechanism, kept = clearance.mechanism, 0
    q, nv = mechanism.q_home, mechanism.model.nv
    for _ in range(8):
        straight = 0.02 * rng.normal(size=nv) * mechanism.scale
        q = mechanism.integrate(q, straight)
        kept += check_uncertain(clearance, q, np.abs(straight), straight, 0.01 * mechanism.length, rng)
    assert kept > 5 * len(clearance.pairs)


def test_a_box_that_slides_along_a_wall_is_certain_though_it_moves_further_than_it_is_away():
    tree = boat()
    wall_ = Body("wall", 0, at(0.0, 0.0, -0.5), coal.Box(10.0, 10.0, 1.0))
    clearance = Clearance(tree, [Body("box", 1, pin.SE3.Identity(), coal.Box(0.2, 0.2, 0.2))], obstacles_of([wall_]))
    q = np.array([0.0, 0.0, 0.105, 0.0, 0.0, 0.0, 1.0])
    along, towards = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0]), np.array([1.0, 0.0, -2e-3, 0.0, 0.0, 0.0])
    assert not len(clearance.uncertain(q, np.abs(along), 4e-3, clearance.every_pair, along))
    assert len(clearance.uncertain(q, np.abs(towards), 4e-3, clearance.every_pair, towards)) == 1
    assert len(clearance.uncertain(q, np.abs(towards), 4e-3, clearance.every_pair)) == 1
    aside = np.abs(along) + np.abs(towards)  # it may leave the straight line
    assert len(clearance.uncertain(q, aside, 4e-3, clearance.every_pair, along)) == 1
    tilted = np.array([0.0, 0.0, 0.0, 0.02, 0.0, 0.0])  # a corner comes nearer by 2 mm
    assert len(clearance.uncertain(q, np.abs(tilted), 4e-3, clearance.every_pair, tilted)) == 1
    assert not len(clearance.uncertain(q, np.abs(tilted), 2.5e-3, clearance.every_pair, tilted))
