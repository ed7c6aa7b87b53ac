"""How the start system was found: while lengths go round a loop of complex values, its solutions change places.

What a known solution has become may be a new one; from one, all 40 come up after some loops:

    python -m cinegen.assembly.hexapod.monodromy [FILE]
"""

from __future__ import annotations

import io
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

from cinegen.assembly.hexapod.equations import Complex, coefficients, lengths_at, moving
from cinegen.assembly.hexapod.paths import TOLERANCE, Kind, apart, follow
from cinegen.assembly.hexapod.start import COUNT, FILE, Start
from raff2urdf.files import write_all

_SEED = 112  # of some that were tried, the one with the shortest paths
_FAR = 10.0  # corners of loops
_LOOPS = 1000
_NEW = 1e-6  # distance from a solution that is another


def find(seed: int = _SEED) -> Start:
    """Finds another, by monodromy."""
    rng = np.random.default_rng(seed)

    def random(*shape: int) -> Complex:
        return np.asarray(rng.normal(size=shape) + 1j * rng.normal(size=shape))

    base, platform = random(6, 3) / 6**0.5, random(6, 3) / 6**0.5
    pose = random(8)
    pose[4:] -= pose[:4] * (pose[:4] @ pose[4:]) / (pose[:4] @ pose[:4])
    s = lengths_at(base, platform, pose)
    x = (pose / np.linalg.norm(pose))[None]
    for _ in range(_LOOPS):
        if len(x) == COUNT:
            break
        found = x
        corners = [s, s + _FAR * random(6), s + _FAR * random(6), s]
        for here, there in pairwise(corners):
            way = moving(coefficients(base, platform, here), coefficients(base, platform, there))
            ends = follow(way, found, TOLERANCE)
            found = ends.x[ends.kind == Kind.REGULAR]
        for y in found:
            if apart(y[None], x).min() > _NEW:
                x = np.vstack([x, y])
    return Start(base, platform, s, x)


if __name__ == "__main__":
    file = io.BytesIO()
    np.savez(file, **find()._asdict())
    write_all({Path(sys.argv[1]) if len(sys.argv) > 1 else FILE: file.getvalue()})
