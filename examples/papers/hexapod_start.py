"""The start system of `cinegen.hexapod.Hexapod`: a random complex hexapod with its 40 solutions, found by monodromy.

While lengths go around a loop of complex values, the solutions are permuted. A known solution may come back as a new
one; from a single one, all 40 are found after some loops:

    python examples/papers/hexapod_start.py FILE
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

from cinegen.hexapod.paths import TOLERANCE, PathEnd, follow
from cinegen.hexapod.study import (
    SOLUTIONS,
    Complex,
    StartSystem,
    coefficients,
    distances,
    family,
    lengths_at,
    on_quadric,
)

_SEED = 112  # of some that were tried, the one with the shortest paths
_FAR = 10.0  # corners of loops
_LOOPS = 1000
_NEW = 1e-6  # distance from a solution that is another


def find(seed: int = _SEED) -> StartSystem:
    """Find a start system by monodromy."""
    rng = np.random.default_rng(seed)

    def random(*shape: int) -> Complex:
        return np.asarray(rng.normal(size=shape) + 1j * rng.normal(size=shape))

    base, platform = random(6, 3) / 6**0.5, random(6, 3) / 6**0.5
    x = on_quadric(random(1, 8))
    s = lengths_at(base, platform, x[0])
    x /= np.linalg.norm(x)
    for _ in range(_LOOPS):
        if len(x) == SOLUTIONS:
            break
        tracked = x
        corners = [s, s + _FAR * random(6), s + _FAR * random(6), s]
        for start, end in pairwise(corners):
            path = family(coefficients(base, platform, start), coefficients(base, platform, end))
            paths = follow(path, tracked, TOLERANCE)
            tracked = paths.x[paths.end == PathEnd.REGULAR]
        for y in tracked:
            if distances(y[None], x).min() > _NEW:
                x = np.vstack([x, y])
    return StartSystem(base, platform, s, x)


if __name__ == "__main__":
    np.savez(Path(sys.argv[1]), **find()._asdict())
