"""Progress of long computations, shown to a person at a terminal."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

from raff2urdf.command.output import unescaped
from raff2urdf.escape import one_line

if TYPE_CHECKING:
    import rich.progress

_PATIENCE = 1.0  # s until progress is shown


class Progress:
    """A line below a command's output, shown after one second, and removed at the end."""

    def __init__(self) -> None:
        self._begin = time.monotonic()
        self._first: int | None = None  # cells that were done before
        self._bar: rich.progress.Progress | None = None
        self._shown = ""  # the newest text that says what is being done

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def text(self, text: str) -> None:
        """Show what is being done."""
        self._show(text, None, None, text != self._shown)

    def fraction(self, fraction: float) -> None:
        """Show which fraction is done, 0 to 1."""
        self._show("", fraction, 1.0)

    def steps(self, text: str, done: int, total: int) -> None:
        """Show what is being done, and how many steps are done."""
        self._show(text, done, total, text != self._shown)

    def cells(self, done: int, total: int) -> None:
        """Show how many cells are done, and how fast."""
        self._first = done if self._first is None else self._first
        rate = (done - self._first) / max(time.monotonic() - self._begin, 1e-9)
        self._show(f"{done:,} of {total:,} cells, {rate:,.0f}/s", done, total)

    def _show(self, text: str, done: float | None, total: float | None, at_once: bool = False) -> None:
        if self._bar is None:
            if not sys.stderr.isatty() or time.monotonic() - self._begin < _PATIENCE:
                return
            self._bar = _bar()
            self._bar.add_task("", total=total)
            self._bar.start()
        from rich.markup import escape

        self._shown, task, words = text, self._bar.task_ids[0], escape(one_line(text))
        self._bar.update(task, description=words, completed=done, total=total, refresh=at_once)


def _bar() -> rich.progress.Progress:
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn

    columns = SpinnerColumn(), *Progress.get_default_columns()
    console = Console(file=unescaped(sys.stderr))
    return Progress(*columns, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)
