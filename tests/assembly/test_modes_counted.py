"""Assembly modes of mechanisms that are well known, against what is known of each: circles, spheres, polynomials."""

import linkages
import numpy as np
import pinocchio as pin
import pytest
from assembled import alike, apart, home, nothing_beside, places, sound, traced
from linkages import Z, hexapod, hinge, legged, points, ring, slide
from making import direction
from numpy.random import default_rng as rng

import cinegen
from cinegen.assembly import assembly_modes
from cinegen.hexapod import Hexapod


def circles(a, b, r, s):
    """The points that are at r from a and at s from b."""
    along, d = (b - a) / np.linalg.norm(b - a), np.linalg.norm(b - a)
    x = (d * d + r * r - s * s) / (2.0 * d)
    if r * r < x * x:
        return []
    across = np.array([-along[1], along[0]]) * np.sqrt(r * r - x * x)
    return [a + x * along + across, a + x * along - across]


def turned(angle, point, about):
    c, s = np.cos(angle), np.sin(angle)
    return about + np.array([[c, -s], [s, c]]) @ (point - about)


def on_the_circle(function, degree):
    """The real angles where a trigonometric polynomial of at most this degree is zero: roots of modulus 1."""
    count = 2 * degree + 2
    values = np.array([function(2.0 * np.pi * k / count) for k in range(count)])
    coefficients = np.roll(np.fft.fft(values) / count, degree)[: 2 * degree + 1][::-1]
    kept = np.flatnonzero(np.abs(coefficients) > 1e-11 * np.abs(coefficients).max())
    roots = np.roots(coefficients[kept[0] : kept[-1] + 1])
    return np.angle(roots[np.abs(np.abs(roots) - 1.0) < 1e-6]), len(roots)


# --- two modes ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("seed", "cut"), [(0, "rigid"), (1, "joint")])
def test_a_five_bars_modes_are_where_two_circles_meet(built, seed, cut):
    mechanism = linkages.five_bar(rng(seed), cut)
    m = built(mechanism)
    first_foot, first, middle, second_foot, second = (body.place[:2, 3] for body in mechanism.bodies[:5])
    for shift in ([0.0, 0.0], [0.3, -0.2], [2.0, -1.0], [-0.9, 1.4]):
        modes = assembly_modes(m, home(m) + shift)
        first_knee, second_knee = turned(shift[0], first, first_foot), turned(shift[1], second, second_foot)
        expected = circles(first_knee, second_knee, np.linalg.norm(middle - first), np.linalg.norm(middle - second))
        seen = sound(modes, ["link3"], len(expected))
        assert modes.complete
        alike([s[0, :2, 3] for s in seen], expected, 1e-9)
        assert (modes.closest is None) == bool(expected)


def test_a_parallelogram_is_also_an_antiparallelogram(built):
    p = np.array([[0.0, 0.0], [0.3, 0.8], [1.3, 0.8], [1.0, 0.0]])
    m = built(ring([hinge(p[0], motor=True), *map(hinge, p[1:])]))
    for method in ("auto", "monodromy"):
        modes = assembly_modes(m, home(m) + 0.4, method)
        turns = [places(m, q, ["tool"])[0, :3, :3] - places(m, m.q_home, ["tool"])[0, :3, :3] for q in modes]
        sound(modes, count=2)
        if method == "monodromy":
            traced(modes)
            assert "in 2 sets that no closed path has joined" in modes.method
        else:
            assert modes.complete
            assert "sets" not in modes.method
        assert np.abs(turns[0]).max() < 1e-12 < 1e-2 < np.abs(turns[1]).max()


@pytest.mark.parametrize("seed", range(2))
def test_a_spherical_four_bars_modes_are_where_two_cones_meet(built, seed):
    """The coupler's second axis, between the crank's and the base's."""
    legs = linkages.spherical_legs(rng(seed), (2, 2))
    m = built(linkages.about_a_point(legs, [0, -1]))
    modes = assembly_modes(m, home(m) + 0.1)
    a, b, c = pin.exp3(0.1 * legs[0][0]) @ legs[0][1], legs[1][0], legs[1][1]
    first, second, k = legs[0][1] @ c, b @ c, a @ b
    part = np.array([first - second * k, second - first * k]) / (1.0 - k * k)
    square = 1.0 - first * part[0] - second * part[1]
    assert modes.complete
    if square < 0.0:
        sound(modes, count=0)
        return
    normal = np.cross(a, b) * np.sqrt(square / (1.0 - k * k))
    expected = [part[0] * a + part[1] * b + sign * normal for sign in (1.0, -1.0)]
    local = places(m, m.q_home, ["tool"])[0, :3, :3].T @ c
    seen = sound(modes, ["tool"], 2)
    alike([s[0, :3, :3] @ local for s in seen], expected, 1e-9)


