"""Which bodies may collide: neighbours never, and nothing is left out without a reason."""

from __future__ import annotations

import sysconfig
import time
import warnings
from functools import cache
from itertools import combinations
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from lxml import etree
from mesh_contact import adjacent_links
from variants import FEWER, others_slow, slow

import cinegen
from cinegen.collision.body import Body, geometry_model
from cinegen.collision.links import link_bodies as bodies_of
from cinegen.collision.self_collision import adjacent_joints as neighbours
from cinegen.collision.self_collision import collision_pairs as pairs_of
from cinegen.model.load import robots

ROBOTS = Path(__file__).resolve().parents[2] / "robots"
SHARE = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
PANDA = "panda_description/urdf/panda.urdf"
SOLO = "solo_description/robots/solo12.urdf"
OTHERS = [
    PANDA,
    "panda_description/urdf/panda_collision.urdf",
    "ur_description/urdf/ur5_robot.urdf",
    "talos_data/robots/talos_left_arm.urdf",
    "tiago_description/robots/tiago_no_hand.urdf",
    SOLO,
    "xarm_description/urdf/xarm7.urdf",
    "simple_humanoid_description/urdf/simple_humanoid_classical.urdf",
]
ALL = [
    *((path.stem, robot) for path in sorted(ROBOTS.glob("*.raff")) for robot in robots(path)),
    *((name, None) for name in OTHERS),
]
of_each_kind = pytest.mark.parametrize(
    ("name", "robot"),
    [
        *others_slow((pytest.param(*one) for one in ALL[: -len(OTHERS)]), FEWER),
        *((PANDA, None), (SOLO, None), *slow(*((name, None) for name in OTHERS if name not in (PANDA, SOLO)))),
    ],
)


@cache
def load(name, robot=None):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return cinegen.load(SHARE / name if name.endswith(".urdf") else ROBOTS / f"{name}.raff", robot)


@cache
def found(name, robot=None):
    mechanism = load(name, robot)
    bodies = bodies_of(mechanism)
    return mechanism, bodies, pairs_of(mechanism, bodies)


def transforms(mechanism, bodies, q):
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    return [coal.Transform3s(at.rotation, at.translation) for at in (data.oMi[b.joint] * b.placement for b in bodies)]


def distance(bodies, at, i, k):
    return coal.distance(bodies[i].shape, at[i], bodies[k].shape, at[k], coal.DistanceRequest(), coal.DistanceResult())


# --- laws ----------------------------------------------------------------------------------------------------------


@of_each_kind
def test_pairs_are_in_order_of_different_joints_and_never_of_neighbours(name, robot):
    mechanism, bodies, pairs = found(name, robot)
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
def test_what_is_left_out_touches_in_every_configuration_or_never_moves(name, robot):
    mechanism, bodies, pairs = found(name, robot)
    near = neighbours(mechanism)
    left_out = [
        (i, k)
        for i, k in set(combinations(range(len(bodies)), 2)) - set(pairs)
        if bodies[i].joint != bodies[k].joint and tuple(sorted((bodies[i].joint, bodies[k].joint))) not in near
    ]
    others = [transforms(mechanism, bodies, q) for q in within_limits(mechanism, 40)]
    for i, k in left_out:
        distances = np.array([distance(bodies, at, i, k) for at in others])
        constant = np.ptp(distances) <= 1e-5 * mechanism.length
        assert constant or (distances <= 1.001e-3 * mechanism.length).all(), (bodies[i].name, bodies[k].name)


