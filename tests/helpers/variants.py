"""Parameters that repeat a code path with other numbers or robots: `@parametrize("seed", [0, *slow(1, 2, 3)])`."""

from collections.abc import Iterable
from typing import Any

import pytest


def slow(*values: Any) -> list[Any]:
    """Parameters that `make nightly` runs, and pytest otherwise leaves out; a tuple has one for each name."""
    return [pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.slow) for case in values]


FEWER = frozenset({"arm7", "scara", "five_bar", "delta4", "hybrid", "differential_wrist"})
"""A redundant arm, slides, a planar loop, spatial loops, a hybrid with ball joints, and couplings: for long tests."""

ONE_OF_EACH_KIND = FEWER | {"planar_3r", "sr400", "gough", "two_arms"}
"""Files of robots that have together every kind of joint, loop and coupling, and one with two robots."""


def others_slow(parameters: Iterable[Any], files: frozenset[str] = ONE_OF_EACH_KIND) -> list[Any]:
    """Parameters whose first value is the name of a robot's file, or `FILE:ROBOT`; those of other files are slow."""

    def is_fast(row: Any) -> bool:
        return row.values[0].partition(":")[0] in files

    return [row if is_fast(row) else pytest.param(*row.values, id=row.id, marks=pytest.mark.slow) for row in parameters]