@pytest.mark.parametrize(("seed", "linear"), [(0, False), (1, True)])
def test_a_deltas_modes_are_where_three_spheres_meet(built, seed, linear):
    mechanism, knees, heads = linkages.delta(rng(seed), linear)
    m = built(mechanism)
    shift = np.array([0.05, -0.04, 0.03])
    modes = assembly_modes(m, home(m) + shift)
    motors = [b.place for b in mechanism.bodies if "actuated" in b.more]
    if linear:
        moved = [k + s * p[:3, 2] for k, s, p in zip(knees, shift, motors, strict=True)]
    else:
        led = zip(knees, shift, motors, strict=True)
        moved = [p[:3, 3] + pin.exp3(s * p[:3, 2]) @ (k - p[:3, 3]) for k, s, p in led]
    centres = np.array(moved) - (heads - heads[0])  # of the first head
    squares = ((heads - knees) ** 2).sum(axis=1)
    rows = 2.0 * (centres[1:] - centres[0])
    right = (centres[1:] ** 2).sum(axis=1) - (centres[0] ** 2).sum() - squares[1:] + squares[0]
    foot, along = np.linalg.lstsq(rows, right, rcond=None)[0], np.cross(rows[0], rows[1])
    along /= np.linalg.norm(along)
    away = foot - centres[0]
    reach = np.sqrt((away @ along) ** 2 - away @ away + squares[0])
    expected = [foot + (sign * reach - away @ along) * along for sign in (1.0, -1.0)]
    start = places(m, m.q_home, ["tool"])[0]
    seen = sound(modes, ["tool"], 2)
    alike([s[0, :3, 3] - start[:3, 3] + heads[0] for s in seen], expected, 1e-9)
    assert all(np.abs(s[0, :3, :3] - start[:3, :3]).max() < 1e-9 for s in seen)
    assert not modes.complete
    assert "2 modes, proved; modes in which it has rotated are not among them" in modes.method


# --- three legs in a plane, or about a point ----------------------------------------------------------------------


def planar_poses(feet, heads, lengths):
    """Real poses (angle, x, y) of three bars of these lengths between feet and heads: a sextic in exp(i angle)."""
    a, b = (np.array(p) @ [1.0, 1.0j] for p in (feet, heads))
    a0, b0 = a[0], b[0]
    a, b = a[1:] - a0, b[1:] - b0

    def lines(u):  # conj(c) z + c conj(z) = d, with z where the first head is, from its foot
        c = a - u * b
        return c, np.abs(c) ** 2 + lengths[0] ** 2 - np.array(lengths[1:]) ** 2

    def solved(u):  # z det
        c, d = lines(u)
        return d[0] * c[1] - d[1] * c[0], np.conj(c[0]) * c[1] - np.conj(c[1]) * c[0]

    def closing(angle):
        above, det = solved(np.exp(1j * angle))
        return (np.abs(above) ** 2 - lengths[0] ** 2 * np.abs(det) ** 2).real

    angles, count = on_the_circle(closing, 6)
    poses = []
    for angle in angles:
        above, det = solved(np.exp(1j * angle))
        z = a0 + above / det - np.exp(1j * angle) * b0
        poses.append(np.array([np.cos(angle), np.sin(angle), z.real, z.imag]))
    return poses, count


@pytest.mark.parametrize(("word", "seed"), [("RpR", 0), ("rRR", 1), ("pRR", 0)])
def test_three_legs_in_a_plane_are_a_sextic(built, word, seed):
    mechanism = linkages.three_legs(rng(seed), word)
    m = built(mechanism)
    legs = [[b.place for b in mechanism.bodies if b.kind is not None][3 * i : 3 * i + 3] for i in range(3)]
    for shift in (np.zeros(3), rng(seed).uniform(-0.2, 0.2, 3)):
        feet, heads = [leg[0][:2, 3] for leg in legs], [leg[2][:2, 3] for leg in legs]
        knees = [leg[1][:2, 3] for leg in legs]
        if word == "RpR":
            lengths = [np.linalg.norm(h - f) + s for f, h, s in zip(feet, heads, shift, strict=True)]
        else:
            lengths = [np.linalg.norm(h - k) for k, h in zip(knees, heads, strict=True)]
            along = [leg[0][:2, 2] for leg in legs]
            led = zip(feet, knees, along, shift, strict=True)
            feet = [turned(s, k, f) if word == "rRR" else k + s * d for f, k, d, s in led]
        expected, count = planar_poses(feet, heads, lengths)
        modes = assembly_modes(m, home(m) + shift)
        start = np.linalg.inv(places(m, m.q_home, ["tool"])[0])
        seen = sound(modes, ["tool"], len(expected))
        motions = [s[0] @ start for s in seen]
        alike([np.array([f[0, 0], f[1, 0], f[0, 3], f[1, 3]]) for f in motions], expected)
        assert modes.complete
        assert count == modes.counts.real + modes.counts.complex == 6


