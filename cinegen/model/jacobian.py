"""The paper's extended Jacobian (seed paper, section 3.3.1 and figure 9): tasks above, loops below, all labelled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cinegen.arrays import Array
from cinegen.html import table

COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True, slots=True)
class ExtendedJacobian:
    """A matrix with labelled rows and columns; `numpy.asarray` returns the bare matrix.

    Attributes:
        matrix: (rows, nv), metres and radians.
        rows: for each row the node or loop it belongs to, and its component (x, y, z, rx, ry, rz).
        columns: for each column the joint it belongs to (a free base: `joint0.x` and so on).
    """

    matrix: Array
    rows: tuple[tuple[str, str], ...]
    columns: tuple[str, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of rows and columns."""
        return self.matrix.shape

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.matrix, dtype=dtype) if copy or dtype else self.matrix

    def block(self, name: str) -> Array:
        """Return the rows (n, nv) of one node or loop, by its name."""
        return self.matrix[[i for i, (owner, _) in enumerate(self.rows) if owner == name]]

    def compact(self) -> ExtendedJacobian:
        """Return the matrix without rows that are exactly zero: a planar mechanism keeps x, y, rz as in figure 9."""
        kept = [i for i, row in enumerate(self.matrix) if row.any()]
        return ExtendedJacobian(self.matrix[kept], tuple(self.rows[i] for i in kept), self.columns)

    def __repr__(self) -> str:
        owners = dict.fromkeys(owner for owner, _ in self.rows)
        return f"<ExtendedJacobian {self.shape[0]} x {self.shape[1]}: {', '.join(owners)}"[:99] + ">"

    @property
    def _rows(self) -> list[list[str]]:
        """The labels and the numbers of each row, as texts."""
        labelled = zip(self.rows, self.matrix, strict=True)
        return [
            [" ".join(row), *("." if value == 0.0 else f"{value:.4g}" for value in values)] for row, values in labelled
        ]

    def _repr_html_(self) -> str:
        return table("extended Jacobian (m, rad)", ("", *self.columns), self._rows)

    def __str__(self) -> str:
        rows = [["", *self.columns], *self._rows]
        widths = [max(len(row[0]) for row in rows), *(max(len(name), 9) for name in self.columns)]
        return "\n".join(
            "  ".join(
                [f"{row[0]:<{widths[0]}}", *(f"{cell:>{w}}" for cell, w in zip(row[1:], widths[1:], strict=True))]
            )
            for row in rows
        )
