"""`cinegen replay`: a recorded mission in the page."""

from __future__ import annotations

from pathlib import Path

from cinegen.cli.exports.export import RECORDING, SPEED
from cinegen.cli.served_page import PageOptions
from raff2urdf.command.command_line import no_effect
from raff2urdf.files import stem_of


def run(page: PageOptions, recording: Path = RECORDING, speed: float = SPEED) -> int:
    """Show a recorded mission in the page."""
    if not page.writes:
        no_effect("with --seconds and without --video, where no file is written", "--force")
    from cinegen.session import replay_setup

    return page.show(replay_setup(recording, speed), stem_of(recording))
