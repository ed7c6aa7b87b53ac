"""Assembly modes of whole mechanisms, of random geometry, against calculations of another kind."""

from __future__ import annotations

import math
import pickle
import tempfile
from pathlib import Path

import linkages
import numpy as np
import pinocchio as pin
import pytest
from assembled import traced
from linkages import hinge, slide

import cinegen
from cinegen.assembly import ModesError


def load(mechanism) -> cinegen.Mechanism:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "any.raff"
        path.write_text(f"RAFF any\n{mechanism.text(joint_digits=None)}", encoding="utf-8")
        return cinegen.load(path)


def poses(modes, node=None) -> list[np.ndarray]:
    return [placement.homogeneous for placement in modes.placements(node)]


def same(one, other, tolerance=1e-7) -> bool:
    """Whether two sets of placements are the same."""
    return len(one) == len(other) and all(min(np.abs(p - q).max() for q in other) < tolerance for p in one)


def check(modes) -> None:
    """What holds of all modes."""
    mechanism = modes.mechanism
    for q in modes:
        assert mechanism.closure(q) <= 1e-12
        for motor, value in zip(mechanism.actuated, modes.actuated, strict=True):
            assert q[mechanism.q_index(motor)] == pytest.approx(value, abs=1e-12)
    assert modes.counts.lost == 0
    words = ("as many as there can be", "of 40 distinct", "degree 16")
    assert not modes.complete or any(part in modes.method for part in words)


def from_many_starts(mechanism, count, seed=0) -> list[np.ndarray]:
    """Placements of the end that Newton's method finds from random values of the passive joints."""
    rng, found = np.random.default_rng(seed), []
    home = mechanism.q_home
    free = [joint for joint in mechanism.joints if joint not in mechanism.actuated]
    for _ in range(count):
        values = {
            joint: home[mechanism.q_index(joint)]
            + (rng.normal() * mechanism.length if mechanism.is_prismatic(joint) else rng.uniform(-np.pi, np.pi))
            for joint in free
        }
        try:
            q = mechanism.close(mechanism.configuration(values), mechanism.actuated)
        except cinegen.ClosureError:
            continue
        pose = mechanism.placement(q, mechanism.end).homogeneous
        if all(np.abs(pose - other).max() > 1e-6 for other in found):
            found.append(pose)
    return found


# --- in a plane ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cut", ["rigid", "joint"])
@pytest.mark.parametrize("seed", range(4))
def test_a_five_bar_has_the_two_intersections_of_its_circles(seed, cut):
    made = linkages.five_bar(np.random.default_rng(seed), cut)
    mechanism = load(made)
    modes = cinegen.assembly_modes(mechanism)
    check(modes)
    assert modes.complete
    knees = "link2", "link5" if cut == "rigid" else "frame5"
    c, d = (mechanism.placement(mechanism.q_home, node).translation for node in knees)
    p = mechanism.placement(mechanism.q_home, "link3").translation
    u = (d - c) / np.linalg.norm(d - c)
    mirrored = c + 2.0 * ((p - c) @ u) * u - (p - c)
    found = np.array([placement.translation for placement in modes.placements("link3")])
    assert np.allclose(found, [p, mirrored], atol=1e-9)  # the nearest to home first


