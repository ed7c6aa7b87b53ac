"""What tests of several commands share."""

import io
import sys
from functools import partial

import pytest

import cinegen.cockpit
from cinegen.cli import progress


@pytest.fixture
def session_in_a_thread(monkeypatch):
    """Pages of this test run their sessions in a thread; a process of its own takes two seconds of CPU to start."""
    in_a_thread = partial(cinegen.cockpit.Cockpit, own_process=False)
    monkeypatch.setattr(cinegen.cockpit, "Cockpit", in_a_thread)


@pytest.fixture
def terminal(monkeypatch):
    """`terminal()`, called in the test itself: standard error as a terminal, where progress is shown at once."""

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    def open_terminal() -> io.StringIO:
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setattr(sys, "stderr", Terminal())
        monkeypatch.setattr(progress, "_PATIENCE", 0.0)
        return sys.stderr

    return open_terminal
