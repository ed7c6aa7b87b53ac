"""Gaps that no motion changes: pins of planar loops whose two ends lie in different planes.

In a planar loop nothing moves along the normal of its plane. If the ends of a pin are apart along that, by however
little, the loop can't be closed, though it would move as intended: such a pin is one with play along its axis, and
closing the loop in the plane is closing it with one end moved by the gap.

The gap p of a loop, at the configuration with the least gap, is of this kind if p^T J = 0 for the rows of the Jacobian
that are its translation, there and at other configurations: the component along p is then the same everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.closure import CLOSED, Closing, KindedLoops, close_from_afar
from raff2urdf.placement import translation
from raff2urdf.raff.document import LoopKind
from raff2urdf.residual import ROWS

EXACT = "--exact (in Python load(relax=False), convert(exact=True))"
"""The option that keeps all loops as written, for messages."""

LARGEST_PLAY = 0.05
"""Characteristic lengths: a pin with more play is taken for a mistake."""

ROUNDED = 1e-4
"""Part of a loop's motion by which a gap changes, where axes are parallel but for rounding."""

_PLANAR = 1e-9  # likewise, of a loop that is planar as written: others are healed
_NOISE = 1e-6  # part of a gap that is less than what closing leaves
_KINDS = (LoopKind.REVOLUTE, LoopKind.BALL)


def constant_gaps(loops: KindedLoops, best: Closing, still: float = ROUNDED) -> dict[int, Array]:
    """Return, for each open pin or ball joint whose gap no motion changes, the translation (3,) of its second end that
    closes it, in that end's axes, m.

    Args:
        loops: that can't be closed.
        best: the configuration with the least gap.
        still: part of a loop's motion by which a gap may change.
    """
    rng = np.random.default_rng(0)
    jacobian = loops.evaluate(best.q)[1]
    steps = 0.3 * np.asarray(rng.standard_normal((2, jacobian.shape[1])))
    others = [loops.integrate(best.q, step) for step in steps]
    jacobians = [jacobian, *(loops.evaluate(q)[1] for q in others)]
    offsets, row = dict[int, Array](), 0
    for i, (kind, placed) in enumerate(zip(loops.kinds, loops.placements(best.q), strict=True)):
        rows = slice(row, row + 3)
        row += ROWS[kind]
        gap = placed[:3, 3]
        size = float(np.linalg.norm(gap))
        if kind in _KINDS and size > CLOSED * loops.length:
            moved = [float(np.abs(gap / size @ matrix[rows]).max(initial=0.0)) for matrix in jacobians]
            if max(moved) <= still * max(float(np.abs(matrix[rows]).max(initial=0.0)) for matrix in jacobians):
                offset = -placed[:3, :3].T @ gap
                offsets[i] = np.where(np.abs(offset) > _NOISE * size, offset, 0.0)
    return offsets


def steps_of(offsets: Mapping[int, Array]) -> dict[int, tuple[Array, Array]]:
    """Return the steps of both ends of loops (see `KindedLoops.with_moved`) that translate the second ones."""
    return {i: (np.eye(4), translation(offset)) for i, offset in offsets.items()}


def play(loops: KindedLoops, start: Array, best: Closing) -> dict[int, Array]:
    """Return the gaps of pins with play, see `constant_gaps`; none unless the loops close in the plane.

    Args:
        loops: that can't be closed.
        start: (nq,) the configuration as written.
        best: the configuration with the least gap.
    """
    offsets = constant_gaps(loops, best, _PLANAR)
    largest = max((float(np.linalg.norm(offset)) for offset in offsets.values()), default=0.0)
    if not 0.0 < largest <= LARGEST_PLAY * loops.length:
        return {}
    return offsets if close_from_afar(loops.with_moved(steps_of(offsets)), start).closed else {}


def text(names: Sequence[str], ends: Sequence[tuple[str, str]], offsets: Mapping[int, Array]) -> str:
    """Return the text of a warning: loops that are closed in the plane."""
    moved = ", ".join(f"{ends[i][1]} by ({x:.8g}, {y:.8g}, {z:.8g}) mm" for i, (x, y, z) in _in_mm(offsets).items())
    gaps = ", ".join(f"'{names[i]}' by {1e3 * float(np.linalg.norm(offset)):.3g} mm" for i, offset in offsets.items())
    return (
        f"pins with play: {gaps} along their axes, where nothing moves, and nothing across; closed in the plane, as if "
        f"their second ends were moved in their own axes: {moved}. {EXACT} refuses such gaps"
    )


def _in_mm(offsets: Mapping[int, Array]) -> dict[int, list[float]]:
    return {i: (1e3 * offset + 0.0).tolist() for i, offset in offsets.items()}