def sextic(feet, heads, lengths) -> list[np.ndarray]:
    """All placements of a planar platform on three bars: |p + R h_i - f_i| = l_i. Differences are linear in p; what is
    left is a Laurent polynomial of degree 3 in z = exp(i phi), found from its values on the unit circle."""
    heads = heads - heads[0]

    def place(z):
        turned = np.array([(h[0] + 1j * h[1]) * z for h in heads])
        other = np.array([(h[0] - 1j * h[1]) / z for h in heads])
        x, y = 0.5 * (turned + other), -0.5j * (turned - other)
        rows = np.c_[x[1:] - (feet[1:, 0] - feet[0, 0]), y[1:] - (feet[1:, 1] - feet[0, 1])]
        own = (x - feet[:, 0]) ** 2 + (y - feet[:, 1]) ** 2 - lengths**2
        # p . (2 (R h_i - f_i) + 2 f_0) = own_0 - own_i
        right = 0.5 * (own[0] - own[1:])
        matrix, det = rows, rows[0, 0] * rows[1, 1] - rows[0, 1] * rows[1, 0]
        p = np.array(
            [right[0] * matrix[1, 1] - right[1] * matrix[0, 1], matrix[0, 0] * right[1] - matrix[1, 0] * right[0]]
        )
        # (p / det - f_0)^2 = l_0^2, times det^2
        return ((p - det * feet[0]) ** 2).sum() - (det * lengths[0]) ** 2, p, det

    n = 32
    values = [place(np.exp(2j * np.pi * k / n))[0] for k in range(n)]
    coefficients = np.fft.fft(values) / n
    degree = max(
        k
        for k in range(n // 2)
        if max(abs(coefficients[k]), abs(coefficients[-k])) > 1e-10 * np.abs(coefficients).max()
    )
    polynomial = np.array([coefficients[k] for k in range(-degree, degree + 1)])
    found = []
    for z in np.roots(polynomial[::-1]):
        if abs(abs(z) - 1.0) < 1e-7:
            _, p, det = place(z)
            found.append(np.array([*(p / det).real, np.angle(z)]))
    return found


@pytest.mark.parametrize(("word", "cut"), [("RpR", "rigid"), ("RpR", "joint"), ("rRR", "rigid"), ("rRR", "joint")])
@pytest.mark.parametrize("seed", range(3))
def test_a_planar_platform_has_the_roots_of_a_sextic(seed, word, cut):
    mechanism = load(linkages.three_legs(np.random.default_rng(seed), word, cut))
    modes = cinegen.assembly_modes(mechanism)
    check(modes)
    assert modes.complete
    assert modes.counts.real + modes.counts.complex + modes.counts.infinite == 6
    ends = platform_and_bars(mechanism, word, cut)
    wanted = sextic(*ends)
    assert len(modes) == len(wanted) > 0
    home = mechanism.placement(mechanism.q_home, "link3")
    for placement in modes.placements("link3"):
        turn = pin.log3(placement.rotation @ home.rotation.T)[2]
        away = [abs(math.remainder(turn - phi, 2.0 * math.pi)) for _, _, phi in wanted]
        assert min(away) < 1e-6
        x, y, _ = wanted[int(np.argmin(away))]
        assert np.allclose(placement.translation[:2], (x, y), atol=1e-6)


def platform_and_bars(mechanism, word, cut):
    """Where the bars stand, where they hold the platform at home, and how long they are: from the joints' places."""

    def at(node):
        return mechanism.placement(mechanism.q_home, node).translation[:2]

    count = 3 if cut == "rigid" else 2
    firsts = ["link1", *(f"link{4 + k * (count + 2)}" for k in range(2))]
    seconds = ["link2", *(f"link{5 + k * (count + 2)}" for k in range(2))]
    feet = np.array([at(node) for node in (firsts if word == "RpR" else seconds)])
    lasts = ["link3", *(f"link{6 + k * (count + 2)}" if cut == "rigid" else f"frame{7 + k * 4}" for k in range(2))]
    heads = np.array([at(node) for node in lasts])
    return feet, heads, np.linalg.norm(heads - feet, axis=1)


def test_a_slider_crank_has_two_modes_and_a_parallelogram_both_its_branches():
    """Slider-crank: crank 1, rod 2; a parallelogram folds over into the other of its two branches."""
    crank = np.array([math.cos(0.8), math.sin(0.8)])
    pin_at = np.array([crank[0] + math.sqrt(4.0 - crank[1] ** 2), 0.0])
    mechanism = load(linkages.ring([hinge((0, 0), motor=True), hinge(crank), hinge(pin_at), slide(pin_at, (1, 0))], -1))
    modes = cinegen.assembly_modes(mechanism)
    check(modes)
    ends = sorted(placement.translation[0] for placement in modes.placements("link3"))
    assert len(modes) == 2
    assert ends[1] == pytest.approx(pin_at[0], abs=1e-9)
    assert ends[0] == pytest.approx(crank[0] - math.sqrt(4.0 - crank[1] ** 2), abs=1e-9)
    corners = [np.array([0.0, 0.0]), np.array([0.3, 0.8]), np.array([1.3, 0.8]), np.array([1.0, 0.0])]
    mechanism = load(linkages.ring([hinge(corners[0], motor=True), *map(hinge, corners[1:])]))
    modes = cinegen.assembly_modes(mechanism)
    check(modes)
    assert len(modes) == 2
    assert modes.complete


# --- in space -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("word", ["UpS", "SpS", "SpU", "rUS", "pUS"])
def test_a_platform_on_six_rods_is_recognised_however_they_are_driven(word):
    rng = np.random.default_rng(5)
    mechanism = load(linkages.hexapod(rng, word, cut="rigid" if word == "SpU" else "ball"))
    modes = cinegen.assembly_modes(mechanism)
    check(modes)
    assert modes.complete
    assert modes.counts.real + modes.counts.complex == 40
    assert len(modes) % 2 == 0
    home = mechanism.placement(mechanism.q_home, mechanism.end).homogeneous
    assert min(np.abs(home - pose).max() for pose in poses(modes)) < 1e-7


def test_which_leg_carries_the_tree_and_how_legs_are_cut_does_not_matter():
    found = []
    for more in ({"cut": "ball"}, {"cut": "rigid"}, {"cut": "ball", "hung": (2, 4)}):
        mechanism = load(linkages.hexapod(np.random.default_rng(8), **more))
        modes = cinegen.assembly_modes(mechanism)
        check(modes)
        found.append(poses(modes))
    assert len(found[0]) >= 2
    assert same(found[0], found[1])
    assert same(found[0], found[2])


def test_rods_that_meet_in_pairs_have_sixteen_solutions_on_platform_or_base():
    rng = np.random.default_rng(3)
    feet, heads = linkages.points(rng)
    paired = np.repeat(heads[::2], 2, axis=0)
    first = cinegen.assembly_modes(load(linkages.hexapod(rng, feet=feet, heads=paired)))
    check(first)
    assert "polynomial of degree 16" in first.method
    inverted = cinegen.assembly_modes(load(linkages.hexapod(rng, feet=np.repeat(feet[::2], 2, axis=0), heads=heads)))
    check(inverted)
    assert "polynomial of degree 16" in inverted.method
    for modes in (first, inverted):
        assert modes.counts.real + modes.counts.complex + modes.counts.infinite == 16
        home = modes.mechanism.placement(modes.mechanism.q_home, modes.mechanism.end).homogeneous
        assert min(np.abs(home - pose).max() for pose in poses(modes)) < 1e-7


@pytest.mark.parametrize("linear", [False, True])
def test_a_delta_has_the_two_intersections_of_its_spheres(linear):
    made, knees, heads = linkages.delta(np.random.default_rng(2), linear)
    mechanism = load(made)
    modes = cinegen.assembly_modes(mechanism)
    check(modes)
    assert "2 modes, proved; modes in which it has rotated are not among them" in modes.method
    assert not modes.complete
    home = mechanism.placement(mechanism.q_home, mechanism.end)
    centres, radii = knees - heads, np.linalg.norm(heads - knees, axis=1)  # of the platform's translation
    normal = np.cross(centres[1] - centres[0], centres[2] - centres[0])
    normal /= np.linalg.norm(normal)
    across = 2.0 * (normal @ centres[0]) * normal  # the spheres' other point: home's, mirrored in the centres' plane
    assert np.allclose(np.linalg.norm(across - centres, axis=1), radii)
    found = [placement.translation - home.translation for placement in modes.placements()]
    assert np.allclose(found, [np.zeros(3), across], atol=1e-8)
    assert all(np.allclose(placement.rotation, home.rotation, atol=1e-9) for placement in modes.placements())


def test_a_spherical_platform_has_at_most_eight_modes_and_all_that_newton_finds():
    rng = np.random.default_rng(4)
    mechanism = load(linkages.about_a_point(linkages.spherical_legs(rng, (3, 3, 3)), (0, 0, 0)))
    assert mechanism.mobility == 3
    modes = cinegen.assembly_modes(mechanism)
    check(modes)
    assert modes.complete
    assert modes.counts.real + modes.counts.complex == 8
    assert same(from_many_starts(mechanism, 150), poses(modes), 1e-6)


def test_a_tripod_has_sixteen_solutions_in_two_modes_of_operation():
    """J. Schadlbauer, D. Walter, M. Husty, "The 3-RPS parallel manipulator from an algebraic viewpoint", 2014."""
    mechanism = load(linkages.tripod(np.random.default_rng(1)))
    modes = cinegen.assembly_modes(mechanism)
    check(modes)
    traced(modes)
    assert modes.counts.real + modes.counts.complex == 16
    known = poses(modes)
    for pose in from_many_starts(mechanism, 60):
        assert min(np.abs(pose - other).max() for other in known) < 1e-6


def test_a_mechanism_of_a_family_has_the_same_modes_without_it():
    for made in (linkages.five_bar(np.random.default_rng(3)), linkages.three_legs(np.random.default_rng(2), "RpR")):
        mechanism = load(made)
        known, other = (cinegen.assembly_modes(mechanism, method=method) for method in ("auto", "monodromy"))
        traced(other)
        assert same(poses(known), poses(other))


# --- what can't be, and what is told ------------------------------------------------------------------------------


def test_values_that_leave_nothing_say_what_comes_nearest(robot):
    tssm = robot("tssm")
    modes = cinegen.assembly_modes(tssm, [0.002] * 6)
    assert len(modes) == 0
    assert modes.complete
    assert modes.closest is not None
    assert modes.closest.message
    bar = load(linkages.five_bar(np.random.default_rng(0)))
    apart = cinegen.assembly_modes(bar, [math.pi, 0.0])
    assert (len(apart), apart.complete) == (0, True)
    assert apart.closest.gap > 0.0
    assert "open stay" in apart.closest.message


def test_modes_that_meet_are_said_to():
    """A five-bar with its outer bars in line: both intersections of the circles are one."""
    feet, knees = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[-0.2, 0.7], [1.2, 0.7]])
    legs = [
        [hinge(feet[0], motor=True), hinge(knees[0]), hinge((0.4, 0.7))],
        [hinge(feet[1], motor=True), hinge(knees[1])],
    ]
    mechanism = load(linkages.legged(legs))
    modes = cinegen.assembly_modes(mechanism)
    assert len(modes) >= 1
    assert sum(modes.coincident) == 2 or len(modes) == 2
    for q in modes:
        assert mechanism.closure(q) <= 1e-12
        assert np.allclose(mechanism.placement(q, "link3").translation[:2], (0.4, 0.7), atol=1e-5)


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("planar_3r", None, "has no loops"),
        ("five_bar", [1.0], r"has 2 actuated joints \(joint1, joint3\): 1 values? w"),
        ("five_bar", [1.0, math.nan], "not finite"),
        ("five_bar", ["a", "b"], "no numbers"),
    ],
)
def test_what_makes_no_sense_is_told(robot, name, values, words):
    with pytest.raises(ModesError, match=words):
        cinegen.assembly_modes(robot(name), values)


def test_too_few_motors_leave_a_curve():
    rng = np.random.default_rng(6)
    points = rng.uniform(-1.0, 1.0, (5, 2))
    mechanism = load(linkages.ring([hinge(points[0], motor=True), *map(hinge, points[1:])]))
    assert mechanism.mobility == 2
    with pytest.raises(ModesError, match="a curve of configurations"):
        cinegen.assembly_modes(mechanism)


def test_they_can_be_sent_to_another_process(robot):
    modes = cinegen.assembly_modes(robot("five_bar"))
    copy = pickle.loads(pickle.dumps(modes))
    assert all(np.array_equal(one, other) for one, other in zip(modes, copy, strict=True))
    assert copy.method == modes.method
