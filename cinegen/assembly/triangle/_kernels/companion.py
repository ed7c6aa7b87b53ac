"""The companion of a polynomial whose coefficients are matrices: its eigenvalues are the roots of the determinant."""

from __future__ import annotations

from cinegen.assembly.triangle._kernels.elimination import reduce
from cinegen.jit.compiled import Array, compiled

ROWS = 4  # of each coefficient


@compiled
def companion(coefficients: Array, degree: int, work: Array, matrix: Array) -> None:
    """The block companion of A_0 + ... + A_d x^d, made monic.

    Args:
        coefficients: (d + 1, ROWS, ROWS), the last one regular.
        degree: d.
        work: (ROWS, ROWS (d + 1)) scratch.
        matrix: becomes the companion, in its first ROWS d rows and columns.
    """
    size = ROWS * degree
    for i in range(ROWS):
        for j in range(ROWS):
            work[i, j] = coefficients[degree, i, j]
            for k in range(degree):
                work[i, ROWS * (k + 1) + j] = coefficients[degree - 1 - k, i, j]
    reduce(work, ROWS, ROWS + size)
    for i in range(size):
        for j in range(size):
            matrix[i, j] = -work[i, ROWS + j] if i < ROWS else (1.0 if j == i - ROWS else 0.0)
