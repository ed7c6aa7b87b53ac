"""What tests of sessions share."""

import pytest

from cinegen.session import Session, arrange


@pytest.fixture
def session(robot, closing):
    """`session("delta4", "arm7")`: a session of these robots, which is closed afterwards."""
    return lambda *names, **options: closing(Session(arrange({name: robot(name) for name in names}, **options)))
