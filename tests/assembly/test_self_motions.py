"""Mechanisms that move with their actuated joints locked: the components are found, and nothing is called complete."""

import math

import numpy as np
import pytest
from assembled import apart, closings, home, places, sound
from linkages import delta, hexapod, hinge, legged, points, ring, slide, spherical_legs, universal
from numpy.random import default_rng as rng

import cinegen
from cinegen.assembly import AssemblyModes, assembly_modes
from cinegen.assembly.linkage import Linkage
from cinegen.assembly.self_motions import SelfMotions

STARTS = 25


def moves(modes: AssemblyModes) -> list[tuple[int, int | None]]:
    """Dimension and degree of each self-motion; asserts that each is a closed configuration, and moves on."""
    m = modes.mechanism
    linkage = Linkage(m)
    for motion in modes.self_motions:
        q = motion.configuration
        assert m.closure(q) <= 1e-12
        assert np.allclose([q[m.q_index(name)] for name in m.actuated], modes.actuated, rtol=0.0, atol=1e-15)
        assert SelfMotions(linkage, linkage.locked_values(q)).dimension(linkage.unknowns(q)) == motion.dimension
        assert motion.moving
        assert not set(motion.moving) & set(m.actuated)
    return [(motion.dimension, motion.degree) for motion in modes.self_motions]


def unlisted(modes: AssemblyModes) -> list[np.ndarray]:
    """Configurations that random closings find and that are not listed."""
    known = [places(modes.mechanism, q) for q in modes]
    return [q for q in closings(modes, STARTS) if apart(places(modes.mechanism, q), known) > 1e-5]


def on_self_motions(modes: AssemblyModes, configurations: list[np.ndarray]) -> bool:
    """Whether configurations lie on self-motions."""
    linkage = Linkage(modes.mechanism)
    search = SelfMotions(linkage, linkage.locked_values(modes[0] if len(modes) else configurations[0]))
    return all(search.dimension(linkage.unknowns(q)) > 0 for q in configurations)


def four_bar(crank, coupler, rocker, ground):
    """A four-bar on the x axis, its crank at 1 rad at home."""
    a, d = crank * np.array([math.cos(1.0), math.sin(1.0)]), np.array([ground, 0.0])
    way = d - a
    far = math.hypot(*way)
    along = (coupler**2 - rocker**2 + far**2) / (2.0 * far)
    b = a + along * way / far + math.sqrt(coupler**2 - along**2) * np.array([-way[1], way[0]]) / far
    return ring([hinge([0.0, 0.0], motor=True), hinge(a), hinge(b), hinge(d)])


# --- in a plane -----------------------------------------------------------------------------------------------------


def test_the_end_of_a_peaucellier_linkage_swings_where_the_corners_of_its_rhombus_meet(root):
    """At any crank: both corners are at one of the two points at their distances from the two pivots, and the end is on
    a circle about them."""
    m = cinegen.load(root / "tests/robots/data/peaucellier.raff")
    q, joints = m.q_home.copy(), [m.q_index(name) for name in m.joints]
    _, ca, cb, oa, ob, ad, bd = joints
    q[cb], q[ob] = q[ca], q[oa]
    for swung in (-1.0, 0.3, 2.0):
        q[ad] = q[bd] = swung
        assert m.closure(q) < 1e-12
    for crank in (0.0, 0.2):
        modes = assembly_modes(m, home(m) + crank)
        sound(modes, count=4)
        assert all(modes.isolated)
        assert moves(modes) == [(1, 2), (1, 2)]
        assert {motion.moving for motion in modes.self_motions} == {("joint6", "joint7")}
        assert (modes.complete, modes.trace_test) == (False, True)
        assert "not excluded" in modes.method
        corners = [q[oa] for q in (motion.configuration for motion in modes.self_motions)]
        assert abs(corners[0] - corners[1]) > 0.1
        others = unlisted(modes)
        assert others
        assert on_self_motions(modes, others)


def test_curves_are_found_whole_whichever_planes_are_drawn(root):
    """Planes far from a curve, in relation to its extent, would seldom permute its points."""
    m = cinegen.load(root / "tests/robots/data/peaucellier.raff")
    linkage = Linkage(m)
    for seed in range(4):
        search = SelfMotions(linkage, linkage.locked_values(m.q_home))
        search._rng = rng(seed)
        motions = search.through(list(search.random_solutions()[1]))
        assert [(motion.dimension, motion.degree) for motion in motions] == [(1, 2)] * 2


