"""Linear systems of screws: made from axes, points and planes, moved and scaled, and recognised."""

import math
import re

import numpy as np
import pytest
import varieties
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation

from cinegen.errors import CinegenError
from cinegen.singularities.pluecker import KLEIN, LineFrame, PlueckerError, PlueckerLine, Screw
from cinegen.singularities.screw_system import ScrewSystem

X, Y, Z, HOME = *np.eye(3), np.zeros(3)


def screw(point, direction, pitch=0.0):
    """(6,) the twist about an axis."""
    return np.concatenate([direction, np.cross(point, direction) + pitch * np.asarray(direction)])


def free(direction):
    """(6,) a translation."""
    return np.concatenate([HOME, direction])


P = np.array([0.3, -0.2, 0.5])
TILTED = (X + 2.0 * Z) / np.sqrt(5.0)
SYSTEMS = {  # name: (spanning twists, type of Gibson and Hunt, the text begins, as wrenches it begins)
    "rotation": ([screw(P, TILTED)], "IIA", "a rotation about the axis through", "a force through"),
    "screw": ([screw(P, TILTED, 0.7)], "IIA", "a screw of pitch", "a wrench of pitch"),
    "translation": ([free(TILTED)], "IIB", "a translation along", "a couple about"),
    "pencil of rotations": ([screw(P, X), screw(P, TILTED)], "IIA",
        "any rotation about an axis through the point", "any force along a line through the point"),
    "pencil of screws": ([screw(P, X, 0.4), screw(P, Y, 0.4)], "IIA",
        "any screw of pitch", "any wrench of pitch"),
    "cylindroid": ([screw(P, X, 0.4), screw(P, Y, 0.9)], "IA", "any combination of a screw", "any combination of a wr"),
    "two skew axes": ([screw(P, X), screw(HOME, TILTED)], "IA",
        "any combination of a rotation about the axis through", "any combination of a force through"),
    "cylindrical motion": ([screw(P, TILTED), free(TILTED)], "IB",
        "any rotation about, and any translation along, the li", "any force along, and any couple about, the"),
    "oblique translation": ([screw(P, TILTED, 0.3), free(X)], "IB",
        "any combination of a rotation about the axis", "any combination of a force through"),
    "parallel axes in a plane": ([screw(P, X), screw(P + Y, X)], "IIB",
        "any rotation about an axis parallel to", "any force along a line parallel to"),
    "translations in a plane": ([free(X), free(Y)], "IIC", "any translation normal to", "any couple about an axis"),
    "spherical motion": ([screw(P, X), screw(P, Y), screw(P, TILTED)], "IIA",
        "any rotation about the point", "any force through the point"),
    "screws through a point": ([screw(P, a, -0.2) for a in (X, Y, Z)], "IIA", "any screw of pitch", "any wrench of pi"),
    "three screws": ([screw(P, a, h) for a, h in ((X, 0.1), (Y, 0.5), (Z, 0.9))], "IA",
        "any combination of a screw", "any combination of a wrench"),
    "axes in a plane": ([screw(P, X), screw(P, Y), screw(P + X, Y)], "IIB",
        "any rotation about an axis in the plane with normal", "any force along a line in the plane with normal"),
    "planar motion": ([screw(P, Z), free(X), free(Y)], "IIC",
        "any translation normal to", "any couple about an axis normal to"),
    "rotation and plane": ([screw(P, TILTED), free(X), free(Y)], "IC", "any combination of", "any combination of"),
    "translations": ([free(X), free(Y), free(Z)], "IID", "any translation", "any couple"),
    "Schoenflies motion": ([screw(P, Z), free(X), free(Y), free(Z)], "IIC",
        "any translation, and any rotation about an axis parallel to", "any couple, and any force along a line parall"),
    "all but a force": (null_space((KLEIN @ screw(P, TILTED))[None]).T, "IIA",
        "any motion on which no work is done by a force", "any wrench that does no work on a rotation"),
    "all but a couple": (null_space((KLEIN @ free(Z))[None]).T, "IIB",
        "any translation, and any rotation about an axis normal to", "any couple, and any force along a line normal"),
    "all": (np.eye(6), "", "any motion", "any wrench"),
}  # fmt: skip