def spherical_poses(on_base, on_platform, cosines):
    """Real rotations R with given on_base[i] . R on_platform[i]: an octic, and what comes of eliminating so."""
    (a1, a2, a3), (b1, b2, b3), (c1, c2, c3) = on_base, on_platform, cosines
    c12 = b1 @ b2
    e = np.cross(a1, Z)
    e /= np.linalg.norm(e)
    f = np.cross(a1, e)
    x, y, z = np.linalg.solve(np.column_stack([b1, b2, np.cross(b1, b2)]), b3)

    def parts(angle):  # R b2 n = p + s w, s^2 = square
        v = c1 * a1 + np.sqrt(1.0 - c1 * c1) * (np.cos(angle) * e + np.sin(angle) * f)
        k = v @ a2
        n = 1.0 - k * k
        return v, n, (c12 - c2 * k) * v + (c2 - c12 * k) * a2, np.cross(v, a2), n - c12**2 - c2**2 + 2.0 * c12 * c2 * k

    def third(v, n, p, w):  # a3 . R b3 n - c3 n: what has no s, and what has
        return a3 @ (x * n * v + y * p + z * np.cross(v, p)) - c3 * n, a3 @ (y * w + z * np.cross(v, w))

    def closing(angle):
        v, n, p, w, square = parts(angle)
        even, odd = third(v, n, p, w)
        return even**2 - square * odd**2

    poses = []
    for angle in on_the_circle(closing, 8)[0]:
        v, n, p, w, _ = parts(angle)
        even, odd = third(v, n, p, w)
        second = (p - even / odd * w) / n
        frame = np.column_stack([v, second, np.cross(v, second)])
        poses.append(frame @ np.linalg.inv(np.column_stack([b1, b2, np.cross(b1, b2)])))
    return poses


def test_three_legs_about_a_point_are_an_octic(built):
    legs = linkages.spherical_legs(rng(0), [3, 3, 3])
    m = built(linkages.about_a_point(legs, [0, 0, 0]))
    shift = rng(0).uniform(-0.2, 0.2, 3)
    modes = assembly_modes(m, home(m) + shift)
    on_base = [pin.exp3(s * leg[0]) @ leg[1] for leg, s in zip(legs, shift, strict=True)]
    start = places(m, m.q_home, ["tool"])[0, :3, :3]
    expected = spherical_poses(on_base, [leg[2] for leg in legs], [leg[1] @ leg[2] for leg in legs])
    seen = sound(modes, ["tool"], len(expected))
    alike([s[0, :3, :3] @ start.T for s in seen], expected, 1e-6)
    assert modes.counts.real + modes.counts.complex == 8
    assert modes.complete


# --- rods ---------------------------------------------------------------------------------------------------------


def rods_of(m, modes, word):
    """(modes, 6) lengths of the rods, from where links are."""
    feet, heads = points(rng(3))
    lengths = []
    for q in modes:
        tool, start = places(m, q, ["tool"])[0], places(m, m.q_home, ["tool"])[0]
        moved_heads = (tool @ np.linalg.inv(start) @ np.c_[heads, np.ones(6)].T)[:3].T
        if word[0] not in "rp":
            lengths.append(np.linalg.norm(moved_heads - feet, axis=1))
        else:
            links = [f"link{name[5:]}" for name in m.actuated]
            led = places(m, q, links) @ np.linalg.inv(places(m, m.q_home, links))
            knees = np.einsum("nij,nj->ni", led, np.c_[feet, np.ones(6)])[:, :3]
            lengths.append(np.linalg.norm(moved_heads - knees, axis=1))
    return np.array(lengths), np.linalg.norm(heads - feet, axis=1)


