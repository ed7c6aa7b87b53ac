"""How many examples laws are tried on: as many as `conftest` says, and hypothesis obeys."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st


@pytest.fixture
def tried(request, root, monkeypatch):
    """`tried(law, part)`: has a law collected where a part of its examples is asked for, then tries it."""
    shared = request.config.pluginmanager.get_plugin(str(root / "tests/conftest.py"))

    def run(law, part):
        monkeypatch.setattr(shared, "EXAMPLES", part)
        shared.pytest_collection_modifyitems([SimpleNamespace(obj=law)])
        law()

    return run


@pytest.mark.parametrize(("part", "count"), [(0.25, 10), (0.01, 3), (1.0, 40), (2.0, 80)])
def test_a_law_is_tried_on_a_part_of_its_examples(tried, part, count):
    seen = []

    @settings(max_examples=40)
    @given(st.integers())
    def law(number):
        seen.append(number)

    tried(law, part)
    assert len(seen) == count
