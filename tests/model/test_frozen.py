"""A mechanism that its limits keep from moving says so when it is loaded."""

import re
import warnings

import numpy as np
import pinocchio as pin
import pytest
from making import platform
from small_robots import four_bar, rssr
from urdf_text import joint_at, limit, links, robot

import cinegen
import raff2urdf
from raff2urdf.loops.mobility import analyse


def hand(*fingers):
    """A palm and fingers, each with limits and how it follows the first, if it does."""
    parts = [links("palm")]
    for i, (low, high, mimic) in enumerate(fingers):
        follows = "" if mimic is None else f'<mimic joint="f0" multiplier="{mimic}"/>'
        parts += [links(f"l{i}"), joint_at(f"f{i}", "palm", f"l{i}", "0 0.1 0", follows + limit(low, high), "revolute")]
    return robot(*parts, name="hand")


def blocks(text):
    with warnings.catch_warnings(record=True, action="always") as said:
        cinegen.load(text)
    return [str(warning.message) for warning in said if "let no joint move" in str(warning.message)]


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
    with warnings.catch_warnings(action="ignore"):
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
    with warnings.catch_warnings(action="error"):
        frozen, none = cinegen.load(hand((0, 0, None), (0, 1, None))), cinegen.load(hand((0, 1, None), (0, 1, None)))
    assert frozen.source.notes == ("the lower limit is the upper limit of f0: they can't move",)
    assert none.source.notes == ()


# --- pins with play ---------------------------------------------------------------------------------------------------
# Planar loops whose pins are apart along their axes: closed in the plane, or told with the edit that closes them.


def bars(gap: float, kind: int = 2, turned: str = "", end: str = "frame 5") -> str:
    """A four-bar whose rocker is higher by a gap, mm."""
    text = four_bar((60, -40, 100), (100, 300, 300, 250)).replace("theta 100 d 300", f"theta 100 d 300 r {gap}")
    return text.replace("d 250 }", f"d 250 {turned} }}").replace("frame 5 type 2", f"{end} type {kind}")


@pytest.mark.parametrize("kind", [2, 3], ids=["revolute", "ball"])
def test_they_are_closed_in_the_plane_with_one_warning(kind):
    """It moves as the four-bar without the gap; raff2urdf warns of the same."""
    plain = cinegen.load(bars(0.0, kind))
    says = r"play: 'frame4-frame5' by 0\.45 mm along .* nothing across"
    with pytest.warns(cinegen.CinegenWarning, match=says) as caught:
        mechanism = cinegen.load(bars(0.45, kind))
    assert len(caught) == 1
    assert mechanism.mobility == plain.mobility == 1
    assert mechanism.q_home == pytest.approx(plain.q_home, abs=1e-12)
    solver = cinegen.Solver(mechanism, dt=0.01)
    task = solver.add_task("link2", rotation=0)
    task.target.translation += [0.02, 0.02, 0.0]
    assert max(abs(solver.step().q - mechanism.q_home)) > 1e-3
    document = raff2urdf.loads(bars(0.45, kind))
    (remark,) = analyse(document, document.robot()).remarks
    assert remark.partition(". --exact")[0] in str(caught[0].message)
    with pytest.raises(raff2urdf.RaffError, match=r"0\.45 mm along"):
        analyse(document, document.robot(), exact=True)


@pytest.mark.parametrize("form", ["urdf", "sdf", "mjcf"])
def test_raff2urdf_writes_them_closed(form, tmp_path):
    (tmp_path / "bars.raff").write_text(bars(0.45), encoding="utf-8")
    with pytest.warns(raff2urdf.RaffWarning, match=r"0\.45 mm along"):
        (made,) = raff2urdf.convert(tmp_path / "bars.raff", tmp_path, format=form)
    assert cinegen.load(made.file, relax=False).mobility == 1


@pytest.mark.parametrize(("gap", "turned", "relax", "says"), [
    (0.45, "", False, r"revolute, 0.45 mm along its axis(.|\n)*no motion changes these gaps\. "),
    (40.0, "", None, r"revolute, 40 mm along its axis(.|\n)*no motion changes these gaps\. "),  # too much to be play
    (30.0, "alpha 180", None, r"frame4 and frame5 point against each other(.|\n)*"),  # and an axis the other way
])  # fmt: skip
def test_what_is_not_closed_in_the_plane_is_told_with_the_edit_that_does(raff, gap, turned, relax, says):
    with pytest.raises(cinegen.ClosureError) as caught:
        raff(bars(gap, turned=turned).partition("\n")[2], relax=relax)
    edit = r"It closes with a frame on frame5, '(?P<edit>parameters .*)', lengths in mm"
    match = re.search(says + edit, str(caught.value))
    assert match, caught.value
    mended = bars(gap, turned=turned, end="frame 6")
    mended = mended.replace("constraint", f"frame 6 {{ {match['edit']} pred 5 }}\n constraint")
    assert cinegen.load(mended, relax=False).mobility == 1


