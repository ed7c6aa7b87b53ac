"""All modes of random 6-3 platforms, found again by walking round a circle and looking for changes of sign.

Nothing of the package is used for that: the platform points' circles come from base points and lengths, spheres about
a point of one circle meet the other two, and the third distance is looked at. Each of the three circles is walked in
turn, as modes hide from one walk where two of its branches end.

    CINEGEN_SCANS=1000 pytest tests/hexapod/test_tssm_scan.py

compares so many platforms of each kind.
"""

import os

import numpy as np
import pytest

from cinegen.hexapod import TSSM

SCANS = int(os.environ.get("CINEGEN_SCANS", "6"))
PLACES = 1440  # on a circle
SIDES = ((0, 1), (0, 2), (1, 2))


# --- the slow way ---------------------------------------------------------------------------------------------------


def scan(base, platform, legs, lengths):
    """(n, 3, 3) all triples of platform points that are found; those nearer than 1e-6 to another only once."""
    circles = [circle(base[legs == k], lengths[legs == k]) for k in range(3)]
    if any(c is None for c in circles):
        return np.empty((0, 3, 3))
    side = {pair: np.linalg.norm(platform[pair[0]] - platform[pair[1]]) for pair in SIDES}
    starts = [walk(circles, side, first) for first in range(3)]
    found = newton(circles, side, np.concatenate(starts))
    points = np.stack([at(c, p) for c, p in zip(circles, found.T, strict=True)], axis=1)
    kept: list[int] = []
    for i in range(len(points)):
        if all(np.abs(points[i] - points[j]).max() > 1e-6 * lengths.max() for j in kept):
            kept.append(i)
    return points[kept]


def circle(base, lengths):
    (a, b), (r, s) = base, lengths
    d = np.linalg.norm(b - a)
    u = (b - a) / d
    x = (r * r - s * s + d * d) / (2.0 * d)
    if r * r < x * x:
        return None
    e = np.cross(u, np.eye(3)[np.argmin(np.abs(u))])
    e /= np.linalg.norm(e)
    return a + x * u, np.sqrt(r * r - x * x) * e, np.sqrt(r * r - x * x) * np.cross(u, e)


def at(c, p):
    return c[0] + np.cos(p)[..., None] * c[1] + np.sin(p)[..., None] * c[2]


def meet(c, point, distance):
    """(2, n) angles at which the circle is at a distance from points (n, 3); not numbers where it is not."""
    d = c[0] - point
    a, b = 2.0 * d @ c[1], 2.0 * d @ c[2]
    g = distance**2 - (d * d).sum(axis=-1) - c[1] @ c[1]
    with np.errstate(invalid="ignore", divide="ignore"):
        half = np.arccos(g / np.hypot(a, b))
    return np.arctan2(b, a) + np.array([half, -half])


def walk(circles, side, first):
    """(n, 3) angles near solutions: where a residual changes its sign or comes near zero, all round a circle."""
    one, two = (k for k in range(3) if k != first)
    p = np.linspace(0.0, 2.0 * np.pi, PLACES + 1) + 0.123
    here = at(circles[first], p)
    found = []
    for x in meet(circles[one], here, side[tuple(sorted((first, one)))]):
        for y in meet(circles[two], here, side[tuple(sorted((first, two)))]):
            gap = np.linalg.norm(at(circles[one], x) - at(circles[two], y), axis=1) - side[one, two]
            known = np.isfinite(gap)
            change = np.flatnonzero(known[:-1] & known[1:] & (gap[:-1] * gap[1:] <= 0.0))
            size = np.abs(gap)
            with np.errstate(invalid="ignore"):
                low = 1 + np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:]))
            ends = np.flatnonzero(known & ~(np.roll(known, 1) & np.roll(known, -1)))  # of a branch
            ends = np.concatenate([ends, np.flatnonzero(known)[:1], np.flatnonzero(known)[-1:]])
            for i in np.unique(np.concatenate([change, change + 1, low, ends])):
                row = np.empty(3)
                row[[first, one, two]] = p[i], x[i], y[i]
                found.append(row)
    return np.array(found).reshape(-1, 3)


