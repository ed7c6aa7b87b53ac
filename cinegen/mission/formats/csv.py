"""A table: `time,joint1,...`, a line for each sample. s, rad and m; every number reads back to the same double."""

from __future__ import annotations

import csv
import io

import numpy as np

from cinegen.mission.trajectory import Trajectory

SUFFIX = ".csv"


def write(trajectory: Trajectory, joints: tuple[str, ...]) -> bytes:
    """Return the table of these joints."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["time", *joints])
    table.writerows(np.column_stack([trajectory.times, trajectory.positions(joints)]).tolist())
    return text.getvalue().encode()


def note(content: bytes) -> str:
    """Return no note."""
    return ""
