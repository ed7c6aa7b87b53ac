"""Which bodies may collide: neighbours never, and nothing is left out without a reason."""

from functools import cache
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin
import pytest
from lxml import etree
from mesh_contact import adjacent_links
from reference import PANDA, SHARE, load
from variants import FEWER

from cinegen.collision.clearance import links_of
from cinegen.collision.self_collision import adjacent_joints as neighbours

SOLO = "solo_description/robots/solo12.urdf"
of_each_kind = pytest.mark.parametrize("name", [*sorted(FEWER), PANDA, SOLO])


@cache
def found(name):
    mechanism = load(name)
    return mechanism, *links_of(mechanism)


def transforms(mechanism, bodies, q):
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    return [coal.Transform3s(at.rotation, at.translation) for at in (data.oMi[b.joint] * b.placement for b in bodies)]


def distance(bodies, at, i, k):
    return coal.distance(bodies[i].shape, at[i], bodies[k].shape, at[k], coal.DistanceRequest(), coal.DistanceResult())


# --- laws ----------------------------------------------------------------------------------------------------------


@of_each_kind
def test_pairs_are_in_order_of_different_joints_and_never_of_neighbours(name):
    mechanism, bodies, pairs = found(name)
    assert pairs == tuple(sorted(set(pairs)))
    described = "<collision" in mechanism.source.urdf
    near, connected = neighbours(mechanism, not described), adjacent_links(mechanism.source.urdf)
    for i, k in pairs:
        assert 0 <= i < k < len(bodies)
        first, second = sorted((bodies[i].joint, bodies[k].joint))
        assert first != second
        if (first, second) in near:  # one is fixed to the neighbour
            assert described
            assert frozenset((bodies[i].name, bodies[k].name)) not in connected


@of_each_kind
def test_what_is_left_out_touches_in_every_configuration_or_never_moves(name):
    mechanism, bodies, pairs = found(name)
    near = neighbours(mechanism)
    left_out = [
        (i, k)
        for i, k in set(combinations(range(len(bodies)), 2)) - set(pairs)
        if bodies[i].joint != bodies[k].joint and tuple(sorted((bodies[i].joint, bodies[k].joint))) not in near
    ]
    others = [transforms(mechanism, bodies, q) for q in within_limits(mechanism, 25)]
    for i, k in left_out:
        distances = np.array([distance(bodies, at, i, k) for at in others])
        constant = np.ptp(distances) <= 1e-5 * mechanism.length
        assert constant or (distances <= 1.001e-3 * mechanism.length).all(), (bodies[i].name, bodies[k].name)


def within_limits(mechanism, count):
    """Closed configurations within the limits, by a random walk or uniform sampling of our own, not the library's."""
    model = mechanism.model
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    if mechanism.loops or model.nq != model.nv:
        walk = mechanism.random_closed(1000, seed=77)
        inside = [q for q in walk if ((q >= low) & (q <= high)).all()]
        assert inside
        return inside[:: max(1, len(inside) // count)]
    rng = np.random.default_rng(77)
    return list(rng.uniform(np.maximum(low, -np.pi), np.minimum(high, np.pi), size=(count, model.nq)))


def test_links_next_to_a_rigid_loop_are_neighbours_of_both_parts_of_the_link_that_was_cut():
    """Links 3 and 6 of the planar hybrid are one body, cut; joint 6 joins link 5 to it."""
    arm = load("planar_hybrid")
    near = neighbours(arm)
    assert numbered(arm, [("link5", "link3"), ("link7", "link6"), ("link2", "link6")]) <= near
    assert numbered(arm, [("link2", "link5"), ("link4", "link3")]).isdisjoint(near)


# --- neighbours ----------------------------------------------------------------------------------------------------


def numbered(mechanism, names):
    """The pairs of joints that carry these nodes."""
    joint = {node: mechanism.model.frames[mechanism.frame_id(node)].parentJoint for node in mechanism.nodes}
    return {tuple(sorted((joint[a], joint[b]))) for a, b in names}


@pytest.mark.parametrize("name", ["gough", "hybrid"])
def test_neighbours_that_are_none_in_the_tree_or_by_a_loop_share_a_point(name):
    mechanism = load(name)
    model = mechanism.model
    data = model.createData()
    direct = {(model.parents[j], j) for j in range(1, model.njoints)}
    direct |= numbered(mechanism, [(loop.first, loop.second) for loop in mechanism.loops])
    poses = []
    for q in mechanism.random_closed(12, seed=3):
        pin.forwardKinematics(model, data, q)
        poses.append([data.oMi[j].copy() for j in range(model.njoints)])
    shared = sorted(neighbours(mechanism) - direct)
    assert shared
    for i, j in shared:  # x in i and y in j are one point: x = R y + p in all configurations
        relative = [at[i].inverse() * at[j] for at in poses]
        rows = np.vstack([np.hstack([np.eye(3), -pose.rotation]) for pose in relative])
        right = np.concatenate([pose.translation for pose in relative])
        residual = rows @ np.linalg.lstsq(rows, right, rcond=None)[0] - right
        assert np.abs(residual).max() <= 1e-6 * mechanism.length, (i, j)


# --- against the field ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "srdf"),
    [
        (PANDA, "panda_description/srdf/panda.srdf"),
        ("ur_description/urdf/ur5_robot.urdf", "ur_description/srdf/ur5.srdf"),
    ],
)
def test_all_pairs_of_links_that_an_srdf_watches_are_watched(name, srdf):
    _, bodies, pairs = found(name)
    disabled = {
        frozenset((entry.get("link1"), entry.get("link2")))
        for entry in etree.parse(SHARE / srdf).iter("disable_collisions")
    }
    links = {body.name for body in bodies}
    fixed = {frozenset((one.name, other.name)) for one in bodies for other in bodies if one.joint == other.joint}
    watched = {frozenset(pair) for pair in combinations(links, 2)} - disabled - fixed
    ours = {frozenset((bodies[i].name, bodies[k].name)) for i, k in pairs}
    assert len(watched) >= 10
    assert watched <= ours


# --- links that touch, that stand in the world, that never meet ----------------------------------------------------


def test_what_stands_in_the_world_may_be_hit_by_a_link_further_out():
    arm = load("planar_3r")
    _, bodies, pairs = found("planar_3r")
    with_base = {bodies[k].name for i, k in pairs if bodies[i].joint == 0}
    assert with_base == {"link2", "link3"} & {body.name for body in bodies}
    last = bodies[max(k for i, k in pairs if bodies[i].joint == 0)]
    folded = arm.configuration({joint: angle for joint, angle in zip(arm.joints, (0.0, np.pi, 0.0), strict=True)})
    at = transforms(arm, bodies, folded)
    assert min(distance(bodies, at, i, k) for i, k in pairs if bodies[i].joint == 0) < 0.0, last.name


# --- Pinocchio's geometry ------------------------------------------------------------------------------------------