def newton(circles, side, p):
    """Of the angles p (n, 3), those from which Newton's method, damped, comes to a solution, and there."""
    p = p.copy()
    for _ in range(60):
        points = [at(c, x) for c, x in zip(circles, p.T, strict=True)]
        ways = [-np.sin(x)[:, None] * c[1] + np.cos(x)[:, None] * c[2] for c, x in zip(circles, p.T, strict=True)]
        f, j = np.zeros((len(p), 3)), np.zeros((len(p), 3, 3))
        for row, (a, b) in enumerate(SIDES):
            d = points[a] - points[b]
            f[:, row] = (d * d).sum(axis=1) - side[a, b] ** 2
            j[:, row, a], j[:, row, b] = 2.0 * (d * ways[a]).sum(axis=1), -2.0 * (d * ways[b]).sum(axis=1)
        jt = np.swapaxes(j, 1, 2)
        damping = 1e-14 * np.einsum("nij,nij->n", j, j) + 1e-300
        step = np.linalg.solve(jt @ j + damping[:, None, None] * np.eye(3), jt @ f[:, :, None])[:, :, 0]
        p -= step * np.minimum(1.0, 0.1 / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
    scale = max(side.values()) ** 2 + max(c[1] @ c[1] for c in circles)
    return p[np.abs(f).max(axis=1) <= 1e-14 * scale]


# --- against the fast one -------------------------------------------------------------------------------------------


def compare(base, platform, legs, lengths):
    """Modes and scan agree; returns the modes."""
    tssm = TSSM(base, platform, legs)
    modes = tssm.modes(lengths)
    assert modes.complete, modes.method
    assert modes.counts.total == 16
    assert np.abs(tssm.lengths(modes.placements) - lengths).max(initial=0.0) <= 1e-12 * lengths.max()
    mine = platform @ np.swapaxes(modes.placements[:, :3, :3], 1, 2) + modes.placements[:, None, :3, 3]
    gaps = np.abs(mine[:, None] - mine[None]).max(axis=(2, 3)) / lengths.max() + np.eye(len(mine))
    assert gaps.min(initial=1.0) > 1e-7  # no two the same
    theirs = scan(base, platform, legs, lengths)
    apart = np.abs(theirs[:, None] - mine[None]).max(axis=(2, 3)) / lengths.max()
    # where modes meet, lengths say where they are to the square root of what they are known to
    near = np.where(modes.coincident == 1, 3e-6, 3e-5)
    assert (apart <= near).any(axis=1).all(), "found by the scan only"
    alone = (modes.coincident == 1) & (gaps.min(axis=1, initial=1.0) > 1e-2)  # the scan takes steps
    assert (apart[:, alone] <= 1e-6).any(axis=0).all(), "not found by the scan"
    return modes


def pose(rng):
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    placement = np.eye(4)
    placement[:3, :3], placement[:3, 3] = q * np.linalg.det(q), rng.normal(size=3)
    return placement


def reach(base, platform, legs, placement):
    return np.linalg.norm((platform @ placement[:3, :3].T + placement[:3, 3])[legs] - base, axis=1)


def anything(rng, height):
    base = rng.normal(size=(6, 3)) * [1.0, 1.0, height]
    return base, rng.normal(size=(3, 3)), rng.permutation([0, 0, 1, 1, 2, 2])


def plane(rng):
    drawn = anything(rng, 0.0)
    return *drawn, reach(*drawn, pose(rng))


def space(rng):
    drawn = anything(rng, 0.7)
    return *drawn, reach(*drawn, pose(rng))


def regular(rng):
    """Three symmetries, and equal lengths."""
    at, there = np.radians([70, 110, 190, 230, 310, 350]), np.radians([90, 210, 330])
    base = 2.0 * np.stack([np.cos(at), np.sin(at), 0.0 * at], axis=1)
    platform = rng.uniform(0.5, 1.5) * np.stack([np.cos(there), np.sin(there), 0.0 * there], axis=1)
    return base, platform, np.array([0, 0, 1, 1, 2, 2]), np.full(6, rng.uniform(1.0, 3.0))


def parallel(rng):
    """Circles in parallel planes: some solutions are at infinity."""
    base = rng.normal(size=(6, 3)) * [1.0, 1.0, rng.choice([0.0, 1.0])]
    base[1::2] = base[::2] + rng.uniform(0.5, 1.5, (3, 1)) * [1.0, 0.0, 0.0]
    drawn = base, rng.normal(size=(3, 3)), np.array([0, 0, 1, 1, 2, 2])
    return *drawn, reach(*drawn, pose(rng))


@pytest.mark.parametrize("kind", [plane, space, regular, parallel])
def test_all_modes_are_those_of_a_scan(kind):
    rng = np.random.default_rng(1)
    for _ in range(SCANS):
        modes = compare(*kind(rng))
        assert (modes.counts.infinite > 0) == (kind is parallel)
