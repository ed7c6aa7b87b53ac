"""The parts: equations 20-22 against vectors, Bezout's matrix and its eigenvalues against solutions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cinegen.hexapod import TSSM
from cinegen.hexapod.elimination import bezout, eigen_directions
from cinegen.hexapod.tssm import TANGENTS, PlatformCircles

seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def drawn(rng, height):
    base = rng.normal(size=(6, 3)) * [1.0, 1.0, height]
    tssm = TSSM(base, rng.normal(size=(3, 3)), rng.permutation([0, 0, 1, 1, 2, 2]))
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    placement = np.eye(4)
    placement[:3, :3], placement[:3, 3] = q * np.linalg.det(q), rng.normal(size=3)
    return tssm, placement, tssm.lengths(placement)


def solved(tssm, lengths):
    """The circles (one set), the equations (3, 3, 3) and the angles (n, 3) of all modes on the circles."""
    circles, equations = tssm.circles([lengths])
    circles = PlatformCircles(*(part[0] for part in circles))
    return circles, equations[0], lambda placements: angles(tssm, circles, placements)


def angles(tssm, circles, placement):
    """(3,) p12, p34, p56 at a placement."""
    points = (tssm.platform @ placement[:3, :3].T + placement[:3, 3])[circles.point] - circles.centre
    return np.arctan2((points * circles.f).sum(axis=1), (points * circles.e).sum(axis=1))


@given(seeds, st.sampled_from([0.0, 0.5]))
def test_equations_20_to_22_are_the_distances(rng, height):
    tssm, placement, lengths = drawn(rng, height)
    circles, equations, angles_at = solved(tssm, lengths)
    p = np.vstack([rng.uniform(-np.pi, np.pi, (20, 3)), angles_at(placement)])
    c, s = np.cos(p), np.sin(p)
    points = circles.centre + circles.radius[:, None] * (c[..., None] * circles.e + s[..., None] * circles.f)
    there = tssm.platform @ placement[:3, :3].T + placement[:3, 3]
    np.testing.assert_allclose(points[-1], there[circles.point], atol=1e-9)
    for leg, point in enumerate(tssm.legs):  # on these circles legs have their lengths
        k = circles.point.tolist().index(point)
        np.testing.assert_allclose(np.linalg.norm(points[:, k] - tssm.base[leg], axis=1), lengths[leg], rtol=1e-10)
    for row, (i, j) in zip(equations, ((0, 1), (0, 2), (1, 2)), strict=True):
        side = tssm.sides[circles.point[i] + circles.point[j] - 1]
        ci, si, cj, sj = c[:, i], s[:, i], c[:, j], s[:, j]
        said = np.einsum("an,ab,bn->n", [ci**0, ci, si], row, [cj**0, cj, sj])
        true = ((points[:, i] - points[:, j]) ** 2).sum(axis=1) - side**2
        unit = (true @ said) / (said @ said)
        assert unit > 0.0
        np.testing.assert_allclose(unit * said, true, atol=1e-10 * np.abs(true).max())
        assert np.abs(row).max() == 1.0
        if height == 0.0:
            assert not row[[0, 2, 1, 2], [2, 0, 2, 1]].any()


@given(seeds, st.sampled_from([0.0, 0.5]))
def test_bezouts_matrix_is_singular_where_20_to_22_hold_and_has_the_tangents_in_its_null_space(rng, height):
    tssm, placement, lengths = drawn(rng, height)
    _, equations, angles_at = solved(tssm, lengths)
    matrices = bezout(TANGENTS @ equations @ TANGENTS.T)
    p = angles_at(placement)
    half = 0.5 * p[1]
    powers = np.sin(half) ** np.arange(5) * np.cos(half) ** np.arange(4, -1, -1)
    matrix = np.einsum("n,nij->ij", powers, matrices)
    tangents = [np.array([np.cos(0.5 * angle), np.sin(0.5 * angle)]) for angle in (p[0], p[2])]
    assert np.abs(matrix @ np.kron(tangents[1], tangents[0])).max() <= 1e-10 * np.abs(matrices).max()


@pytest.mark.parametrize("height", [0.0, 0.5])
def test_eigenvalues_are_the_angles_before_newtons_method(height):
    """Half of all digits at least, in 9 of 10 cases: what Newton's method begins with."""
    rng = np.random.default_rng(5)
    off = []
    for _ in range(40):
        tssm, _, lengths = drawn(rng, height)
        _, equations, _ = solved(tssm, lengths)
        (w,), vanishes = eigen_directions((TANGENTS @ equations @ TANGENTS.T)[None], tssm.plane)
        assert len(w) == (8 if tssm.plane else 16)
        assert not vanishes.any()
        roots = np.concatenate([w, 1.0 / w]) if tssm.plane else w
        true = tssm.complex_solutions(lengths)[:, 1]
        off.append(np.abs(roots[:, None] / true - 1.0).min(axis=0).max())
    assert np.quantile(off, 0.9) <= 1e-7


def test_eigenvalues_of_one_set_that_do_not_converge_leave_other_sets_alone(monkeypatch):
    tssm, _, lengths = drawn(np.random.default_rng(6), 0.5)
    lengths = lengths * [[1.0], [1.01], [1.02]]
    whole, numbers = tssm.batch(lengths)
    eigvals, seen = np.linalg.eigvals, []

    def record(matrices):
        seen.append(matrices)
        return eigvals(matrices)

    def diverge(matrices):
        if len(matrices) > 1 or np.allclose(matrices, seen[0]):
            raise np.linalg.LinAlgError("Eigenvalues did not converge")
        return eigvals(matrices)

    monkeypatch.setattr(np.linalg, "eigvals", record)
    tssm.modes(lengths[1])
    monkeypatch.setattr(np.linalg, "eigvals", diverge)
    found, rest = tssm.batch(lengths)
    np.testing.assert_array_equal(rest, [numbers[0], -1, numbers[2]])
    np.testing.assert_array_equal(found[[0, 2]], whole[[0, 2]])
    assert np.isnan(found[1]).all()
    alone = tssm.modes(lengths[1])
    assert not alone.complete
    assert alone.method == "the eigenvalues did not converge"
    assert alone.counts.lost == alone.counts.total == 16
