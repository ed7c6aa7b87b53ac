"""`cinegen prove`: a region of poses that a robot reaches, each in exactly one configuration, none singular."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cinegen.cli.design.tolerance import amounts
from cinegen.cli.files import check_outputs, print_result, write, write_figure
from cinegen.cli.numbers import UNITS, interval_of, named, quantity, values
from cinegen.cli.options import FILE, JSON, PLOT, SCHEDULER, WORKERS, RobotOptions, force_option
from cinegen.cli.progress import Progress
from raff2urdf.command.command_line import flag, option
from raff2urdf.escape import one_line
from raff2urdf.files import GENERATED, is_stream, output_path
from raff2urdf.quantities import LENGTH

if TYPE_CHECKING:
    from cinegen.proof import Proof


def run(
    robots: RobotOptions,
    file: Path = FILE,
    over: str = option(
        "RANGES",
        f"ranges of coordinates of the node's pose, of x, y, z, rx, ry, rz: x=-100..100mm,y=0.2..0.4 ({UNITS})",
        ...,
    ),
    at: str = option("VALUES", f"values of other coordinates, such as z=-0.9,rx=0 ({UNITS}; default: home)", ""),
    node: str | None = option("NAME", "node that is posed (default: the last of the file)"),
    limits: bool = flag("--limits", "prove that all joints stay within their limits, too"),
    shape: Literal["box", "cylinder", "ball"] = option(
        "", "region: the ranges; with an ellipse in the first two, or an ellipsoid in all of them", "box"
    ),
    grow: bool = flag("--grow", "find the largest region of these proportions and this centre that is proved (1 %)"),
    tolerance: list[str] = option(
        "NAME=T", "prove it for all robots whose dimensions err by less: 'link*.d=0.05mm, *.alpha=0.02deg'", ()
    ),
    sigma: float | None = option(
        "NUMBER", "prove that the smallest singular values of type 1 and 2, as in maps, are above this", min=0.0
    ),
    clearance: str | None = option("LENGTH", "prove that the distances between links are above this, such as 10mm"),
    boxes: int | None = option("N", "boxes that are tested at most (10000)", min=1),
    output: str | None = option(
        "FILE", "certificate to write (ROBOT-proof.json)", None, "-o", "--output", endings=(".json",)
    ),
    plot: Path | None = PLOT,
    workers: int | None = WORKERS,
    scheduler: str | None = SCHEDULER,
    json: bool = JSON,
    force: bool = force_option(),
) -> int:
    """Prove that each pose of a region has exactly one configuration on the branch of home, and that none is singular.

    Writes a certificate, which a separate program of python-flint alone checks: its result is printed. `cinegen
    check-proof` checks it again. A pose outside the limits, and two poses between which there is a singularity, refute
    the region; so do a singular value below `--sigma`, and links nearer than `--clearance`. Answers 1 unless all of the
    region is proved.
    """
    from cinegen.proof import prove
    from cinegen.proof.prover import BOXES

    name, mechanism = robots.load_one(file)
    target = output_path(output, f"{name}-proof.json")
    check_outputs(target, plot, force=force, json=json)
    errors, within = amounts(tolerance, "--tolerance"), None
    if errors:
        from cinegen.design import Parameters, WithinTolerances

        within = WithinTolerances(Parameters(file, robot=robots.robot), errors)
    ranges = {
        key: interval_of(mechanism, key, ends, "--over") for key, ends in named(over, "--over", "x=-100..100mm").items()
    }
    least = None if clearance is None else quantity(clearance, "--clearance", LENGTH)
    with Progress() as progress, _resumable(target) as unfinished:
        proof = prove(
            mechanism, ranges, values(at, "--at", "z=-0.9, z=-900mm or rz=15", mechanism), node, limits=limits,
            sigma=sigma, boxes=boxes or BOXES, shape=shape, grow=grow, tolerances=within, clearance=least,
            workers=workers, scheduler=scheduler, report=progress.steps, unfinished=unfinished,
        )  # fmt: skip
    write(target, dumps({"origin": GENERATED, **proof.certificate}))
    print_result({"certificate": str(target), **proof.as_dict()}, f"{lines(name, proof)}\ncertificate: {target}", json)
    if plot is not None:
        from cinegen.plotting.proof import draw_proof

        write_figure(plot, draw_proof(proof, name=name), quiet=json)
    return 0 if proof else 1


@contextmanager
def _resumable(target: Path) -> Iterator[Path | None]:
    """Yield the file that keeps an interrupted proof, if its certificate is a file."""
    unfinished = None if is_stream(target) else target.with_name(f"{target.name}.part")
    try:
        yield unfinished
    except KeyboardInterrupt:
        if unfinished is not None and unfinished.exists():
            print(f"{unfinished}: examined boxes are kept; the same command continues", file=sys.stderr)
        raise


def lines(name: str, proof: Proof) -> str:
    """Return the result for people: m and degrees."""
    rows = [f"{one_line(name)}: {proof.message}", f"  region: {one_line(proof.region_text)}"]
    for witness in proof.witnesses[:2]:
        why = f"determinant {witness.get('determinant', 0):+d}"
        if not witness["configuration"]:
            why = "no configuration reaches it"
        elif "limit" in witness:
            why = f"{one_line(str(witness['limit']))} is beyond a limit"
        elif "sigma" in witness:
            why = f"{one_line(str(witness['sigma']))} is below its bound"
        elif "clearance" in witness:
            why = f"{one_line(str(witness['clearance']))} are nearer than the clearance"
        pose = (
            f"{key} = {math.degrees(value):.4g} deg" if key.startswith("r") else f"{key} = {value:.4g} m"
            for key, value in witness["pose"].items()
        )
        rows.append(f"  refuted at {', '.join(pose)}: {why}")
    rows += [
        f"  undecided: {count} box{'' if count == 1 else 'es'}: {reason}" for reason, count in proof.reasons.items()
    ]
    return "\n".join(rows)
