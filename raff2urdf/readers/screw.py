"""The lead of a screw joint of SDF."""

from __future__ import annotations

import math


def lead(per_revolution: float | None, per_metre: float | None) -> float:
    """Return the translation of a screw by its rotation, m/rad.

    Args:
        per_revolution: `screw_thread_pitch`, m per revolution of a right-handed thread; 1 unless one of both is given.
        per_metre: `thread_pitch`, which it replaced: rad per m of a left-handed thread, not 0.
    """
    if per_revolution is None and per_metre is not None:
        return -1.0 / per_metre
    return (1.0 if per_revolution is None else per_revolution) / (2.0 * math.pi)