def test_links_that_are_too_short_are_no_play():
    """Every motion changes their gap."""
    with pytest.raises(cinegen.ClosureError) as caught:
        cinegen.load(bars(0.0).replace("d 300 }", "d 30 }").replace("d 250", "d 25"))
    assert "no motion changes" not in str(caught.value)


# --- idle motions -----------------------------------------------------------------------------------------------------
# Rods that spin about themselves: found, never actuated, left out of modes and of what is uncontrolled, held still.


LEGS = [
    (("SPS",) * 6, 6, "P"),  # a hexapod whose legs are free to turn
    (("UPS",) * 6, 0, "P"),
    (("RSS",) * 6, 6, "R"),
    (("PSS",) * 6, 6, "P"),
    (("RSS", "UPS", "SPS", "RUS", "RUS", "PUS"), 2, None),
    (("SRS",) + ("UPS",) * 5, 0, None),  # a bent leg swings about the line between its ball joints: a real motion
]


@pytest.fixture(params=LEGS, ids=lambda legs: "-".join(dict.fromkeys(legs[0])))
def legs(request):
    return request.param


def on_legs(words, cut="joint"):
    """A platform on such legs, as RAFF."""
    return "RAFF legs\n" + platform(np.random.default_rng(3), words, cut).text(joint_digits=None)


@pytest.mark.parametrize("cut", ["rigid", "joint"])
def test_they_are_found_and_no_actuated_joint_drives_them(legs, cut):
    """Each turns bodies of one leg about a line, and moves nothing else: by Pinocchio's velocities of all bodies."""
    words, idle, driven = legs
    text = on_legs(words, cut)
    mechanism = cinegen.load(text)
    structure, model = mechanism.structure, mechanism.model
    swing = int("SRS" in words)
    assert (mechanism.mobility, len(structure.idle), structure.uncontrolled_dof) == (6 + idle + swing, idle, 0)
    assert len(mechanism.actuated) == 6 + swing
    if driven is not None:
        assert all(mechanism.is_prismatic(joint) == (driven == "P") for joint in mechanism.actuated)
    for q in mechanism.random_closed(3, seed=1):
        motions = structure.idle_motions(q)
        assert np.linalg.matrix_rank(motions) == idle
        assert np.abs(mechanism.loop_jacobian(q) @ motions.T).max(initial=0.0) < 1e-9
        passive = np.delete(mechanism.loop_jacobian(q), [mechanism.v_index(j) for j in mechanism.actuated], axis=1)
        assert np.linalg.matrix_rank(passive) == passive.shape[1] - idle
        for motion, spin in zip(motions * mechanism.scale, structure.idle, strict=True):
            data = model.createData()
            pin.forwardKinematics(model, data, q, motion)
            twists = np.array([data.oMi[j].act(data.v[j]).vector for j in range(model.njoints)])
            fast = {j for j in range(model.njoints) if np.abs(twists[j]).max() > 1e-9}
            leg = {j for body in spin.bodies for j in (*model.supports[body], *model.subtrees[body])} - {0}
            assert fast <= leg
            assert not motion[[mechanism.v_index(joint) for joint in mechanism.actuated]].any()
            for body in spin.bodies:  # a rotation: no translation along its axis
                assert twists[body][:3] @ twists[body][3:] == pytest.approx(0.0, abs=1e-9)
    document = raff2urdf.loads(text)
    assert analyse(document, document.robot()).actuated == mechanism.actuated


def test_a_joint_that_the_file_states_to_be_actuated_drives_a_spin():
    text = on_legs(("SPS",) * 6)
    free = cinegen.load(text)
    made = cinegen.load(text, actuated=[*free.actuated, free.joints[0]])
    assert (len(made.structure.idle), made.structure.uncontrolled_dof) == (5, 0)


def test_the_solver_holds_them_still():
    """A platform on rods is dragged: no rod turns about itself, by Pinocchio's velocities."""
    mechanism = cinegen.load(on_legs(("SPS",) * 6))
    solver = cinegen.Solver(mechanism, dt=0.01)
    task = solver.add_task("tool")
    task.target.translation += [0.05, 0.02, 0.08]
    spins = mechanism.structure.idle
    before = solver.q
    for _ in range(40):
        q = solver.q
        solver.step()
        step = pin.difference(mechanism.model, q, solver.q) / mechanism.scale
        for motion in mechanism.structure.idle_motions(q):
            assert abs(float(step @ motion)) < 1e-2 * np.linalg.norm(step) + 1e-9
    assert len(spins) == 6
    assert np.abs(solver.q - before).max() > 1e-2


def test_modes_are_counted_without_them():
    """A crank moves a rocker by a rod between ball joints: two configurations for each angle of the crank."""
    mechanism = cinegen.load(rssr())
    assert (mechanism.mobility, len(mechanism.structure.idle), mechanism.actuated) == (2, 1, ("joint1",))
    modes = cinegen.assembly_modes(mechanism)
    rockers = {round(float(q[mechanism.q_index("joint3")]), 6) for q in modes.configurations}
    assert len(modes.configurations) == len(rockers) == 2
