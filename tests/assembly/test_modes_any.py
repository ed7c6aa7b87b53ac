"""Assembly modes of mechanisms of no known family, at special values of the motors, and what is refused."""

import gc
import pickle
import weakref
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import making
import numpy as np
import pytest
from assembled import alike, closings, home, nothing_beside, places, sound, traced
from linkages import five_bar, hexapod, hinge, legged, points, ring, three_legs, together, tripod
from numpy.random import default_rng as rng
from variants import slow

import cinegen
from cinegen.assembly import ModesError, assembly_modes
from cinegen.assembly.chains import recognise_part
from cinegen.assembly.families import recognise
from cinegen.assembly.homotopy import Homotopy
from cinegen.assembly.linkage import Linkage
from cinegen.assembly.monodromy import Monodromy
from cinegen.cli.motion.ik import claim_text
from cinegen.hexapod import SolutionCounts
from raff2urdf.closure import passive

FEET = np.array([[0.0, 0.0], [1.0, 0.1], [0.4, 0.9]])

# --- any mechanism ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "count"), [("planar", 6), *slow(("gough", 40))])
def test_what_is_known_is_found_without_knowing_it_too(robot, built, name, count):
    """A sextic, and 40 by M. Raghavan, which monodromy is not told; the trace test says that none is missing."""
    said = []
    m = built(three_legs(rng(1), "RpR")) if name == "planar" else robot(name)
    by_family, by_monodromy = assembly_modes(m), assembly_modes(m, method="monodromy", report=said.append)
    assert by_family.complete
    assert by_family.trace_test is None
    traced(by_monodromy)
    assert by_monodromy.counts.real + by_monodromy.counts.complex == count
    alike(sound(by_family, [m.end]), sound(by_monodromy, [m.end]))
    assert any("trace test" in sentence for sentence in said)


def test_what_takes_too_long_is_given_up_and_done_when_more_is_allowed(root):
    m = cinegen.load(root / "robots" / "hybrid.raff")
    early = assembly_modes(m, effort=1e-3)
    assert (early.complete, early.trace_test) == (False, False)
    assert "given up" in early.method
    traced(late := assembly_modes(m))
    traced(assembly_modes(m, effort=1e-3))  # what is known is not forgotten
    assert len(late) == 12


def test_a_part_of_several_loops_is_of_no_family_of_chains(robot):
    assert recognise_part(Linkage(robot("hybrid"))) is None


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


def random_legs(built, seed, words):
    """Legs of random geometry, motors wherever they suffice."""
    r = rng(seed)
    mechanism = making.platform(r, words.split(), "joint")
    bare = built(mechanism)
    order = r.permutation([bare.v_index(name) for name in bare.joints])
    unmotored = passive(bare.structure.system.evaluate(bare.structure.samples[-1])[1], order.tolist())
    driven = {name for name in bare.joints if bare.v_index(name) not in unmotored}
    bodies = tuple(replace(b, more="actuated 1") if f"joint{b.number}" in driven else b for b in mechanism.bodies)
    return built(replace(mechanism, bodies=bodies))


@pytest.mark.parametrize(("seed", "words"), [(0, "PPS RPS"), *slow((34, "UPS RUS"))])
def test_random_closings_find_nothing_beside_what_the_trace_test_passed(built, seed, words):
    modes = assembly_modes(random_legs(built, seed, words))
    sound(modes)
    traced(modes)
    assert "not counted" not in modes.method
    nothing_beside(modes, ["tool"], 10, seed)


def test_rotations_of_an_end_that_is_a_rod_are_not_counted_and_that_is_said(built):
    """The platform hangs on a universal and a ball joint: the former turns it by either of two angles."""
    modes = assembly_modes(random_legs(built, 3, "PPS RPS"))
    sound(modes, ["tool"], 2)
    turns = "rotations of 'tool' about the line between the joints at the ends of its rod are not counted"
    assert modes.method.endswith(turns)
    assert len({round(places(modes.mechanism, q, ["tool"])[0, 0, 3], 6) for q in closings(modes, 40)}) == 4


DAMPER = """
  frame 30 { pred 0 parameters { d 100 r 300 } }
  link 31 { joint universal pred 30 parameters { theta 75.94772866 } variable y { home 135.08849743 } }
  link 32 { type 1 pred 31 name "damper" actuated 0 parameters { r 423.61027786 } }
  constraint { frame 20 link 32 type 3 }
} // end"""


def test_rotations_of_half_a_rod_that_lengthens_are_not_counted_either(raff, root):
    """Both modes of the four-bar, each with both signs of the damper's length; its universal joint doubles them."""
    text = (root / "robots/four_bar.raff").read_text().split("\n", 1)[1]
    modes = assembly_modes(raff(text.replace("} // end", DAMPER)))
    sound(modes, ["damper"], 4)
    assert "; rotations of 'damper' about the line between the joints at the ends of its rod are not" in modes.method