def within_limits(mechanism, count):
    """Closed configurations within the limits, by a random walk or uniform sampling of our own, not the library's."""
    model = mechanism.model
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    if mechanism.loops or model.nq != model.nv:
        walk = mechanism.random_closed(4000, seed=77)
        inside = [q for q in walk if ((q >= low) & (q <= high)).all()]
        assert inside
        return inside[:: max(1, len(inside) // count)]
    rng = np.random.default_rng(77)
    return list(rng.uniform(np.maximum(low, -np.pi), np.minimum(high, np.pi), size=(count, model.nq)))


def test_a_pair_that_touches_only_at_home_may_collide():
    """The URDF's zero configuration of the panda has the hand inside of link 5; MoveIt's SRDF disables neither pair."""
    mechanism, bodies, pairs = found(PANDA)
    named = {frozenset((bodies[i].name, bodies[k].name)) for i, k in pairs}
    assert {"panda_link5", "panda_hand"} in named
    assert {"panda_link5", "panda_link7"} in named
    at = transforms(mechanism, bodies, mechanism.q_home)
    touching = {frozenset((bodies[i].name, bodies[k].name)) for i, k in pairs if distance(bodies, at, i, k) <= 0.0}
    assert {"panda_link5", "panda_hand"} in touching


def test_links_next_to_a_rigid_loop_are_neighbours_of_both_parts_of_the_link_that_was_cut():
    """Links 3 and 6 of the planar hybrid are one body, cut; joint 6 joins link 5 to it."""
    arm = load("planar_hybrid")
    near = neighbours(arm)
    assert numbered(arm, [("link5", "link3"), ("link7", "link6"), ("link2", "link6")]) <= near
    assert numbered(arm, [("link2", "link5"), ("link4", "link3")]).isdisjoint(near)


@pytest.mark.parametrize("name", ["delta4", "sr400", PANDA])
def test_in_whatever_order_bodies_are_given_the_same_may_collide(name):
    mechanism, bodies, pairs = found(name)
    turned = bodies[::-1]
    again = {frozenset((turned[i], turned[k])) for i, k in pairs_of(mechanism, turned)}
    assert again == {frozenset((bodies[i], bodies[k])) for i, k in pairs}


# --- neighbours ----------------------------------------------------------------------------------------------------


def numbered(mechanism, names):
    """The pairs of joints that carry these nodes."""
    joint = {node: mechanism.model.frames[mechanism.frame_id(node)].parentJoint for node in mechanism.nodes}
    return {tuple(sorted((joint[a], joint[b]))) for a, b in names}


def test_links_at_a_loop_are_neighbours():
    linkage = load("five_bar")
    (loop,) = linkage.loops
    chain = numbered(linkage, [("base", "link1"), ("link1", "link2"), ("base", "link3"), ("link3", "link4")])
    assert numbered(linkage, [(loop.first, loop.second)]) <= neighbours(linkage)
    assert chain <= neighbours(linkage)


def test_links_on_both_sides_of_a_universal_or_a_ball_joint_are_neighbours():
    hexapod = load("gough")
    near = neighbours(hexapod)
    ball = combinations(("link3", "link4", "link5", "link6"), 2)  # link 3 is a jack, link 6 the platform
    assert numbered(hexapod, ball) <= near
    for first in (1, 7, 10, 13, 16, 19):  # universal joint: links first and first + 1
        assert numbered(hexapod, combinations(("base", f"link{first}", f"link{first + 1}"), 2)) <= near
        jack = f"link{first + 2}"
        assert numbered(hexapod, [("base", jack), (f"link{first}", jack)]).isdisjoint(near)
        assert numbered(hexapod, [("link6", jack)]) <= near  # by the legs' loops
    legs = numbered(hexapod, combinations([f"link{first + 2}" for first in (1, 7, 10, 13, 16, 19)], 2))
    assert legs.isdisjoint(near)


@pytest.mark.parametrize("name", ["delta4", "gough", "hybrid", "arm7", "rx90", "tssm", "five_bar", "sr400", PANDA])
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
    assert shared or name == "five_bar"
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
        ("xarm_description/urdf/xarm7.urdf", "xarm_description/srdf/xarm7.srdf"),
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


def test_what_touches_at_home_stays_in_unless_it_touches_everywhere():
    mechanism, bodies, _ = found("planar_3r")
    base = next(i for i, body in enumerate(bodies) if body.joint == 0)
    tip = next(i for i, k in enumerate(bodies) if k.joint == 3)
    at = transforms(mechanism, bodies, mechanism.q_home)
    gap = distance(bodies, at, base, tip)
    reach = 4.0 * mechanism.length
    for radius, kept in ((gap * 0.99, True), (gap * 1.01, True), (reach, False)):
        thick = list(bodies)
        ball = coal.Sphere(bodies[base].shape.radius + radius)
        thick[base] = Body("base", 0, bodies[base].placement, ball)
        assert ((base, tip) in pairs_of(mechanism, thick)) == kept


def test_balls_on_the_axes_that_a_link_holds_apart_never_meet():
    mechanism = load("planar_3r")
    centre = [Body("ball", joint, pin.SE3.Identity(), coal.Sphere(0.01)) for joint in (1, 3)]
    beside = Body("ball", 3, pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0])), coal.Sphere(0.01))
    far = Body("ball", 1, pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0])), coal.Sphere(0.01))
    assert pairs_of(mechanism, [centre[0], beside]) == ((0, 1),)
    # joint 3 turns on the end of link 2: its axis stays no constant distance from that of joint 1, but from joint 2's
    second = Body("ball", 2, pin.SE3.Identity(), coal.Sphere(0.01))
    assert pairs_of(mechanism, [centre[0], centre[1]]) == ((0, 1),)
    assert pairs_of(mechanism, [far, second]) == ()  # neighbours
    base = Body("ball", 0, pin.SE3.Identity(), coal.Sphere(0.01))
    assert pairs_of(mechanism, [base, second]) == ()  # on the axes of link 1
    assert pairs_of(mechanism, [base, centre[1]]) == ((0, 1),)


# --- Pinocchio's geometry ------------------------------------------------------------------------------------------


def test_geometry_has_own_pairs_then_each_moving_body_with_each_obstacle():
    mechanism, bodies, pairs = found(PANDA)
    obstacles = [
        Body("pole", 0, pin.SE3(np.eye(3), np.array([0.5, 0.2, 0.4])), coal.Capsule(0.05, 1.0)),
        Body("floor", 0, pin.SE3.Identity(), coal.Halfspace(np.array([0.0, 0.0, 1.0]), -0.2)),
    ]
    geometry = geometry_model(mechanism, bodies, obstacles, pairs)
    moving = [i for i, body in enumerate(bodies) if body.joint != 0]
    expected = [*pairs, *((i, len(bodies) + o) for i in moving for o in range(2))]
    assert [(pair.first, pair.second) for pair in geometry.collisionPairs] == expected
    assert [solid.name.split(" ", 1)[1] for solid in geometry.geometryObjects] == [
        body.name for body in (*bodies, *obstacles)
    ]
    q = mechanism.random_closed(1, seed=4)[0]
    data, distances = mechanism.model.createData(), geometry.createData()
    pin.updateGeometryPlacements(mechanism.model, data, geometry, distances, q)
    pin.computeDistances(geometry, distances)
    everything = [*bodies, *obstacles]
    at = transforms(mechanism, everything, q)
    direct = [distance(everything, at, i, k) for i, k in expected]
    assert [result.min_distance for result in distances.distanceResults] == pytest.approx(direct, abs=1e-6)
