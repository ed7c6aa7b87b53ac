"""Export formats of a joint trajectory.

Each is a module with SUFFIX, the suffix of its files; `write(trajectory, joints)`, which returns their content; and
`note(content)`, which returns a note for users. A new format is a new module and one line here.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Protocol, cast

from cinegen.errors import UnknownNameError
from cinegen.mission.trajectory import Trajectory

FORMATS: Mapping[str, str] = {
    "csv": "cinegen.mission.formats.csv",
    "npz": "cinegen.mission.formats.npz",
    "ros2": "cinegen.mission.formats.ros2",
    "urscript": "cinegen.mission.formats.urscript",
}


class Format(Protocol):
    """Interface of a format's module."""

    SUFFIX: str

    @staticmethod
    def write(trajectory: Trajectory, joints: tuple[str, ...]) -> bytes:
        """Return the content of a file.

        Raises:
            MissionError: the format can't express the motion of these joints.
        """

    @staticmethod
    def note(content: bytes) -> str:
        """Return a note for users about a file with this content; empty without one."""


def format_of(name: str) -> Format:
    """Return a format by its name.

    Raises:
        UnknownNameError: no such format.
    """
    if name not in FORMATS:
        raise UnknownNameError("format", name, tuple(FORMATS))
    return cast(Format, importlib.import_module(FORMATS[name]))
