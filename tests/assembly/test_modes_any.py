"""Assembly modes of mechanisms of no known family, at special values of the motors, and what is refused."""

from __future__ import annotations

import gc
import pickle
import weakref
from concurrent.futures import ThreadPoolExecutor

import making
import numpy as np
import pytest
from assembled import alike, home, nothing_beside, places, sound, traced
from linkages import five_bar, hinge, legged, ring, three_legs, together, tripod
from numpy.random import default_rng as rng
from variants import slow

import cinegen
from cinegen.assembly import ModesError, assembly_modes
from cinegen.assembly.linkage import Linkage

FEET = np.array([[0.0, 0.0], [1.0, 0.1], [0.4, 0.9]])

# --- any mechanism ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "count"), [("planar", 6), *slow(("gough", 40))])
def test_what_is_known_is_found_without_knowing_it_too(robot, built, name, count):
    """A sextic, and 40 by M. Raghavan, which monodromy is not told; the trace test says that none is missing."""
    said = []
    m = built(three_legs(rng(1), "RpR")) if name == "planar" else robot(name)
    one, two = assembly_modes(m), assembly_modes(m, method="monodromy", report=said.append)
    assert one.complete
    assert one.trace_test is None
    traced(two)
    assert two.counts.real + two.counts.complex == count
    alike(sound(one, [m.end]), sound(two, [m.end]))
    assert any("trace test" in sentence for sentence in said)


def test_what_takes_too_long_is_given_up_and_done_when_more_is_allowed(root):
    m = cinegen.load(root / "robots" / "hybrid.raff")
    early = assembly_modes(m, effort=1e-3)
    assert (early.complete, early.trace_test) == (False, False)
    assert "given up" in early.method
    traced(late := assembly_modes(m))
    traced(assembly_modes(m, effort=1e-3))  # what is known is not forgotten
    assert len(late) == 12


def test_a_general_6r_chain_reaches_a_place_in_sixteen_ways(built):
    """E. Primrose, "On the input-output equation of the general 7R-mechanism", Mech. and Machine Theory 21, 1986."""
    r = rng(3)
    m = built(ring([hinge(r.uniform(-1, 1, 3), making.direction(r), k == 0) for k in range(7)], 3))
    modes = assembly_modes(m, home(m) + 0.1)
    sound(modes)
    assert modes.counts.real + modes.counts.complex == 16
    traced(modes)
    nothing_beside(modes, ["tool"])


def test_loops_that_have_nothing_to_do_with_each_other_have_each_mode_with_each(built):
    other = five_bar(rng(2)).moved(making.shift("z", 1.0))
    both = built(together(five_bar(rng(1)), other))
    modes = assembly_modes(both)
    sound(modes, ["link3", "link503"], 4)
    traced(modes)


def test_a_base_that_can_move_changes_no_mode(built, raff):
    """Its configurations only begin with the base's pose."""
    along = np.array([0.1, 0.7])
    made = legged([[hinge(f, motor=k < 3), hinge(f + along), hinge(0.4 * f + 0.5)] for k, f in enumerate(FEET)])
    text = made.text(joint_digits=None).rstrip().removesuffix("}")
    fixed = built(made)
    free = raff(
        f'sensor 1 {{ port "x" translation 3 rotation 3 }}\n{text}\nconstraint {{ base sensor ( 0 1 ) }} }}', "free"
    )
    assert (fixed.floating, free.floating) == (False, True)
    assert Linkage(fixed).end == Linkage(free).end == 3
    asked = home(fixed) + 0.05
    one, two = assembly_modes(fixed, asked), assembly_modes(free, asked)
    sound(one, ["tool"])
    assert len(one) > 1
    assert np.array(two)[:, :7] == pytest.approx(np.tile(free.q_home[:7], (len(one), 1)), abs=0)
    assert one.coincident == two.coincident
    assert 1 in one.coincident
    for there, expected, times in zip(two, one, one.coincident, strict=True):
        exact = 1e-9 if times == 1 else 1e-6  # loops closed to 1e-12 determine a double mode to the square root of that
        assert there[7:] == pytest.approx(expected, abs=exact)


# --- singular values ----------------------------------------------------------------------------------------------

STRAIGHT = np.arccos((1.0 - 2.0 * np.hypot(0.5, 0.7)) / 2.0 / 0.5)  # from the x axis: knees are two rods apart


