"""Lines of the varieties are shared with the tests of singularities."""

import sys
from functools import partial
from pathlib import Path

import pytest

from cinegen.planning import plan

sys.path.insert(0, str(Path(__file__).parents[1] / "singularities"))


@pytest.fixture
def unhurried(monkeypatch):
    """No plan ends because the machine is busy."""
    for module in ("literal_vortices", "enclosing_potentials"):
        monkeypatch.setattr(f"{module}.plan", partial(plan, seconds=600.0))
