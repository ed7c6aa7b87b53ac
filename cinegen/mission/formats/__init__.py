"""The formats in which a joint motion can be handed on.

Each is a module with SUFFIX, what its files end with; `write(trajectory, joints)`, their content; and `note(content)`,
what there is to know about it, or nothing. A new format is a new module and one line here.
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
    """What such a module has."""

    SUFFIX: str

    @staticmethod
    def write(trajectory: Trajectory, joints: tuple[str, ...]) -> bytes:
        """The content of a file.

        Raises:
            MissionError: this format can't say what these joints do.
        """

    @staticmethod
    def note(content: bytes) -> str:
        """What there is to know about a file with this content; empty if nothing."""


def format_of(name: str) -> Format:
    """The format of a name.

    Raises:
        UnknownNameError: there is none.
    """
    if name not in FORMATS:
        raise UnknownNameError("format", name, tuple(FORMATS))
    return cast(Format, importlib.import_module(FORMATS[name]))