@pytest.mark.parametrize("word", ["UpS", "SpU", "rUS", "rSS", "pSS"])
def test_six_rods_have_forty_modes_of_which_an_even_number_is_real(built, word):
    m = built(hexapod(rng(3), word, *points(rng(3)), cut="rigid" if word == "SpU" else "ball"))
    shift = 0.03 * np.arange(-2.5, 3.0)
    modes = assembly_modes(m, home(m) + shift)
    lengths, asked = rods_of(m, modes, word)
    sound(modes, ["tool"])
    assert len(modes) % 2 == 0 < len(modes)
    assert modes.counts.real + modes.counts.complex == 40
    assert modes.complete
    assert np.abs(lengths - asked - (0.0 if word[0] in "rp" else shift)).max() < 1e-9
    nothing_beside(modes, ["tool"], 10)
    start = places(m, m.q_home, ["tool"])
    assert apart(start, [places(m, q, ["tool"]) for q in assembly_modes(m)]) < 1e-8


@pytest.mark.parametrize("which", ["3-6", "3-3", "6-4"])
def test_rods_that_meet_have_the_modes_of_rods_that_almost_do(built, which):
    feet, heads = points(rng(5))
    two, other = [0, 0, 1, 1, 2, 2], [5, 0, 0, 2, 2, 5]
    ends = {"3-6": (feet[two], heads), "3-3": (feet[two], heads[other]), "6-4": (feet, heads[[0, 0, 2, 2, 4, 5]])}
    feet, heads = ends[which]
    m = built(hexapod(rng(5), "UpS", feet, heads))
    modes = assembly_modes(m)
    seen = sound(modes, ["tool"])
    assert modes.complete
    assert modes.proved == which.startswith("3-")
    start = places(m, m.q_home, ["tool"])[0]
    expected = Hexapod(feet, heads).modes(np.linalg.norm(heads - feet, axis=1)).placements
    alike([s[0] @ np.linalg.inv(start) for s in seen], list(expected), 1e-6)


def test_a_rod_whose_universal_joint_does_not_reach_has_fewer_modes(built):
    feet, heads = points(rng(1))
    legs = []
    for foot, head in zip(feet, heads, strict=True):
        along = head - foot
        skew = np.cross(along, [0.3, 0.5, 0.1]) / 2.0 + along  # no right angle with the rod
        first = np.cross(skew, [0.1, 0.2, 1.0])
        balls = [hinge(head, row) for row in np.linalg.qr(rng(0).normal(size=(3, 3)))[0]]
        legs.append([hinge(foot, first), hinge(foot, skew), slide(foot + 0.4 * along, along, True), *balls])
    m = built(legged(legs, "ball"))
    free = built(hexapod(rng(1), "UpS", feet, heads))
    modes, all_of_them = assembly_modes(m), assembly_modes(free)
    assert modes.complete
    assert "out of reach" in modes.method
    assert 0 < len(modes) < len(all_of_them)
    nothing_beside(modes, ["tool"], 30)


def test_a_tripod_is_a_platform_on_three_pairs_of_rods(built):
    """A jack on a hinge holds its head on the circle that two rods from points of the hinge's axis hold it on."""
    m = built(linkages.tripod(rng(0)))
    modes = assembly_modes(m)
    feet, sides, heads = linkages.tripod_points(rng(0))
    base = np.vstack([[f - 0.2 * s, f + 0.2 * s] for f, s in zip(feet, sides, strict=True)])
    lengths = np.linalg.norm(np.repeat(heads, 2, axis=0) - base, axis=1)
    start = places(m, m.q_home, ["tool"])[0]
    seen = sound(modes, ["tool"])
    expected = Hexapod(base, np.repeat(heads, 2, axis=0)).modes(lengths).placements
    alike([s[0] @ np.linalg.inv(start) for s in seen], list(expected))
    assert modes.counts.real + modes.counts.complex == 16
    traced(modes)


@pytest.mark.parametrize("cut", ["joint", "rigid"])
def test_legs_of_six_revolute_joints_have_up_to_sixteen_configurations_each(built, cut):
    """The platform is fixed at a pose; a leg may be cut at one of its joints."""
    random = rng(3)
    legs = [[hinge(random.uniform(-1.0, 1.0, 3), direction(random), k < 3) for k in range(6)] for _ in range(2)]
    m = built(legged(legs, cut))
    q = m.random_closed(2, seed=1)[-1]
    solutions = cinegen.inverse_kinematics(m, {"tool": m.placement(q, "tool")}, all=True)
    assert solutions.proved
    assert solutions.counts.total == 16 * 16
    assert len(solutions) == solutions.certified == solutions.counts.real
    assert max(map(m.closure, solutions)) < 1e-12
    assert max(map(max, solutions.errors)) < 1e-12
    assert min(m.distance(q, other) for other in solutions) < 1e-9
