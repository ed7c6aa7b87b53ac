"""What all tests share: the robots of the repository, each loaded once."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

import cinegen

ROOT = Path(__file__).resolve().parent.parent
ROBOTS = ROOT / "robots"

# On a busy machine making examples may take long: that is no failure.
settings.register_profile("cinegen", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("cinegen")


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
