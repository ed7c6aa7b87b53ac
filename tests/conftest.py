"""What all tests share: the robots of the repository, each loaded once; and how many examples laws are tried on.

`CINEGEN_EXAMPLES=3 pytest ...` tries three times as many as a test says, for a night; a quarter as many are tried where
nobody says, so that all tests together stay within minutes.
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import pytest
from hypothesis import HealthCheck, is_hypothesis_test, settings

import cinegen

ROOT = Path(__file__).resolve().parent.parent
ROBOTS = ROOT / "robots"

# On a busy machine making examples may take long: that is no failure.
settings.register_profile("cinegen", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("cinegen")


EXAMPLES = float(os.environ.get("CINEGEN_EXAMPLES", "0.25"))


def pytest_collection_modifyitems(items):
    for function in {item.obj.__func__ if hasattr(item.obj, "__func__") else item.obj for item in _laws(items)}:
        own = getattr(function, "_hypothesis_internal_use_settings", None) or settings.default
        count = max(3, round(EXAMPLES * own.max_examples))
        function._hypothesis_internal_use_settings = settings(own, max_examples=count)


def _laws(items):
    return [item for item in items if is_hypothesis_test(getattr(item, "obj", None))]


@cache
def _robot(name: str) -> cinegen.Mechanism:
    return cinegen.load(ROBOTS / f"{name}.raff")


@pytest.fixture(scope="session")
def robot():
    """`robot("delta4")`: a mechanism of the repository."""
    return _robot


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture
def raff(tmp_path):
    """`raff(text)`: the mechanism of a RAFF text without its first line, which is put in front."""

    def load(body: str, name: str = "mechanism", **options) -> cinegen.Mechanism:
        path = tmp_path / f"{name}.raff"
        path.write_text(f"RAFF {name}\n{body}", encoding="utf-8")
        return cinegen.load(path, **options)

    return load
