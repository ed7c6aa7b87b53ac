"""What tests of sessions share."""

from __future__ import annotations

import pytest

from cinegen.session import Session, arrange


@pytest.fixture
def session(robot):
    """`session("delta4", "arm7")`: a session of these robots, which is closed afterwards."""
    opened = []

    def open_session(*names, **options):
        opened.append(Session(arrange({name: robot(name) for name in names}, **options)))
        return opened[-1]

    yield open_session
    for one in opened:
        one.close()
