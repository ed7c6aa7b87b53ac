"""The elimination: what does not converge leaves other sets alone."""

from __future__ import annotations

import numpy as np

from cinegen.hexapod import TSSM


def drawn(rng, height):
    base = rng.normal(size=(6, 3)) * [1.0, 1.0, height]
    tssm = TSSM(base, rng.normal(size=(3, 3)), rng.permutation([0, 0, 1, 1, 2, 2]))
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    placement = np.eye(4)
    placement[:3, :3], placement[:3, 3] = q * np.linalg.det(q), rng.normal(size=3)
    return tssm, placement, tssm.lengths(placement)


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
