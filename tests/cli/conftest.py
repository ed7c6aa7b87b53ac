"""What tests of several commands share."""

from __future__ import annotations

import io
import sys

import pytest

from cinegen.cli import progress


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