def moved(rows, turn, shift, scale):
    """Twists (n, 6) after x -> scale (turn x + shift), in metres."""
    w = rows[:, :3] @ turn.T
    return np.hstack([w, scale * (rows[:, 3:] @ turn.T + np.cross(shift, w))])


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize(("seed", "noise"), [(0, 0.0), (1, 1e-9)])
def test_a_system_is_recognised_wherever_it_is_and_whatever_its_scale(name, seed, noise):
    screws, kind, twists, wrenches = SYSTEMS[name]
    rng = np.random.default_rng(seed)
    scale, turn, shift = 10.0 ** rng.uniform(-2, 2), varieties.rotation(rng), rng.normal(size=3)
    rows = moved(rng.normal(size=(len(screws),) * 2) @ np.asarray(screws), turn, shift, scale)
    rows[:, :3] += noise * rng.normal(size=(len(rows), 3))
    origin = scale * rng.normal(size=3)
    inside = np.hstack([rows[:, :3], (rows[:, 3:] - np.cross(origin, rows[:, :3])) / scale])
    system = ScrewSystem(np.linalg.svd(inside, full_matrices=False)[2], LineFrame(origin, scale), 1e-6)
    assert system.order == len(system) == len(screws)
    assert system.type == kind
    assert system.text().startswith(twists)
    forces = ScrewSystem(system.vectors, LineFrame(origin, scale), 1e-6, wrenches=True)
    assert forces.text().startswith(wrenches)
    assert forces.type == kind
    assert forces.reciprocal.wrenches is False
    # the basis spans the same space, in the world
    units = np.repeat([1.0, 1.0 / scale], 3)
    both = np.vstack([rows * units / np.linalg.norm(rows * units, axis=1, keepdims=True), system.coordinates * units])
    assert np.linalg.matrix_rank(both, tol=1e-6) == len(screws)
    assert np.linalg.matrix_rank(system.coordinates * units, tol=1e-6) == len(screws)
    # reciprocal screws do no work on it, by another null space
    if system.order < 6:
        expected = null_space(rows * units @ KLEIN, rcond=1e-8)
        other = system.reciprocal.coordinates * units
        assert np.linalg.matrix_rank(np.vstack([expected.T, other]), tol=1e-6) == expected.shape[1] == len(other)
        assert system.reciprocal.order == 6 - system.order
        assert system.reciprocal.type == kind or system.order == 3


def test_the_text_names_the_point_the_plane_and_the_axis():
    rng = np.random.default_rng(0)
    turn, point = varieties.rotation(rng), rng.normal(size=3)
    frame = LineFrame(HOME, 1.0)
    a, b, c = turn

    def of(*rows):
        groups = re.findall(r"\(([^()]*,[^()]*)\)", ScrewSystem(np.array(rows), frame, 1e-6).text())
        return np.array([[float(x) for x in group.split(",")] for group in groups])

    vectors = of(screw(point, a), screw(point, b))
    assert vectors[0] == pytest.approx(point, abs=6e-4)
    assert abs(vectors[1] @ c) == pytest.approx(1.0, abs=1e-3)
    vectors = of(screw(point, a), free(a))
    assert np.cross(vectors[0] - point, a) == pytest.approx(HOME, abs=2e-3)
    assert abs(vectors[1] @ a) == pytest.approx(1.0, abs=1e-3)
    assert abs(of(free(a), free(b))[0] @ c) == pytest.approx(1.0, abs=1e-3)
    assert abs(of(screw(point, a), free(b), free(c))[0] @ a) == pytest.approx(1.0, abs=1e-3)


# --- pluecker lines ---------------------------------------------------------------------------------------------------
# Pluecker lines and screws against points and motions: what they are made of, computed without moments.


seeds = st.integers(0, 2**32 - 1)


# --- one line ---------------------------------------------------------------------------------------------------------


@given(seeds, st.floats(1e-6, 1e6))
def test_its_moment_is_that_of_all_its_points(seed, length):
    a, b = length * np.random.default_rng(seed).normal(size=(2, 3))
    line = PlueckerLine.through(a, b)
    assert np.linalg.norm(line.direction) == pytest.approx(1.0)
    for s in (-3.0, 0.0, 0.5, 1.0, 7.0):
        assert np.cross(a + s * (b - a), line.direction) == pytest.approx(line.moment, abs=1e-13 * length)
    assert line.coordinates == pytest.approx(np.hstack([line.direction, line.moment]))
    assert line.point == pytest.approx((a + b) / 2)
    assert line.direction @ (b - a) > 0.0


@pytest.mark.parametrize(("make", "says"), [
    (lambda: PlueckerLine.through([1, 2, 3], [1, 2, 3]), "two points are one"),
    (lambda: PlueckerLine.along([0, 0, 0], [0, 0, 0]), "direction is zero"),
    (lambda: PlueckerLine.along([0, math.nan, 0], [1, 0, 0]), "three finite numbers"),
    (lambda: PlueckerLine.along([0, 0], [1, 0, 0]), "three finite numbers"),
    (lambda: LineFrame.of([], 1.0), "no lines"),
    (lambda: LineFrame.of([PlueckerLine.along([0, 0, 0], [1, 0, 0])], 0.0), "positive"),
])  # fmt: skip
def test_what_makes_no_line_says_why(make, says):
    with pytest.raises(PlueckerError, match=says) as caught:
        make()
    assert isinstance(caught.value, CinegenError)


# --- screws -----------------------------------------------------------------------------------------------------------


@given(seeds, st.floats(-2.0, 2.0))
def test_a_screw_is_the_velocity_of_its_motion(seed, pitch):
    rng = np.random.default_rng(seed)
    axis, step, point = PlueckerLine.through(*rng.normal(size=(2, 3))), 1e-6, rng.normal(size=3)
    screw = Screw(axis, pitch)
    w, v = screw.coordinates[:3], screw.coordinates[3:]
    turn = Rotation.from_rotvec(step * axis.direction).as_matrix()
    moved = axis.point + turn @ (point - axis.point) + pitch * step * axis.direction
    assert (moved - point) / step == pytest.approx(v + np.cross(w, point), abs=2e-5)
    back = LineFrame(np.zeros(3), 1.0).screw(3.0 * screw.coordinates, 1e-9)
    assert back.pitch == pytest.approx(pitch, abs=1e-8)
    assert abs(back.axis.direction @ axis.direction) == pytest.approx(1.0)
    assert back.axis.nearest(axis.point) == pytest.approx(axis.point, abs=1e-9)
