"""No path is reported as reached on which the meshes touch, whatever the convex solids around them say."""

from functools import cache
from itertools import pairwise

import numpy as np
import pinocchio as pin
from example_robots import PANDA, PANDA_READY, load
from mesh_contact import MeshContact
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.collision import clearance_of, scene_of
from cinegen.collision.mesh_check import MeshCheck
from cinegen.ik.local_ik import LocalIK
from cinegen.planning import PlanStatus, plan

READY = PANDA_READY | {"panda_finger_joint1": 0.04, "panda_finger_joint2": 0.04}
FOLDED = READY | {"panda_joint6": 0.15}  # the hand is inside of link 5


def panda():
    return load(PANDA)


def talos():
    return load("talos_data/robots/talos_left_arm.urdf")


def scene(mechanism, start, goal, **more):
    pose = mechanism.placement(goal, mechanism.end)
    aim = {"point": pose.translation.tolist(), "rpy": pin.rpy.matrixToRpy(pose.rotation).tolist()}
    return scene_of({"start": {"joints": start}, "goal": aim, "node": mechanism.end, **more}, mechanism=mechanism)


@cache
def meshes():
    model, rng = panda().model, np.random.default_rng(5)
    return MeshContact(panda(), rng.uniform(model.lowerPositionLimit, model.upperPositionLimit, size=(100, model.nq)))


def between(ends, count):
    return [pin.interpolate(panda().model, *ends, part) for part in np.linspace(0.0, 1.0, count + 1)]


# --- the check -----------------------------------------------------------------------------------------------------


def test_first_contact_is_where_coal_finds_it():
    check = MeshCheck(scene(panda(), READY, panda().configuration(READY)))
    path = np.array(between([panda().configuration(READY), panda().configuration(FOLDED)], 50))
    contact = check.first_contact(path)
    first = next(i for i, q in enumerate(path) if meshes().touches(q))
    assert contact is not None
    assert contact.index in (first - 1, first - 2)  # it may begin between two configurations
    assert "'panda_link5'" in contact.reason
    assert check.first_contact(path[: contact.index + 1]) is None


def test_no_random_configuration_with_touching_meshes_is_called_clear():
    model = panda().model
    problem = scene(panda(), READY, panda().configuration(READY))
    check, clearance = MeshCheck(problem), clearance_of(problem)
    rng = np.random.default_rng(0)
    touching = 0
    for q in rng.uniform(model.lowerPositionLimit, model.upperPositionLimit, size=(200, model.nq)):
        if meshes().touches(q):
            touching += 1
            assert check.contact(q)
            assert clearance.least(q) <= 0.0
    assert touching >= 20


def test_links_whose_solids_always_overlap_are_checked_by_their_meshes():
    """The hull of Talos's arm_left_3 always holds a part of arm_left_5: only the meshes tell them apart."""
    problem = scene(talos(), {}, talos().q_home)
    clearance = clearance_of(problem)
    both = frozenset(("arm_left_3_link", "arm_left_5_link"))
    (pair,) = [pair for pair in range(len(clearance.pairs)) if both == set(clearance.names(pair))]
    assert clearance.distances(talos().q_home)[pair] > 0.0
    check = MeshCheck(problem)
    assert both not in map(frozenset, check.unchecked)
    free = LocalIK(talos()).samples(20, np.random.default_rng(3))
    beyond = np.random.default_rng(0).uniform(-np.pi, np.pi, size=(60, talos().model.nq))  # limits apart
    named = [[both <= set(check.contact(q).split("'")) for q in some] for some in (free, beyond)]
    assert not any(named[0])
    assert any(named[1])


def test_links_that_touch_in_every_configuration_are_not_checked_and_named():
    """The last link of two stays inside of a ball on the base, which it does not join."""
    radii = {"a": 2, "b": 0.1, "c": 0.1}
    balls = {name: f'<collision><geometry><sphere radius="{r}"/></geometry></collision>' for name, r in radii.items()}
    joints = [UrdfJoint(child, parent, child, "0.5 0 0", limit=(-1.0, 1.0)) for parent, child in ("ab", "bc")]
    arm = cinegen.load(urdf_text(joints, balls))
    check = MeshCheck(scene(arm, {}, arm.q_home))
    assert check.unchecked == (("a", "c"),)
    assert check.contact(arm.q_home) == ""


def test_collisions_that_a_scene_allows_are_not_checked():
    named = {"allowed_collisions": [["panda_link5", "panda_hand"], ["panda_link7", "panda_link5"]]}
    named["allowed_collisions"] += [["panda_link5", f"panda_{side}finger"] for side in ("left", "right")]
    problem = scene(panda(), READY, panda().configuration(READY), **named)
    assert problem.document()["allowed_collisions"] == named["allowed_collisions"]
    folded = panda().configuration(FOLDED)
    assert MeshCheck(scene(panda(), READY, panda().configuration(READY))).contact(folded)
    assert MeshCheck(problem).contact(folded) == ""
    clearance = clearance_of(problem)
    names = {frozenset(clearance.names(pair)) for pair in range(len(clearance.pairs))}
    assert names.isdisjoint(map(frozenset, named["allowed_collisions"]))


def test_a_sheet_of_a_tenth_of_a_millimetre_is_not_passed_through():
    """In one step of a path, by a hand that is at rest at neither end of it near the sheet."""
    model = panda()
    ends = [model.configuration(READY | {"panda_joint1": angle}) for angle in (-0.6, 0.6)]
    middle = model.placement(model.configuration(READY), "panda_hand").translation
    sheet = {"kind": "box", "size": [0.02, 1e-4, 0.02], "point": middle.tolist()}
    check = MeshCheck(scene(model, READY | {"panda_joint1": -0.6}, ends[0], obstacle=[sheet]))
    assert check.contact(ends[0]) == check.contact(ends[1]) == ""
    contact = check.first_contact(np.array(ends))
    assert contact is not None
    assert "box 1" in contact.reason


# --- plans ---------------------------------------------------------------------------------------------------------


def test_a_path_with_contact_is_never_reported_as_reached(monkeypatch):
    """Even if no pair of links were kept clear while planning."""
    bodies = cinegen.collision.clearance.links_of(panda())[0]
    monkeypatch.setattr(cinegen.collision.clearance, "links_of", lambda mechanism: (bodies, ()))
    planned = plan(scene(panda(), READY, panda().configuration(FOLDED)), attempts=2, planner="vortex", shorten=False)
    assert [attempt.status for attempt in planned.attempts] == [PlanStatus.IN_COLLISION] * 2
    assert not planned
    assert "check against the meshes" in planned.reason
    assert not any(meshes().touches(q) for ends in pairwise(planned.path) for q in between(ends, 5))
