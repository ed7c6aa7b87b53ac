"""Placements as Pinocchio keeps them: 12 numbers, the three columns of the rotation, then the translation."""

from __future__ import annotations

from cinegen.jit.compiled import Array, compiled


@compiled
def rotation_of(placement: Array, out: Array) -> None:
    """(3, 3) of a placement (12,)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = placement[3 * j + i]


@compiled
def compose(placement: Array, local: Array, r: Array, p: Array) -> None:
    """Placement (12,) times another, as rotation r (3, 3) and translation p (3,)."""
    for i in range(3):
        for j in range(3):
            r[i, j] = (
                placement[i] * local[3 * j] + placement[3 + i] * local[3 * j + 1] + placement[6 + i] * local[3 * j + 2]
            )
        p[i] = placement[9 + i] + (
            placement[i] * local[9] + placement[3 + i] * local[10] + placement[6 + i] * local[11]
        )
