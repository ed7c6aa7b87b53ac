"""What tests of papers share."""

from functools import partial

import pytest

from cinegen.planning import plan


@pytest.fixture
def unhurried(monkeypatch):
    """No plan ends because the machine is busy."""
    monkeypatch.setattr("literal_vortices.plan", partial(plan, seconds=600.0))
