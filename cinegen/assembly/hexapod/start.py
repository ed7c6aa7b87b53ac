"""The start system: a hexapod with random complex points and lengths, whose 40 solutions are known (`monodromy`)."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cinegen.assembly.hexapod.equations import Complex

COUNT = 40
"""So many has a hexapod in general (F. Ronga and T. Vust, "Stewart platforms without computer?", 1992)."""

FILE = Path(__file__).with_name("start.npz")


class Start(NamedTuple):
    """A hexapod whose solutions are known.

    Attributes:
        base: (6, 3) complex.
        platform: (6, 3) complex.
        s: (6,) what stands for its lengths, complex.
        x: (40, 8) its solutions, in Study's coordinates.
    """

    base: Complex
    platform: Complex
    s: Complex
    x: Complex


@cache
def load() -> Start:
    """That which is shipped."""
    with np.load(FILE) as kept:
        return Start(*(kept[name] for name in Start._fields))
