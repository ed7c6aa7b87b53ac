"""The parts: equations 19-26 against vectors, eigenvalues against LAPACK."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from cinegen.assembly.triangle import TSSM
from cinegen.assembly.triangle._kernels.eigenvalues import eigenvalues
from cinegen.assembly.triangle._kernels.plane import write_quadratics
from cinegen.assembly.triangle._kernels.space import DEGREE, write_matrices

seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def drawn(rng, height):
    base = rng.normal(size=(6, 3)) * [1.0, 1.0, height]
    tssm = TSSM(base, rng.normal(size=(3, 3)), rng.permutation([0, 0, 1, 1, 2, 2]))
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    placement = np.eye(4)
    placement[:3, :3], placement[:3, 3] = q * np.linalg.det(q), rng.normal(size=3)
    return tssm, placement, tssm.lengths(placement)


@given(seeds, st.sampled_from([0.0, 0.5]))
def test_equations_20_to_22_are_the_distances(rng, height):
    tssm, _, lengths = drawn(rng, height)
    circles, equations = tssm.circles(lengths)
    p = rng.uniform(-np.pi, np.pi, (20, 3))
    c, s = np.cos(p), np.sin(p)
    points = circles[:, :3] + circles[:, 9:10] * (c[..., None] * circles[:, 3:6] + s[..., None] * circles[:, 6:9])
    for leg, k in enumerate(tssm.legs):  # on these circles legs have their lengths
        np.testing.assert_allclose(np.linalg.norm(points[:, k] - tssm.base[leg], axis=1), lengths[leg], rtol=1e-10)
    for row, side, (i, j) in zip(equations, tssm.sides, ((0, 1), (0, 2), (1, 2)), strict=True):
        ci, si, cj, sj = c[:, i], s[:, i], c[:, j], s[:, j]
        said = np.stack([ci**0, ci, si, cj, sj, ci * cj, ci * sj, si * cj, si * sj], axis=1) @ row
        true = ((points[:, i] - points[:, j]) ** 2).sum(axis=1) - side**2
        unit = (true @ said) / (said @ said)
        assert unit > 0.0
        np.testing.assert_allclose(unit * said, true, atol=1e-10 * np.abs(true).max())
        assert np.abs(row).max() == 1.0
        if height == 0.0:
            assert not row[[2, 4, 6, 7]].any()


@given(seeds)
def test_equations_25_and_26_hold_where_20_to_22_do(rng):
    tssm, placement, lengths = drawn(rng, 0.0)
    quadratics = np.empty((6, 3))
    write_quadratics(tssm.circles(lengths)[1], quadratics)
    for found in (placement, *tssm.modes(lengths).placements):
        c = np.cos(tssm.angles(found))
        terms = quadratics @ c[1] ** np.arange(3)
        powers = c[2] ** np.arange(2, -1, -1)
        assert abs(terms[:3] @ powers) <= 1e-8 * np.abs(quadratics[:3]).sum()
        assert abs(terms[3:] @ powers) <= 1e-8 * np.abs(quadratics[3:]).sum()


@given(seeds, st.sampled_from([0.0, 0.5]))
def test_bezouts_matrix_is_singular_where_20_to_22_hold_and_has_the_tangents_in_its_null_space(rng, height):
    tssm, placement, lengths = drawn(rng, height)
    matrices = np.empty((DEGREE + 1, 4, 4))
    offset = rng.uniform(-np.pi, np.pi)
    write_matrices(tssm.circles(lengths)[1], offset, np.empty((6, 3)), matrices)
    p = tssm.angles(placement)
    half = 0.5 * (p[1] - offset)
    powers = np.sin(half) ** np.arange(5) * np.cos(half) ** np.arange(4, -1, -1)
    matrix = np.einsum("n,nij->ij", powers, matrices)
    tangents = [np.array([np.cos(0.5 * angle), np.sin(0.5 * angle)]) for angle in (p[0], p[2])]
    assert np.abs(matrix @ np.kron(tangents[1], tangents[0])).max() <= 1e-10 * np.abs(matrices).max()


@pytest.mark.parametrize("height", [0.0, 0.5])
def test_eigenvalues_are_the_angles_before_newtons_method(height):
    """Half of all digits at least, in 99 of 100 cases: what Newton's method begins with."""
    rng = np.random.default_rng(5)
    off = []
    for _ in range(100):
        tssm, _, lengths = drawn(rng, height)
        matrices, here = np.empty((DEGREE + 1, 4, 4)), tssm.circles(lengths)[1]
        write_matrices(here, 0.4, np.empty((6, 3)), matrices)
        companion = np.zeros((16, 16))
        companion[:4] = -np.hstack(np.linalg.solve(matrices[4], matrices[3::-1]))
        companion[4:, :12] = np.eye(12)
        found = np.zeros((2, 16))
        assert eigenvalues(companion, 16, found)
        roots = 2.0 * np.arctan(found[0] + 1j * found[1]) + 0.4
        true = np.exp(1j * tssm.modes(lengths).angles[:, 1])
        off.append(np.abs(np.exp(1j * roots)[:, None] / true - 1.0).min(axis=0).max())
    assert np.quantile(off, 0.9) <= 1e-7


@given(seeds, st.integers(1, 16))
def test_eigenvalues_are_lapacks(rng, n):
    kind = rng.integers(4)
    matrix = rng.normal(size=(n, n))
    if kind == 1:
        matrix = np.eye(n)[rng.permutation(n)]
    if kind == 2:  # a companion
        matrix[1:] = np.eye(n)[:-1]
    if kind == 3:
        matrix = np.triu(matrix)
    found = np.zeros((2, 16))
    assert eigenvalues(matrix.copy(), n, found)
    mine, theirs = found[0, :n] + 1j * found[1, :n], np.linalg.eigvals(matrix)
    apart = np.abs(mine[:, None] - theirs)
    assert apart[linear_sum_assignment(apart)].max() <= (1e-9 if kind != 3 else 1e-6) * (1.0 + np.abs(theirs).max())
