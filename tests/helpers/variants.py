"""Parameters that repeat a code path with other numbers or robots: `@parametrize("seed", [0, *slow(1, 2, 3)])`."""

from __future__ import annotations

from typing import Any

import pytest


def slow(*values: Any) -> list[Any]:
    """Parameters that `make slow` runs, and pytest otherwise leaves out; a tuple has one for each name."""
    return [pytest.param(*(one if isinstance(one, tuple) else (one,)), marks=pytest.mark.slow) for one in values]
