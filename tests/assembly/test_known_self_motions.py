"""Self-motions that the literature knows: each is found, is the one that is known, and nothing is called complete."""

import math
from dataclasses import replace

import numpy as np
import pytest
from assembled import apart, closings, places
from linkages import direction, hexapod, hinge, points, ring
from making import TOOL, Mechanism
from numpy.random import default_rng as rng
from test_self_motions import moves, on_self_motions

import cinegen
from cinegen.assembly import ModesError, assembly_modes

HALF_TURN = np.diag([-1.0, -1.0, 1.0])  # about z


def moved(m: cinegen.Mechanism, q: np.ndarray) -> np.ndarray:
    """(4, 4) the displacement of the tool from home to q, in the world."""
    return (m.placement(q, "tool") * m.placement(m.q_home, "tool").inverse()).homogeneous


def elsewhere(mechanism: Mechanism, m: cinegen.Mechanism, step: float) -> Mechanism:
    """The same mechanism in another closed configuration, its actuated joint moved by a step from home."""
    r, (motor,) = rng(5), m.actuated
    while True:
        values = dict(zip(m.joints, r.uniform(-math.pi, math.pi, len(m.joints)), strict=True))
        try:
            q = m.close(m.configuration(values | {motor: m.q_home[m.q_index(motor)] + step}), locked=motor)
            break
        except cinegen.ClosureError:
            continue
    bodies = []
    for body in mechanism.bodies:
        node = "tool" if body.number == TOOL else f"{'frame' if body.kind is None else 'link'}{body.number}"
        bodies.append(replace(body, place=m.placement(q, node).homogeneous))
    return replace(mechanism, bodies=tuple(bodies))


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


@pytest.mark.parametrize("symmetry", ["line", "plane"])
def test_bricards_octahedra_are_flexible(built, symmetry):
    """R. Bricard, "Mémoire sur la théorie de l'octaèdre articulé", J. math. pures et appliquées 3, 1897. One face is
    the base, the opposite one the platform, and Merlet's determinant vanishes."""
    r = rng(0)
    base = r.uniform(-1.0, 1.0, (3, 3))
    platform = base @ HALF_TURN
    if symmetry == "plane":  # two pairs of vertices are mirrored, and two vertices are in the plane
        base[2, 0] = 0.0
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
    if symmetry == "line":
        along = np.cross(across[0], across[1]) / np.linalg.norm(np.cross(across[0], across[1]))
        assert across @ along == pytest.approx(np.zeros(3), abs=1e-9)
        assert np.cross(middle[1:] - middle[0], along) == pytest.approx(np.zeros((2, 3)), abs=1e-9)
    else:
        normal = across[0] / np.linalg.norm(across[0])
        assert np.cross(across[1], normal) == pytest.approx(np.zeros(3), abs=1e-9)
        in_plane = np.array([middle[1], base[2], corners[2]]) - middle[0]
        assert in_plane @ normal == pytest.approx(np.zeros(3), abs=1e-9)


def test_a_platform_that_is_as_its_base_is_controlled_although_its_legs_are_parallel_at_home(built, recwarn):
    """Rotated, the lines of its legs are independent (numpy)."""
    feet, shift = points(rng(0))[0], [0.1, -0.2, 0.9]
    m = built(hexapod(rng(0), feet=feet, heads=feet + shift))
    assert (m.uncontrolled, m.dependent, [str(each.message) for each in recwarn]) == ((), (), [])
    c, s = math.cos(0.7), math.sin(0.7)
    legs = (
        feet
        @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        @ np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
        + shift
        - feet
    )
    assert np.linalg.matrix_rank(np.c_[legs, np.cross(feet, legs)], tol=1e-3) == 6


# --- rings ------------------------------------------------------------------------------------------------------------


def test_bricards_line_symmetric_loop_moves_at_one_value_of_a_seventh_joint(built):
    """R. Bricard, "Leçons de cinématique" II, 1927: six axes, three of them half-turns of the others. A seventh, which
    is actuated, is in one of its links; at other values six axes are general and the modes are isolated."""
    r, cut, step = rng(0), 3, 0.4
    axes = [(r.uniform(-1.0, 1.0, 3), direction(r)) for _ in range(3)]
    axes += [(HALF_TURN @ point, HALF_TURN @ along) for point, along in axes]
    joints = [hinge(point, along) for point, along in axes]
    joints.insert(1, hinge(r.uniform(-1.0, 1.0, 3), direction(r), True))
    linkage = ring(joints, cut)
    with pytest.raises(ModesError, match="with its actuated joints locked it still moves, with 1 DoF"):
        assembly_modes(built(linkage))  # whose home is on this motion
    m = built(elsewhere(linkage, built(linkage), step))
    (motor,) = m.actuated
    value = m.q_home[m.q_index(motor)]
    modes = assembly_modes(m, [value - step])
    assert moves(modes) == [(1, 12)]
    assert not modes.complete
    for q in [motion.configuration for motion in modes.self_motions]:
        nodes = ["link1", "link3", "frame8", "link4", "link5", "link6"]
        z = np.array([m.placement(q, node).rotation[:, 2] for node in nodes])
        for k in range(3):  # opposite angles are equal
            assert z[k] @ z[k + 2] == pytest.approx(z[k + 3] @ z[(k + 5) % 6], abs=1e-9)
    for other in (0.0, -0.399):
        modes = assembly_modes(m, [value + other])
        assert moves(modes) == []
        assert len(modes)
        assert all(modes.isolated)
