"""A mechanism that its limits keep from moving says so when it is loaded."""

import warnings

import numpy as np
import pytest

import cinegen

HAND = """<robot name="hand"><link name="palm"/>{links}{joints}</robot>"""


def hand(*fingers):
    """A palm and fingers, each with limits and how it follows the first, if it does."""
    links, joints = [], []
    for i, (low, high, mimic) in enumerate(fingers):
        follows = "" if mimic is None else f'<mimic joint="f0" multiplier="{mimic}"/>'
        links.append(f'<link name="l{i}"/>')
        joints.append(
            f'<joint name="f{i}" type="revolute"><parent link="palm"/><child link="l{i}"/><axis xyz="0 0 1"/>{follows}'
            f'<origin xyz="0 0.1 0"/><limit lower="{low}" upper="{high}" effort="1" velocity="1"/></joint>'
        )
    return HAND.format(links="".join(links), joints="".join(joints))


def blocks(text):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        cinegen.load(text)
    return [str(one.message) for one in said if "let no joint move" in str(one.message)]


def test_fingers_that_would_leave_their_limits_both_ways_are_named_and_no_others():
    (said,) = blocks(hand((0, 1, None), (-1, 1, 2.0), (0, 1, -1.0)))
    assert "robot 'hand': from home the limits of f0, f2 let no joint move" in said
    assert not blocks(hand((0, 1, None), (-1, 1, 2.0), (-1, 0, -1.0)))  # corrected limits


def test_what_can_move_one_way_is_not_frozen():
    assert not blocks(hand((0, 1, None), (0, 1, 1.0), (0, 2, 2.0)))


@pytest.mark.parametrize(("low", "frozen"), [(0.0, True), (-0.1, False)])
def test_what_is_told_is_what_a_drag_meets(low, frozen):
    text = hand((low, 1, None), (-abs(low), 1, -1.0))
    assert bool(blocks(text)) is frozen
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        solver = cinegen.Solver(cinegen.load(text), dt=0.01)
    task = solver.add_task("l0", translation=0)
    target = task.target.copy()
    target.rotation = target.rotation @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    task.target = target
    for _ in range(20):
        step = solver.step()
    assert bool(np.abs(step.q).max() < 1e-9) is frozen


def test_limits_without_a_range_are_told():
    with pytest.warns(cinegen.CinegenWarning, match="'hand': no joint can move: the lower limit of each is its upper"):
        cinegen.load(hand((0, 0, None), (0.5, 0.5, None)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one, none = cinegen.load(hand((0, 0, None), (0, 1, None))), cinegen.load(hand((0, 1, None), (0, 1, None)))
    assert one.source.notes == ("the lower limit is the upper limit of f0: they can't move",)
    assert none.source.notes == ()
