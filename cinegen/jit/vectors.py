"""Elementary operations on the first n components of vectors, as BLAS level 1 has them."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from cinegen.jit.compiled import compiled

Vector = NDArray[Any]
"""Of real or complex numbers."""


@compiled
def inner(x: Vector, y: Vector, n: int) -> Any:
    """Return the sum of x[k] y[k]; complex numbers are not conjugated."""
    s = 0.0
    for k in range(n):
        s += x[k] * y[k]
    return s


@compiled
def add_multiple(factor: Any, x: Vector, y: Vector, n: int) -> None:
    """y += factor x."""
    for k in range(n):
        y[k] += factor * x[k]


@compiled
def copy(x: Vector, y: Vector, n: int) -> None:
    """y = x."""
    for k in range(n):
        y[k] = x[k]


@compiled
def swap(x: Vector, y: Vector, n: int) -> None:
    """Exchange x and y."""
    for k in range(n):
        x[k], y[k] = y[k], x[k]
