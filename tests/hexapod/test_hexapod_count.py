"""That a hexapod's modes are all it has, by another way: other unknowns, other equations, plain numpy.

Here a pose is a quaternion q of norm 1 and a translation t, the legs' equations are squares of distances, and solutions
are found from a single known pose: lengths go round circles of complex values, and what known solutions have become is
added to them, with the conjugates.
"""

from __future__ import annotations

import numpy as np

from cinegen.hexapod import Hexapod

_STEPS, _CIRCLES = 40, 60


def turned(q, points):
    """(n, 6, 3) points turned by q (n, 4), as a form that is quadratic in q, and (n, 6, 3, 4) its derivatives."""
    w, v = q[:, None, :1], q[:, None, 1:]
    p = points[None]
    inner = (v * p).sum(axis=2, keepdims=True)
    value = (w * w - (v * v).sum(axis=2, keepdims=True)) * p + 2.0 * inner * v + 2.0 * w * np.cross(v, p)
    by_w = 2.0 * w * p + 2.0 * np.cross(v, p)
    unit = np.eye(3)
    by_v = (
        -2.0 * p[..., :, None] * v[..., None, :]
        + 2.0 * v[..., :, None] * p[..., None, :]
        + 2.0 * inner[..., None] * unit
        + 2.0 * w[..., None] * np.cross(unit, p[..., None, :]).swapaxes(-1, -2)
    )
    return value, np.concatenate([by_w[..., None], by_v], axis=3)


class Platform:
    """Its equations for many solutions at once."""

    def __init__(self, base, platform):
        self.base, self.platform = base, platform

    def squares(self, x):
        """(n, 6) of the lengths, and (n, 6, 7) derivatives by q and t."""
        ends, by_q = turned(x[:, :4], self.platform)
        rods = ends + x[:, None, 4:] - self.base
        by_q = 2.0 * np.einsum("nki,nkij->nkj", rods, by_q)
        return (rods * rods).sum(axis=2), np.concatenate([by_q, 2.0 * rods], axis=2)

    def newton(self, x, squares, steps):
        for _ in range(steps):
            value, rows = self.squares(x)
            q = x[:, :4]
            wrong = np.concatenate([value - squares, (q * q).sum(axis=1, keepdims=True) - 1.0], axis=1)
            last = np.concatenate([2.0 * q, np.zeros((len(x), 3))], axis=1)
            change = np.linalg.solve(np.concatenate([rows, last[:, None]], axis=1), wrong[:, :, None])[:, :, 0]
            x = x - change
        return x, np.abs(change).max(axis=1)


def distinct(x):
    """Of (n, 7), where q and -q are one pose."""
    kept = []
    for y in x:
        if all(
            min(np.abs(y - z).max(), np.abs(y + np.r_[z[:4], -z[4:]]).max()) > 1e-6 * (1 + np.abs(y).max())
            for z in kept
        ):
            kept.append(y)
    return np.array(kept)


def test_from_one_pose_lengths_that_go_round_lead_to_the_same_modes():
    rng = np.random.default_rng(1)
    base, platform = rng.normal(size=(2, 6, 3))
    x = rng.normal(size=(1, 7)) + 0j
    x[:, :4] /= np.linalg.norm(x[:, :4])
    equations = Platform(base, platform)
    asked = equations.squares(x)[0][0]
    quiet = 0
    for _ in range(_CIRCLES):
        far = 10.0 ** rng.uniform(0.0, 2.5) * (rng.normal(size=6) + 1j * rng.normal(size=6))
        there, before = x, x
        for i in range(1, _STEPS + 1):
            squares = asked + far * (np.exp(2j * np.pi * i / _STEPS) - 1.0)
            onward = equations.newton(2.0 * there - before, squares, 2)[0]
            near = np.abs(onward).max(axis=1) < 1e6  # others have lost their way
            there, before = onward[near], there[near]
        there, change = equations.newton(there, asked, 6)
        there = there[change < 1e-10]
        found = distinct(np.concatenate([x, there, there.conj()]))
        quiet = quiet + 1 if len(found) == len(x) else 0
        x = found
        if quiet == 3 and len(x) >= 40:
            break
    assert len(x) == 40
    modes = Hexapod(base, platform).modes(np.sqrt(asked.real))
    real = x[np.abs(x.imag).max(axis=1) < 1e-9].real
    assert modes.complete
    assert (modes.counts.real, modes.counts.complex) == (len(real), 40 - len(real))
    turns = turned(real[:, :4], np.eye(3))[0].swapaxes(1, 2)
    for placement in modes.placements:
        apart = np.abs(turns - placement[:3, :3]).max(axis=(1, 2)) + np.abs(real[:, 4:] - placement[:3, 3]).max(axis=1)
        assert apart.min() < 1e-8
