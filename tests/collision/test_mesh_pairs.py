"""Pairs that are checked by their meshes: found apart from those of `Clearance`, with which they must agree."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from test_mesh_check import READY, load, panda, scene
from test_self_collision import load as load_any
from test_srdf import AC, chain
from variants import slow

import cinegen
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.mesh_pairs import mesh_pairs
from cinegen.collision.self_collision import PairReason, link_pairs

__all__ = ["chain"]  # a fixture


def names(bodies, pairs):
    return {frozenset((bodies[i].name, bodies[k].name)) for i, k in pairs}


@pytest.mark.parametrize(
    "name",
    [
        "delta4",
        "hybrid",
        "two_arms",
        "panda_description/urdf/panda.urdf",
        *slow("gough", "five_bar", "planar_hybrid", "sr400", "ur_description/urdf/ur5_robot.urdf"),
        *slow("tiago_description/robots/tiago_no_hand.urdf"),
    ],
)
def test_both_selections_of_pairs_agree_but_for_links_at_a_constant_distance(name):
    mechanism = load_any(name)
    own, others = mechanism.derived(mesh_pairs), mechanism.derived(link_pairs)
    by_meshes = names(own.bodies, own.pairs)
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
        (AC.replace("Never", "Always"), True),
        (AC.replace("Never", "Default"), True),
        (AC.replace("Never", "User"), False),
        (AC.replace(' reason="Never"', ""), False),
    ],
)
def test_the_reason_of_an_srdf_is_verified(chain, srdf, is_checked):
    mechanism = cinegen.load(chain(srdf))
    found = mechanism.derived(mesh_pairs)
    assert (frozenset("ac") in names(found.bodies, found.pairs)) == is_checked
    assert (("a", "c") in found.unchecked) != is_checked


def test_links_in_contact_at_home_are_left_out_by_default_if_they_are(chain):
    """Boxes of a third of a metre every 0.2 m: a and c overlap at home."""
    urdf = chain(AC.replace("Never", "Default"))
    urdf.write_text(urdf.read_text().replace('xyz="0 0 0.4"', 'xyz="0 0 0.1"'))
    found = cinegen.load(urdf).derived(mesh_pairs)
    assert found.unchecked["a", "c"] in ("disabled by the SRDF: Default", "in contact in all sampled configurations")


# --- along a motion ------------------------------------------------------------------------------------------------


def test_a_sheet_of_a_tenth_of_a_millimetre_is_not_passed_through():
    """In one step of a path, by a hand that is at rest at neither end of it near the sheet."""
    model = panda()
    ends = [model.configuration(READY | {"panda_joint1": angle}) for angle in (-0.6, 0.6)]
    middle = model.placement(model.configuration(READY), "panda_hand").translation
    sheet = {"kind": "box", "size": [0.02, 1e-4, 0.02], "point": middle.tolist()}
    check = MeshCheck(scene(model, READY | {"panda_joint1": -0.6}, ends[0], obstacle=[sheet]))
    assert check.contact(ends[0]) == check.contact(ends[1]) == ""
    found = check.first_contact(np.array(ends))
    assert found is not None
    assert "box 1" in found.reason


@pytest.mark.parametrize("name", ["panda_description/urdf/panda.urdf", "solo_description/robots/solo12.urdf"])
def test_no_distance_changes_more_than_its_bound(name):
    mechanism, rng = load(name), np.random.default_rng(2)
    check = MeshCheck(scene(mechanism, {}, mechanism.q_home))
    low = np.maximum(mechanism.model.lowerPositionLimit, -2.0)
    high = np.minimum(mechanism.model.upperPositionLimit, 2.0)
    tightest = np.inf
    for _ in range(5):
        begin, end = (pin.normalize(mechanism.model, rng.uniform(low, high)) for _ in range(2))
        end = pin.interpolate(mechanism.model, begin, end, 0.2)
        bounds = check._motion(begin, end)
        places = {part: check._poses(pin.interpolate(mechanism.model, begin, end, part)) for part in (0.0, 0.4, 1.0)}
        for bound, pair in zip(bounds, check._pairs, strict=True):
            points = [check._centres[i] + check._radii[i] * np.vstack([np.eye(3), -np.eye(3)]) for i in pair]

            def between(at, pair=pair, points=points):
                one, other = (
                    own @ at[i].rotation.T + at[i].translation for i, own in zip(pair.tolist(), points, strict=True)
                )
                return np.linalg.norm(one[:, None] - other, axis=2)

            for part in (0.4, 1.0):
                moved = float(np.abs(between(places[part]) - between(places[0.0])).max())
                assert moved <= part * bound + 1e-9
                if bound > 0.0:
                    tightest = min(tightest, part * bound / max(moved, 1e-12))
    assert tightest < 3.0