def test_a_base_that_can_move_changes_no_mode(built, raff):
    """Its configurations only begin with the base's pose."""
    along = np.array([0.1, 0.7])
    made = legged([[hinge(f, motor=k < 3), hinge(f + along), hinge(0.4 * f + 0.5)] for k, f in enumerate(FEET)])
    text = made.text(joint_digits=None).rstrip().removesuffix("}")
    fixed = built(made)
    inside, before = "constraint { base sensor ( 0 1 ) }", 'sensor 1 { port "x" translation 3 rotation 3 }'
    free = raff(f"{before}\n{text}\n{inside} }}", "free")
    assert (fixed.floating, free.floating) == (False, True)
    assert Linkage(fixed).end == Linkage(free).end == 3
    asked = home(fixed) + 0.05
    fixed_modes, free_modes = assembly_modes(fixed, asked), assembly_modes(free, asked)
    sound(fixed_modes, ["tool"])
    assert len(fixed_modes) > 1
    assert np.array(free_modes)[:, :7] == pytest.approx(np.tile(free.q_home[:7], (len(fixed_modes), 1)), abs=0)
    assert fixed_modes.coincident == free_modes.coincident
    assert 1 in fixed_modes.coincident
    for q, expected, times in zip(free_modes, fixed_modes, fixed_modes.coincident, strict=True):
        exact = 1e-9 if times == 1 else 1e-6  # loops closed to 1e-12 determine a double mode to the square root of that
        assert q[7:] == pytest.approx(expected, abs=exact)


# --- motors that are too many -------------------------------------------------------------------------------------


def test_motors_that_others_determine_choose_among_the_modes_or_contradict(built):
    p = np.array([[0.0, 0.0], [0.2, 0.8], [1.2, 1.0], [1.3, 0.1]])
    solo = built(ring([hinge(p[0], motor=True), *map(hinge, p[1:])]))
    two = built(ring([hinge(p[0], motor=True), hinge(p[1]), hinge(p[2]), hinge(p[3], motor=True)], 1))
    assert (two.mobility, len(two.actuated)) == (1, 2)
    for q in assembly_modes(solo, home(solo) + 0.2):
        moved = places(solo, q, ["tool"])[0] @ np.linalg.inv(places(solo, solo.q_home, ["tool"])[0])  # of the coupler
        end = (moved @ [*p[2], 0.0, 1.0])[:2] - p[3]  # of the follower
        angle = np.arctan2(end[1], end[0]) - np.arctan2(*(p[2] - p[3])[::-1])
        modes = assembly_modes(two, home(two) + np.array([0.2, angle]))
        assert modes.complete
        assert modes.closest is None
        assert len(modes) == 1
        assert two.closure(modes[0]) <= 1e-12
        coupler = [places(two, config, ["link2"])[0] for config in (modes[0], two.q_home)]
        assert np.abs(coupler[0] @ np.linalg.inv(coupler[1]) - moved).max() < 1e-6
    none = assembly_modes(two, home(two) + np.array([0.2, 0.5]))
    assert (len(none), none.complete) == (0, True)
    assert "contradict" in none.closest.message


# --- singular values ----------------------------------------------------------------------------------------------

STRAIGHT = np.arccos((1.0 - 2.0 * np.hypot(0.5, 0.7)) / 2.0 / 0.5)  # from the x axis: knees are two rods apart


@pytest.fixture(scope="module")
def symmetric():
    """A five-bar with cranks of 0.5, upright at home on feet that are 1 apart, and equal rods."""
    q = np.array([[0.0, 0.0], [0.0, 0.5], [0.5, 1.2], [1.0, 0.5], [1.0, 0.0]])
    legs = [[hinge(q[0], motor=True), hinge(q[1]), hinge(q[2])], [hinge(q[4], motor=True), hinge(q[3])]]
    return cinegen.load("RAFF five\n" + legged(legs).text(joint_digits=None))


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


@pytest.mark.parametrize(("past", "count"), [(-1e-8, 2), (1e-8, 0), (1e-3, 0)])
def test_two_modes_that_almost_meet_are_two_and_what_just_fails_is_said(symmetric, past, count):
    turn = STRAIGHT - np.pi / 2.0 + past
    modes = assembly_modes(symmetric, home(symmetric) + np.array([turn, -turn]))
    sound(modes, count=count)
    assert modes.complete
    assert (modes.closest is None) == bool(count)
    if not count:
        assert 0.1 * past < modes.closest.gap < 10.0 * past
        assert "open stay" in modes.closest.message


