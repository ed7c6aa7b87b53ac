"""`cinegen check-proof`: whether a certificate of `cinegen prove` holds."""

from __future__ import annotations

from pathlib import Path

import typer

from cinegen.cli.files import print_result
from cinegen.cli.options import JSON, SCHEDULER, WORKERS
from cinegen.cli.progress import Progress
from cinegen.cli.study.prove import lines

_CERTIFICATE = typer.Argument(..., metavar="FILE", help="certificate that cinegen prove wrote, .json")


def run(
    file: Path = _CERTIFICATE, workers: int | None = WORKERS, scheduler: str | None = SCHEDULER, json: bool = JSON
) -> int:
    """Check a certificate by ball arithmetic, with a program that shares no code with the one that wrote it.

    Answers 1 unless all of the region is proved.
    """
    from cinegen.proof import load_proof

    with Progress() as progress:
        proof = load_proof(file, workers, scheduler, progress.steps)
    print_result(proof.as_dict(), lines(str(proof.certificate["robot"]), proof), json)
    return 0 if proof else 1
