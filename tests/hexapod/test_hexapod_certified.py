"""Certificates of a platform's placements, against Newton's method at 50 digits."""

from dataclasses import replace

import mpmath
import numpy as np
from mpmath import mp
from numpy.random import default_rng as rng
from test_hexapod import DIETMAIER_BASE, DIETMAIER_LENGTHS, DIETMAIER_PLATFORM, points, pose, reach

from cinegen.hexapod import TSSM, Hexapod


def refined(base, platform, lengths, placement):
    """(t, R) that fulfil the leg equations to 50 digits, near a placement; by Newton's method in rotation vectors."""
    a, b = (mp.matrix(np.asarray(some, dtype=float).tolist()) for some in (base, platform))
    x, _, z = (mp.matrix(column.tolist()) for column in placement[:3, :3].T)
    z = z / mp.norm(z)
    x = x - (x.T * z)[0] * z
    x = x / mp.norm(x)
    y = mp.matrix([z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]])
    start = mp.matrix([[x[i], y[i], z[i]] for i in range(3)])
    t, v = mp.matrix(placement[:3, 3].tolist()), mp.zeros(3, 1)

    def turned(v):
        angle = mp.norm(v)
        k = mp.matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
        if angle == 0:
            return start
        return start * (mp.eye(3) + mp.sin(angle) / angle * k + (1 - mp.cos(angle)) / angle**2 * (k * k))

    def missing(t, v):
        r = turned(v)
        ends = [r * b[i, :].T + t - a[i, :].T for i in range(6)]
        return mp.matrix([(e.T * e)[0] - mp.mpf(float(lengths[i])) ** 2 for i, e in enumerate(ends)])

    tiny = mp.mpf(10) ** -25
    for _ in range(5):
        here, jacobian = missing(t, v), mp.zeros(6, 6)
        for k in range(6):
            step = mp.zeros(6, 1)
            step[k] = tiny
            jacobian[:, k] = (missing(t + step[:3], v + step[3:]) - here) / tiny
        step = mp.lu_solve(jacobian, -here)
        t, v = t + step[:3], v + step[3:]
    return t, mp.norm(v, mp.inf), mp.norm(missing(t, v), mp.inf)


def assert_enclosed(found):
    base, platform, lengths = found.legs
    with mpmath.workdps(50):
        for placement, certificate in zip(found.placements, found.certificates, strict=True):
            if certificate is not None:
                t, angle, left = refined(base, platform, lengths, placement)
                assert left < 1e-40
                off = max(abs(t[i] - mp.mpf(float(placement[i, 3]))) for i in range(3)) / mp.mpf(float(max(lengths)))
                assert off <= certificate.error < certificate.radius
                assert angle <= 1.01 * certificate.error + mp.mpf(10) ** -40


def test_dietmaiers_forty_modes_are_certified():
    found = Hexapod(DIETMAIER_BASE, DIETMAIER_PLATFORM).modes(DIETMAIER_LENGTHS)
    assert found.certified == len(found.placements) == 40
    assert_enclosed(replace(found, placements=found.placements[:6], coincident=found.coincident[:6]))


def test_placements_are_in_their_boxes():
    base, platform = points(rng(5), "6-3")
    lengths = reach(base, platform, pose(rng(7)))
    found = Hexapod(base, platform).modes(lengths)
    assert found.certified == len(found.placements) > 0
    assert_enclosed(found)


def test_tssm_modes_are_certified():
    base, platform = points(rng(2), "6-3")
    manipulator = TSSM(base, platform[::2])
    found = manipulator.modes(reach(base, platform, pose(rng(3))))
    assert found.certified == len(found.placements) > 0
    assert_enclosed(found)


def test_what_is_no_placement_is_not_certified():
    base, platform = points(rng(5), "general")
    found = Hexapod(base, platform).modes(reach(base, platform, pose(rng(7))))
    off = found.placements.copy()
    off[:, :3, 3] += 1e-3
    assert replace(found, placements=off).certified == 0
    assert replace(found, legs=(base, platform, found.legs[2] + 1e-3)).certified == 0
    twice = replace(found, placements=found.placements[[0, 0]], coincident=np.ones(2, dtype=np.int64))
    assert twice.certified == 1
    assert replace(found, legs=None).certified == 0


def test_double_placements_are_never_certified():
    """A level triangle above its base, rotated by 90 degrees (Fichter), with numbers that are exact."""
    base = np.array([[2.0, 0.0, 0], [-2.0, 0.0, 0], [0, 2.0, 0], [0, -2.0, 0], [2.0, 2.0, 0], [-2.0, -2.0, 0]])
    platform = base / 2.0
    home = np.eye(4)
    home[2, 3] = 3.0
    home[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    lengths = reach(base, platform, home)
    found = Hexapod(rng(1).normal(size=(6, 3)), rng(2).normal(size=(6, 3))).modes(np.ones(6) * 3.0)
    fake = replace(found, placements=home[None], coincident=np.ones(1, dtype=np.int64), legs=(base, platform, lengths))
    assert fake.certified == 0