def test_a_flat_parallelogram_is_a_double_mode_and_moves_only_infinitesimally(built):
    m = built(four_bar(0.5, 1.0, 0.5, 1.0))
    flat = assembly_modes(m, home(m) - 1.0)
    sound(flat, count=1)
    assert (flat.coincident, flat.isolated, flat.complete, moves(flat)) == ((2,), (True,), True, [])
    assert not unlisted(flat)


def test_a_platform_like_its_base_translates_on_equal_legs_and_has_isolated_modes_too(built):
    """3-RPR with one triangle as base and platform: a circular translation."""
    p, along = np.array([[0.0, 0.0], [1.0, 0.0], [0.4, 0.8]]), np.array([0.3, 0.6])
    m = built(legged([[hinge(f), slide(f + 0.5 * along, along, True), hinge(f + along)] for f in p]))
    modes = assembly_modes(m)
    assert moves(modes) == [(1, 2)]
    (translation,) = modes.self_motions
    assert len(translation.moving) == 6
    assert {translation: 1}[translation] == 1  # a key, as what it holds is not compared
    assert not modes.complete
    kept = [q for q, alone in zip(modes, modes.isolated, strict=True) if alone]
    others = [q for q in unlisted(modes) if apart(places(m, q), [places(m, mode) for mode in kept]) > 1e-5]
    assert on_self_motions(modes, others)


def test_a_curve_on_which_a_dyad_stays_stretched_is_not_excluded(built):
    """The same translation with a fourth, passive leg of two bars, as long as the others: a double curve, as the elbow
    could move infinitesimally all along it."""
    p, along = np.array([[0.0, 0.0], [1.0, 0.0], [0.4, 0.8]]), np.array([0.3, 0.6])
    legs = [[hinge(f), slide(f + 0.5 * along, along, True), hinge(f + along)] for f in p]
    stretched = [hinge([0.7, 0.4] + part * along) for part in (0.0, 0.5, 1.0)]
    modes = assembly_modes(built(legged([*legs, stretched])))
    assert not modes.complete
    assert "not excluded: modes and self-motions" in modes.method


# --- in space -------------------------------------------------------------------------------------------------------


def test_a_delta_with_a_platform_like_its_base_moves_on_a_sphere(built):
    legs = []
    for around in 2.0 * math.pi * np.arange(3) / 3.0:
        out = np.array([math.cos(around), math.sin(around), 0.0])
        side, knee, along = np.array([-out[1], out[0], 0.0]), 0.8 * out, np.array([0.1, 0.0, -1.0])
        across = np.cross(side, along)
        forearm = [*universal(knee, side, across), *universal(knee + along, across, side)]
        legs.append([hinge(0.5 * out, side, True), *forearm])
    modes = assembly_modes(built(legged(legs)))
    assert moves(modes) == [(2, None)]
    assert not modes.complete


# --- claims -----------------------------------------------------------------------------------------------------------


def special(r, kind):
    """Mechanisms whose dimensions are drawn from few numbers, so that many are special."""
    if kind == "four-bar":
        lengths = r.choice([0.5, 1.0], 4) if r.random() < 0.7 else r.uniform(0.6, 1.0, 4)
        return four_bar(*lengths) if abs(lengths[1] - lengths[2]) < 0.5 else four_bar(1.0, 0.7, 0.7, 1.0)
    if kind == "spherical":
        return ring([hinge(d, d, k == 0) for k, d in enumerate(spherical_legs(r, [4])[0])])
    return delta(r)[0]


@pytest.mark.parametrize("kind", ["four-bar", "spherical", "delta"])
def test_what_is_called_complete_leaves_nothing_to_random_closings(built, kind):
    r = rng(0)
    m = built(special(r, kind))
    for _ in range(4):
        steps = np.array(
            [r.uniform(-0.5, 0.5) if m.is_prismatic(n) else r.choice([-1.0, 0.0, r.normal()]) for n in m.actuated]
        )
        modes = assembly_modes(m, home(m) + (0.2 * steps if kind == "delta" else steps))
        if modes.complete:
            assert not modes.self_motions
            assert all(modes.isolated)
            assert not unlisted(modes)
        elif not modes.trace_test and modes.self_motions:
            assert on_self_motions(modes, [q for q, alone in zip(modes, modes.isolated, strict=True) if not alone])