def test_no_claim_is_made_where_solutions_went_to_infinity_or_random_starts_met_a_curve(built):
    m = built(three_legs(rng(1), "RpR"))
    linkage = Linkage(m)
    family = recognise(linkage)
    homotopy, fibre = Homotopy(linkage, family), Monodromy(linkage, family.bound).fibre()
    assert homotopy._status(fibre, SolutionCounts(real=2, complex=4), False)[0]
    infinite = SolutionCounts(real=2, complex=3, infinite=1)
    for counts, variant in ((infinite, fibre), (SolutionCounts(real=6), replace(fibre, loose=1))):
        complete, trace_test, remarks = homotopy._status(variant, counts, False)
        words = "; ".join(remarks)
        assert (complete, trace_test) == (False, None)
        assert "curves of configurations are not excluded" in words or "don't determine it" in words


def test_a_ball_joint_whose_axes_are_in_line_loses_no_mode(built):
    """Nor is one found twice: joints are locked, the platform is not."""
    plain, locked = built(tripod(rng(0))), built(tripod(rng(0), locked=(0,)))
    of_plain, of_locked = assembly_modes(plain), assembly_modes(locked)
    sound(of_locked, ["tool"], len(of_plain))
    assert of_locked.counts.multiple == 1
    traced(of_locked)
    moved = []
    for m, modes in ((plain, of_plain), (locked, of_locked)):
        start = np.linalg.inv(places(m, m.q_home, ["tool"])[0])
        moved.append([places(m, q, ["tool"])[0] @ start for q in modes])
    alike(*moved)


def test_what_no_rods_reach_is_said_of_each(robot):
    m = robot("gough")
    modes = assembly_modes(m, home(m) * [1.8, 1, 1, 1, 0.6, 1])
    assert (len(modes), modes.complete) == (0, True)
    assert sum(f"the rod of '{name}'" in modes.closest.message for name in m.actuated) == 6
    assert np.allclose([modes.closest.q[m.q_index(n)] for n in m.actuated], modes.actuated)


# --- refused ------------------------------------------------------------------------------------------------------


def test_what_motors_do_not_determine_is_no_number(built, robot):
    with pytest.raises(ModesError, match="no loops"):
        assembly_modes(robot("rx90"))
    p = rng(0).uniform(-1.0, 1.0, (5, 2))
    with pytest.raises(ModesError, match="a curve of configurations"):
        assembly_modes(built(ring([hinge(p[0], motor=True), *map(hinge, p[1:])])))


def test_fewer_modes_than_the_theorem_allows_are_all_with_probability_one(built):
    """Semi-regular hexagons: 12 of 40 solutions are at infinity at all lengths, counted from a random start."""
    low, high = np.radians([-10, 10, 110, 130, 230, 250]), np.radians([-50, 50, 70, 170, 190, 290])
    base = 2.0 * np.column_stack([np.cos(low), np.sin(low), np.zeros(6)])
    platform = np.column_stack([np.cos(high), np.sin(high), np.full(6, 2.0)])
    m = built(hexapod(rng(1), "UpS", base, platform))
    modes = assembly_modes(m)
    assert "12 paths ended at infinity" in modes.method
    assert (modes.complete, modes.proved) == (True, False)
    assert repr(modes).endswith("all with probability one>")
    assert claim_text(modes).startswith("These are all, with probability one. Homotopy")
    out_of_reach = assembly_modes(m, [*modes.actuated[:5], 9.0])
    assert (len(out_of_reach), out_of_reach.complete) == (0, True)
    assert claim_text(out_of_reach).startswith("There is none, with probability one.")
    general = assembly_modes(built(hexapod(rng(1), "UpS", *points(rng(1)))))
    assert general.proved
    assert claim_text(general).startswith("These are all. Homotopy")


def test_values_that_are_none_are_refused(robot):
    m = robot("five_bar")
    for wrong, words in (
        ([0.1, np.nan], "not finite"),
        (["a", "b"], "no numbers"),
        ([0.1] * 3, "2 actuated .* 3 values"),
    ):
        with pytest.raises(ModesError, match=words):
            assembly_modes(m, wrong)
    with pytest.raises(ModesError, match="monodromy"):
        assembly_modes(m, method="guess")


# --- as an object -------------------------------------------------------------------------------------------------


def test_a_structure_without_motors_promises_nothing_it_can_t(built):
    p = rng(0).uniform(-1.0, 1.0, (3, 2))
    triangle = assembly_modes(built(ring([hinge(x) for x in p])))
    sound(triangle, count=2)
    assert triangle.complete
    r = rng(5)
    chain = built(ring([hinge(r.uniform(-1, 1, 3), making.direction(r)) for _ in range(6)], 3))
    modes = assembly_modes(chain)
    assert not modes.complete
    assert "random starts" in modes.method
    sound(modes)


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
