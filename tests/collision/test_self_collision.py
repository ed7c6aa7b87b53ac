"""Which bodies may collide: neighbours never, and nothing is left out without a reason."""

import json
import pickle
from functools import cache
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from clearings import apart
from example_robots import PANDA, SHARE, UR5, load
from lxml import etree
from mesh_contact import adjacent_links
from urdf_text import UrdfJoint, urdf_text
from variants import FEWER

import cinegen
from cinegen.collision import clearance_of, load_scene
from cinegen.collision.clearance import links_of
from cinegen.collision.mesh_pairs import mesh_pairs
from cinegen.collision.self_collision import PairReason, disabled_by_srdf, link_pairs
from cinegen.collision.self_collision import adjacent_joints as neighbours

SOLO = "solo_description/robots/solo12.urdf"
of_each_kind = pytest.mark.parametrize("name", [*sorted(FEWER), PANDA, SOLO])


@cache
def pairs_of(name):
    mechanism = load(name)
    return mechanism, *links_of(mechanism)


def poses(mechanism, bodies, q):
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    return [data.oMi[body.joint] * body.placement for body in bodies]


def distance(bodies, at, i, k):
    return apart(bodies[i].shape, at[i], bodies[k].shape, at[k])


# --- laws ----------------------------------------------------------------------------------------------------------


@of_each_kind
def test_pairs_are_in_order_of_different_joints_and_never_of_neighbours(name):
    mechanism, bodies, pairs = pairs_of(name)
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
    mechanism, bodies, pairs = pairs_of(name)
    near = neighbours(mechanism)
    left_out = [
        (i, k)
        for i, k in set(combinations(range(len(bodies)), 2)) - set(pairs)
        if bodies[i].joint != bodies[k].joint and tuple(sorted((bodies[i].joint, bodies[k].joint))) not in near
    ]
    others = [poses(mechanism, bodies, q) for q in within_limits(mechanism, 25)]
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
    ("name", "srdf"), [(PANDA, "panda_description/srdf/panda.srdf"), (UR5, "ur_description/srdf/ur5.srdf")]
)
def test_all_pairs_of_links_that_an_srdf_watches_are_watched(name, srdf):
    _, bodies, pairs = pairs_of(name)
    entries = etree.parse(SHARE / srdf).iter("disable_collisions")
    disabled = {frozenset((entry.get("link1"), entry.get("link2"))) for entry in entries}
    links = {body.name for body in bodies}
    fixed = {frozenset((body.name, other.name)) for body in bodies for other in bodies if body.joint == other.joint}
    watched = {frozenset(pair) for pair in combinations(links, 2)} - disabled - fixed
    ours = {frozenset((bodies[i].name, bodies[k].name)) for i, k in pairs}
    assert len(watched) >= 10
    assert watched <= ours


# --- srdf -------------------------------------------------------------------------------------------------------------
# Pairs of links that an SRDF disables.


PANDA_URDF, PANDA_SRDF = SHARE / "panda_description/urdf/panda.urdf", SHARE / "panda_description/srdf/panda.srdf"

LINKS = "abcde"
BOX = '<collision><geometry><box size="0.1 0.1 0.3"/></geometry></collision>'
JOINTS = [UrdfJoint(parent + other, parent, other, "0 0 0.4", "0 1 0") for parent, other in pairwise(LINKS)]
CHAIN = urdf_text(JOINTS, dict.fromkeys(LINKS, BOX), "chain")


@pytest.fixture
def chain(tmp_path):
    """`chain(srdf)`: path of a URDF of links a to e, with this SRDF next to it."""
    urdf = tmp_path / "chain.urdf"
    urdf.write_text(CHAIN)

    def write(body: str | None, name: str = "chain.srdf", root: str = "robot") -> Path:
        if body is not None:
            (tmp_path / name).write_text(f'<?xml version="1.0"?>\n<{root} name="chain">\n{body}\n</{root}>')
        return urdf

    return write


