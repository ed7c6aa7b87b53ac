"""Which way round: the directions in which vortices may begin."""

from __future__ import annotations

from enum import Enum


class Turning(Enum):
    """Which way a link goes round what it meets; the value says it in words."""

    FOLDING = "toward the base"
    SHORTER = "the shorter way"
    LONGER = "the other way"
    UP = "upward"
    DOWN = "downward"
    ASIDE = "aside"