@pytest.fixture(scope="module")
def symmetric(tmp_path_factory):
    """A five-bar with cranks of 0.5, upright at home on feet that are 1 apart, and equal rods."""
    q = np.array([[0.0, 0.0], [0.0, 0.5], [0.5, 1.2], [1.0, 0.5], [1.0, 0.0]])
    legs = [[hinge(q[0], motor=True), hinge(q[1]), hinge(q[2])], [hinge(q[4], motor=True), hinge(q[3])]]
    path = tmp_path_factory.mktemp("symmetric") / "five.raff"
    path.write_text("RAFF five\n" + legged(legs).text(joint_digits=None), encoding="utf-8")
    return cinegen.load(path)


@pytest.mark.parametrize(("method", "past"), [("auto", 0.0), ("auto", -1e-13), ("monodromy", 1e-14)])
def test_two_modes_that_meet_are_said_to_coincide(symmetric, past, method):
    turn = STRAIGHT - np.pi / 2.0 + past
    modes = assembly_modes(symmetric, home(symmetric) + np.array([turn, -turn]), method)
    sound(modes, count=1)
    assert modes.coincident == (2,)
    assert modes.counts.multiple == 2
    if method == "monodromy":
        traced(modes)
    else:
        assert modes.complete


def test_a_ball_joint_whose_axes_are_in_line_loses_no_mode(built):
    """Nor is one found twice: joints are locked, the platform is not."""
    plain, locked = built(tripod(rng(0))), built(tripod(rng(0), locked=(0,)))
    one, two = assembly_modes(plain), assembly_modes(locked)
    sound(two, ["tool"], len(one))
    assert two.counts.multiple == 1
    traced(two)
    start = [np.linalg.inv(places(m, m.q_home, ["tool"])[0]) for m in (plain, locked)]
    alike(
        [places(plain, q, ["tool"])[0] @ start[0] for q in one],
        [places(locked, q, ["tool"])[0] @ start[1] for q in two],
    )


# --- refused ------------------------------------------------------------------------------------------------------


def test_what_motors_do_not_determine_is_no_number(built, robot):
    with pytest.raises(ModesError, match="no loops"):
        assembly_modes(robot("rx90"))
    p = rng(0).uniform(-1.0, 1.0, (5, 2))
    with pytest.raises(ModesError, match="a curve of configurations"):
        assembly_modes(built(ring([hinge(p[0], motor=True), *map(hinge, p[1:])])))


def test_values_that_are_none_are_refused(robot):
    m = robot("five_bar")
    for wrong, words in (
        ([0.1], "2 actuated joints"),
        ([0.1, np.nan], "not finite"),
        (["a", "b"], "no numbers"),
        ([0.1] * 3, "3 values"),
    ):
        with pytest.raises(ModesError, match=words):
            assembly_modes(m, wrong)
    with pytest.raises(ModesError, match="monodromy"):
        assembly_modes(m, method="guess")


# --- as an object -------------------------------------------------------------------------------------------------


def test_modes_are_a_sequence_that_travels_and_is_shown(robot):
    m = robot("five_bar")
    modes = assembly_modes(m)
    copy = pickle.loads(pickle.dumps(modes))
    assert [q.tolist() for q in copy] == [q.tolist() for q in modes]
    assert copy.method == modes.method
    assert np.abs(modes[0] - m.q_home).max() < 1e-9  # nearest to home first
    assert len(modes[:1]) == 1
    assert {modes: 1}[modes] == 1  # a key, as what it holds is not compared
    assert set(modes.as_dict()) >= {"actuated", "complete", "trace_test", "method", "counts", "modes", "closest"}
    assert "2 assembly modes" in repr(modes)
    modes = assembly_modes(robot("gough"))
    assert repr(modes) == "<8 assembly modes of hexapod, proved to be all>"
    assert modes._repr_html_().count("<tr>") == 1 + len(modes)
    assert "40 of 40 distinct regular solutions" in modes._repr_html_()


def test_threads_may_share_a_mechanism_and_it_is_not_kept_alive(root):
    def shared():
        m = cinegen.load(root / "robots" / "hybrid.raff")
        values = [home(m) * (1.0 + 0.01 * k) for k in range(3)]
        with ThreadPoolExecutor(3) as threads:
            at_once = list(threads.map(lambda v: assembly_modes(m, v), values))
        for value, modes in zip(values, at_once, strict=True):
            alike(list(modes), list(assembly_modes(m, value)), 1e-9)
        return weakref.ref(m)

    gone = shared()
    gc.collect()
    assert gone() is None