def disabled(mechanism) -> set[str]:
    return {"".join(sorted(pair)) for pair in disabled_by_srdf(mechanism)}


def reasons(mechanism) -> dict[str, PairReason]:
    links = mechanism.structure.derived(link_pairs)
    return {links.bodies[i].name + links.bodies[k].name: reason for (i, k), reason in links.reasons.items()}


AC = '<disable_collisions link1="c" link2="a" reason="Never"/>'


def test_a_pair_that_the_srdf_next_to_the_urdf_disables_is_not_checked(chain):
    with_srdf = cinegen.load(chain(AC))
    assert disabled(with_srdf) == {"ac"}
    assert reasons(with_srdf)["ac"] is PairReason.SRDF
    chain(AC).with_suffix(".srdf").unlink()
    assert reasons(cinegen.load(chain(None))) == reasons(with_srdf) | {"ac": PairReason.CHECKED}


def test_the_srdf_that_is_named_replaces_the_one_next_to_the_urdf(chain, tmp_path):
    chain('<disable_collisions link1="a" link2="d"/>', "other.srdf")
    mechanism = cinegen.load(chain(AC), srdf=tmp_path / "other.srdf")
    assert disabled(mechanism) == {"ad"}
    assert disabled(cinegen.load(chain(AC), ignore=["chain.srdf"])) == set()


def test_a_link_disabled_by_default_is_checked_against_those_enabled_again(chain):
    """As in MoveIt's AllowedCollisionMatrix: disabled pairs are disabled whatever is enabled."""
    srdf = '<disable_default_collisions link="a"/><enable_collisions link1="a" link2="c"/>'
    srdf += '<enable_collisions link1="d" link2="a"/><disable_collisions link1="a" link2="d" reason="User"/>'
    mechanism = cinegen.load(chain(srdf))
    assert disabled(mechanism) == {"ab", "ad", "ae"}
    assert reasons(mechanism)["ab"] is PairReason.ADJACENT


def test_the_srdf_stays_with_the_mechanism(chain):
    mechanism = cinegen.load(chain(AC))
    assert disabled(pickle.loads(pickle.dumps(mechanism))) == {"ac"}
    assert disabled(mechanism.structure.with_locked({"ab": 0.0})) == {"ac"}


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (AC.replace('"a"', '"hand"'), r"chain.srdf: 'hand' \(line 3\) is not a link of robot 'chain'"),
        ('<disable_collisions link1="a"/>', "chain.srdf:3: <disable_collisions> has no link2"),
        (AC.replace('"a"', '"c"'), "chain.srdf:3: <disable_collisions> names 'c' twice"),
        ("<disable_collisions", "chain.srdf:.: invalid XML"),
    ],
)
def test_an_srdf_that_is_wrong_is_refused_with_its_place(chain, body, message):
    with pytest.raises(cinegen.CinegenError, match=message):
        cinegen.load(chain(body))


def test_other_files_are_not_taken_for_an_srdf(chain, tmp_path):
    urdf = chain(None)
    chain("", "scene.srdf", root="scene")
    for other, message in (("scene.srdf", "<scene>"), (urdf.name, "this is a URDF"), ("no.srdf", "no.srdf")):
        with pytest.raises(cinegen.CinegenError, match=message):
            cinegen.load(urdf, srdf=tmp_path / other)


def test_moveits_srdf_of_the_panda_is_read_as_its_file_lists_it():
    mechanism = cinegen.load(PANDA_URDF, srdf=PANDA_SRDF)
    entries = etree.parse(PANDA_SRDF).iter("disable_collisions")
    listed = {frozenset((entry.get("link1"), entry.get("link2"))): entry.get("reason") for entry in entries}
    assert disabled_by_srdf(mechanism) == listed
    assert len(listed) == 35
    links = mechanism.structure.derived(link_pairs)
    for (i, k), reason in links.reasons.items():
        pair = frozenset((links.bodies[i].name, links.bodies[k].name))
        assert reason is not PairReason.CHECKED or pair not in listed
        assert reason is not PairReason.SRDF or pair in listed
    assert set(links.reasons.values()) >= {PairReason.SRDF, PairReason.CHECKED}