# --- known self-motions -----------------------------------------------------------------------------------------------
# Self-motions that the literature knows: each is found, is the one that is known, and nothing is called complete.


HALF_TURN = np.diag([-1.0, -1.0, 1.0])  # about z


def moved(m: cinegen.Mechanism, q: np.ndarray) -> np.ndarray:
    """(4, 4) the displacement of the tool from home to q, in the world."""
    return (m.placement(q, "tool") * m.placement(m.q_home, "tool").inverse()).homogeneous


# --- platforms on six legs ------------------------------------------------------------------------------------------


def test_a_platform_moves_as_the_half_turn_of_its_base_about_a_line(built):
    """E. Borel and R. Bricard, "Mémoire sur les déplacements à trajectoires sphériques", 1908 and 1906; M. Gallet,
    G. Nawratil, J. Schicho, J. Selig, "Mobile icosapods", 2017. A half-turn about any line brings M as near to m as m
    to M: three pairs of legs constrain its line, of four parameters, three times."""
    base, platform = rng(0).uniform(-1.0, 1.0, (2, 3, 3))
    platform[:, 2] += 1.0
    feet, heads = np.vstack([base, platform]), np.vstack([platform, base]) @ HALF_TURN
    m = built(hexapod(rng(1), "UpS", feet, heads))
    modes = assembly_modes(m)
    assert moves(modes) == [(1, 12)]
    assert not modes.complete
    turned = moved(m, modes.self_motions[0].configuration) @ np.diag([-1.0, -1.0, 1.0, 1.0])
    assert turned @ turned == pytest.approx(np.eye(4), abs=1e-9)
    assert np.trace(turned) == pytest.approx(0.0, abs=1e-9)  # a half-turn about another line
    assert np.abs(turned - np.diag([-1.0, -1.0, 1.0, 1.0])).max() > 0.01


def test_bricards_plane_symmetric_octahedron_is_flexible(built):
    """R. Bricard, "Mémoire sur la théorie de l'octaèdre articulé", J. math. pures et appliquées 3, 1897. One face is
    the base, the opposite one the platform, and Merlet's determinant vanishes."""
    r = rng(0)
    base = r.uniform(-1.0, 1.0, (3, 3))
    base[2, 0] = 0.0  # two pairs of vertices are mirrored, and two vertices are in the plane
    platform = np.vstack([base[:2] * [-1.0, 1.0, 1.0], [0.0, *r.uniform(-1.0, 1.0, 2)]])
    pairs = [(i, j) for i in range(3) for j in range(3) if i != j]
    m = built(hexapod(rng(1), "UpS", np.array([base[i] for i, _ in pairs]), np.array([platform[j] for _, j in pairs])))
    modes = assembly_modes(m)
    assert moves(modes) == [(1, 12)]
    assert not modes.complete
    known = [places(m, q, ["tool"]) for q in modes]  # the isolated ones, too, though no root shows them
    assert on_self_motions(modes, [q for q in closings(modes, 25) if apart(places(m, q, ["tool"]), known) > 1e-5])
    motion = moved(m, modes.self_motions[0].configuration)
    corners = platform @ motion[:3, :3].T + motion[:3, 3]
    assert np.abs(corners - platform).max() > 0.01
    middle, across = 0.5 * (base + corners), corners - base
    normal = across[0] / np.linalg.norm(across[0])
    assert np.cross(across[1], normal) == pytest.approx(np.zeros(3), abs=1e-9)
    in_plane = np.array([middle[1], base[2], corners[2]]) - middle[0]
    assert in_plane @ normal == pytest.approx(np.zeros(3), abs=1e-9)


def test_a_platform_that_is_as_its_base_is_controlled_although_its_legs_are_parallel_at_home(built, recwarn):
    """Rotated, the lines of its legs are independent."""
    feet = points(rng(0))[0]
    m = built(hexapod(rng(0), feet=feet, heads=np.add(feet, [0.1, -0.2, 0.9])))
    assert (m.uncontrolled, m.dependent, [str(each.message) for each in recwarn]) == ((), (), [])
