"""Factors of large matrices block by block, against numpy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from quick_kernels import quick

from cinegen.jit import banded

factor_blocks, from_motions, to_motions, newton_step = map(
    quick, (banded.factor_blocks, banded.from_motions, banded.to_motions, banded.newton_step)
)


def blocks(seed: int, dependent: bool) -> tuple[np.ndarray, dict, int]:
    """A matrix of blocks in a row, each of which shares a column or two with the next; its factors' tables; rank."""
    rng = np.random.default_rng(seed)
    count, column, rows, rank = int(rng.integers(2, 9)), 0, [], 0
    first, last, heights = [], [], []
    width = 4 * count + 4
    for _ in range(count):
        independent, new = int(rng.integers(1, 4)), int(rng.integers(2, 4))
        begin, end = max(column - int(rng.integers(1, 3)), 0), column + new + 1
        block = np.zeros((independent, width))
        block[:, begin:end] = rng.normal(size=(independent, end - begin))
        if dependent:
            block = np.vstack([block, rng.normal(size=(int(rng.integers(0, 3)), independent)) @ block])
        rows.append(rng.permutation(block))
        heights.append(len(block))
        first += [begin] * len(block)
        last.append(end)
        column = end
    f = np.vstack(rows)[:, : max(last)].copy()
    rank = int(np.linalg.matrix_rank(f, tol=1e-9))
    size = len(f)
    return f, {
        "block_row": np.cumsum([0, *heights]), "block_end": np.array(last), "first": np.array(first),
        "order": np.zeros(size, dtype=int), "left": np.zeros(size), "size": np.zeros(size),
        "applied": np.zeros(size, dtype=int), "filled": np.zeros((size, 2), dtype=int), "tau": np.zeros(size),
        "h": np.zeros(f.shape), "reach": np.zeros(size, dtype=int),
    }, rank  # fmt: skip


@settings(max_examples=120)
@given(st.integers(0, 10**6), st.booleans(), st.sampled_from((1e-9, 1.0, 1e9)))
def test_motions_and_steps_are_those_of_the_whole_matrix(seed, dependent, scale):
    j, tables, rank = blocks(seed, dependent)
    j *= scale
    f, n = j.copy(), j.shape[1]
    assert 0.0 < factor_blocks(f, rank, *tables.values()) <= 1.0
    for row, (begin, end) in zip(f, tables["filled"], strict=True):
        assert not row[:begin].any()
        assert not row[end:].any()
    q = np.eye(n)
    for row in q:
        from_motions(row, rank, tables["tau"], tables["h"], tables["reach"])
    assert q @ q.T == pytest.approx(np.eye(n), abs=1e-12)
    assert j @ q[rank:].T == pytest.approx(np.zeros((len(j), n - rank)), abs=1e-11 * np.linalg.norm(j))
    motions = np.eye(n)
    for row in motions:
        to_motions(row, rank, tables["tau"], tables["h"], tables["reach"])
    assert motions == pytest.approx(q.T, abs=1e-12)
    x = np.random.default_rng(seed).normal(size=n)
    out = np.zeros(n)
    arguments = (f, rank, tables["order"], tables["tau"], tables["h"], tables["reach"], j @ x)
    newton_step(*arguments, 0.0, out)
    shortest = np.linalg.lstsq(j, j @ x, rcond=1e-9)[0]
    condition = np.linalg.cond(j[tables["order"][:rank]])
    assert out == pytest.approx(shortest, abs=1e-13 * max(condition, 1e3) ** 2)


def test_a_rank_that_is_not_reached_leaves_pivots_out():
    j, tables, rank = blocks(3, True)
    f = j.copy()
    assert factor_blocks(f, rank + 1, *tables.values()) == 0.0
    assert tables["tau"][rank] == 0.0
    out = np.zeros(j.shape[1])
    x = np.random.default_rng(0).normal(size=j.shape[1])
    newton_step(f, rank + 1, tables["order"], tables["tau"], tables["h"], tables["reach"], j @ x, 0.0, out)
    assert j @ out == pytest.approx(j @ x, abs=1e-9)