def test_info_lists_disabled_pairs_with_the_reason(chain, typed):
    urdf = str(chain(AC + '<disable_collisions link1="b" link2="d"/>'))
    said = typed("info", urdf, "--collision", "--json")
    pairs = {"".join(pair["links"]): pair["reason"] for pair in json.loads(said.out)[0]["collision"]["pairs"]}
    assert set(pairs) == {"".join(pair) for pair in combinations(LINKS, 2)}
    assert pairs["ac"] == "disabled by chain.srdf: Never"
    assert pairs["bd"] == "disabled by chain.srdf: no reason given"
    assert pairs["ad"] == "checked"
    assert "a - c: disabled by chain.srdf: Never" in typed("info", urdf, "--collision").out


def test_a_scene_names_the_srdf_of_its_robot(chain, tmp_path):
    urdf = chain(None)
    chain(AC, "named.srdf")
    chain('<disable_collisions link1="a" link2="d"/>', "option.srdf")
    scene = tmp_path / "scene.toml"
    scene.write_text(f'robot = {{ file = "{urdf.name}", srdf = "named.srdf" }}\ngoal = {{ point = [0.1, 0, 1] }}\n')
    loaded = load_scene(scene)
    assert disabled(loaded.mechanism) == {"ac"}
    clearance = clearance_of(loaded)
    names = {"".join(sorted(clearance.names(pair))) for pair in range(len(clearance.pairs))}
    assert names == {"ad", "ae", "bd", "be", "ce"}
    assert loaded.document()["robot"] == {"file": "chain.urdf", "srdf": "named.srdf"}
    assert disabled(load_scene(scene, srdf=tmp_path / "option.srdf").mechanism) == {"ad"}
    scene.write_text(scene.read_text().replace("named", "missing"))
    with pytest.raises(cinegen.CinegenError, match=r"robot: srdf .*missing.srdf' does not exist"):
        load_scene(scene)


def test_an_srdf_may_hold_nothing_but_states_of_joints(chain):
    path = chain('<group_state name="bent" group="all"><joint name="ab" value="1"/></group_state>')
    assert disabled(cinegen.load(path)) == set()


# --- pairs that are checked by meshes ---------------------------------------------------------------------------------
# They are found apart from those of `Clearance`, with which they must agree.


def names(bodies, pairs):
    return {frozenset((bodies[i].name, bodies[k].name)) for i, k in pairs}


@pytest.mark.parametrize("name", ["delta4", "two_arms", PANDA])
def test_both_selections_of_pairs_agree_but_for_links_at_a_constant_distance(name):
    mechanism = load(name)
    mesh_based, others = mechanism.structure.derived(mesh_pairs), mechanism.structure.derived(link_pairs)
    by_meshes = names(mesh_based.bodies, mesh_based.pairs)
    by_distance = names(others.bodies, others.of(PairReason.CHECKED))
    rigid = names(others.bodies, others.of(PairReason.RIGID))
    assert by_distance - by_meshes == set()
    assert by_meshes - by_distance <= rigid
    assert len(by_meshes) >= 5


@pytest.mark.parametrize(
    ("srdf", "is_checked"),
    [
        ("", True),
        (AC, True),  # "Never": checking verifies it
        (AC.replace("Never", "Adjacent"), True),  # they are not
        (AC.replace("Never", "Default"), True),
        (AC.replace("Never", "User"), False),
    ],
)
def test_the_reason_of_an_srdf_is_verified(chain, srdf, is_checked):
    mechanism = cinegen.load(chain(srdf))
    selection = mechanism.structure.derived(mesh_pairs)
    assert (frozenset("ac") in names(selection.bodies, selection.pairs)) == is_checked
    assert (("a", "c") in selection.unchecked) != is_checked
