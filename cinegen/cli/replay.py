"""`cinegen replay`: a recorded mission in the page."""

from __future__ import annotations

from pathlib import Path

from cinegen.cli.export import RECORDING, SPEED
from cinegen.cli.page import PageOptions


def run(page: PageOptions, recording: Path = RECORDING, speed: float = SPEED) -> int:
    """Show a recorded mission in the page."""
    from cinegen.session import replayed

    return page.show(replayed(recording, speed), recording.stem)
