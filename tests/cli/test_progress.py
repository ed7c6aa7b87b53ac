"""Progress of long computations: for people at a terminal who wait, and gone in the end."""

import re

import pytest

from cinegen.cli import progress
from cinegen.cli.progress import Progress


def shown(screen):
    """The text on the terminal, without control sequences."""
    return re.sub(r"\x1b\[[\d;?]*[a-zA-Z]", "", screen.getvalue())


def test_text_fractions_and_cells_are_shown(terminal):
    screen = terminal()
    with Progress() as bar:
        bar.text("trying")
    with Progress() as bar:
        bar.fraction(0.25)
    with Progress() as bar:
        bar.cells(1000, 4000)
        bar.cells(3000, 4000)
    assert "trying" in shown(screen)
    assert "25%" in shown(screen)
    assert "75%" in shown(screen)
    assert re.search(r"3,000 of 4,000 cells, [\d,]+/s", shown(screen))


@pytest.mark.parametrize("error", [None, KeyboardInterrupt])
def test_nothing_of_it_stays(terminal, error):
    screen = terminal()
    try:
        with Progress() as bar:
            bar.text("trying")
            if error:
                raise error
    except KeyboardInterrupt:
        pass
    assert screen.getvalue().endswith("\r\x1b[1A\x1b[2K")  # the line above is empty again
    assert "\x1b[?25h" in screen.getvalue()  # the cursor is visible again


def test_nobody_else_is_bothered(terminal, monkeypatch, capsys):
    screen = terminal()
    with monkeypatch.context() as patient:
        patient.setattr(progress, "_PATIENCE", 60.0)
        with Progress() as bar:
            bar.fraction(0.5)
    assert screen.getvalue() == ""
    monkeypatch.undo()
    with Progress() as bar:
        bar.fraction(0.5)
    assert capsys.readouterr().err == ""
