"""Arrays for numpy: `times` (n,), `joints` (m,) their names, `q` and `v` (n, m), `rate`, `robot`. s, rad and m."""

from __future__ import annotations

import io

import numpy as np

from cinegen.mission.trajectory import Trajectory

SUFFIX = ".npz"


def write(trajectory: Trajectory, joints: tuple[str, ...]) -> bytes:
    """Return the arrays of these joints."""
    file = io.BytesIO()
    np.savez_compressed(
        file,
        times=trajectory.times,
        joints=np.array(joints),
        q=trajectory.positions(joints),
        v=trajectory.velocities(joints),
        rate=np.array(trajectory.rate),
        robot=np.array(trajectory.name),
    )
    return file.getvalue()


def note(content: bytes) -> str:
    """Return no note."""
    return ""
