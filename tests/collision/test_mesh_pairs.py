"""Pairs that are checked by their meshes: found apart from those of `Clearance`, with which they must agree."""

import numpy as np
import pytest
from example_robots import PANDA, load
from test_mesh_check import READY, panda, scene
from test_self_collision import AC, chain

import cinegen
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.mesh_pairs import mesh_pairs
from cinegen.collision.self_collision import PairReason, link_pairs

__all__ = ["chain"]  # a fixture


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


# --- along a motion ------------------------------------------------------------------------------------------------


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
