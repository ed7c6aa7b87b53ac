"""Mechanisms are made as the tests of robots make theirs; and what is asserted of them shares its words."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "robots"))
pytest.register_assert_rewrite("assembled")


@pytest.fixture
def built(raff):
    """`built(mechanism)`: loaded, its digits all written."""
    return lambda mechanism: raff(mechanism.text(joint_digits=None))
