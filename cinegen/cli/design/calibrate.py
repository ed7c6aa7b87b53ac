"""`cinegen calibrate`: the true dimensions of a robot, from measurements."""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cinegen.cli.design.tolerance import amounts
from cinegen.cli.files import check_outputs, print_result, write, write_figure
from cinegen.cli.options import FILE, JSON, PLOT, ROBOT, force_option, output_option, shown_name
from cinegen.cli.progress import Progress
from raff2urdf.command.command_line import flag, option
from raff2urdf.errors import counted, first_of
from raff2urdf.quantities import LENGTH

if TYPE_CHECKING:
    from cinegen.design import Calibration
    from cinegen.design.calibration.proposal import Proposal

_SHOWN = 12  # parameters, dependencies, outliers

MEASUREMENTS = typer.Argument(..., metavar="CSV", help="measurements: a line for each pose; docs/design.md")


def run(
    file: Path = FILE,
    measurements: Path = MEASUREMENTS,
    vary: list[str] = option("NAMES", "parameters that are estimated: 'link*.d, base.*' (default: all)", ()),
    tie: list[str] = option("TIE", "parameters that are equal: 'link2.d = link7.d'", ()),
    gain: list[str] = option("JOINTS", "joints whose encoders have an unknown gain: joint1,joint3", ()),
    sigma: list[str] = option(
        "NAME=S", "expected errors of manufacture: 'link*.d=0.1mm' (default: 0.3 mm, 0.05 degrees)", ()
    ),
    keep_outliers: bool = flag("--keep-outliers", "use all readings, also those that contradict the others"),
    folds: int = option("N", "parts of the poses for cross-validation; 0 for none", 5, min=0, max=1000),
    propose: int = option("N", "also propose the poses that should be measured next", 0, min=0, max=1000),
    poses: Path | None = option(
        "FILE", "CSV file for the poses proposed (default: printed)", needs="--propose", endings=(".csv",)
    ),
    output: Path | None = output_option("FILE", "the calibrated robot, as RAFF", ".raff"),
    robot: str | None = ROBOT,
    all_: bool = flag("--all", "print all parameters, dependencies and outliers", unless="--json"),
    plot: Path | None = PLOT,
    force: bool = force_option("--output, --poses, --plot"),
    json: bool = JSON,
) -> int:
    """Estimate the true dimensions of a robot from measurements.

    Poses, positions, distances, touched planes and redundant encoders may be mixed in one file, with the standard
    deviation of each. Combinations of parameters that they determine are estimated; those that can't be told apart are
    named, and outliers are left out and listed.
    """
    check_outputs(output, poses, plot, force=force, json=json)
    from cinegen.design import calibrate

    errors = amounts(sigma, "--sigma")
    with Progress() as progress:
        progress.text("calibrating")
        calibration = calibrate(
            file, measurements, names=_words(vary) or ("*",), ties=tie, sigma=errors, gains=_words(gain),
            robust=not keep_outliers, folds=folds, robot=robot,
        )  # fmt: skip
        proposal = None
        if propose:
            from cinegen.design.calibration.proposal import propose as propose_poses

            progress.text("choosing poses")
            proposal = propose_poses(calibration, propose)
    name = shown_name(file, robot)
    report: dict[str, Any] = {"name": name, **calibration.as_dict()}
    if proposal is not None:
        report["proposal"] = {
            "joints": list(proposal.inputs), "readings": proposal.readings.tolist(), "gain": proposal.gain,
            "random_gain": proposal.random_gain,
        }  # fmt: skip
    print_result(report, _text(calibration, name, None if all_ else _SHOWN), json)
    if proposal is not None:
        if not json:
            print("\n" + _proposed(proposal, poses), flush=True)
        if poses is not None:
            write(poses, proposal.text())
    if output is not None:
        write(output, calibration.raff())
        if not json:
            print(f"robot: {output}", flush=True)
    if plot is not None:
        from cinegen.plotting.accuracy import draw_residuals

        write_figure(plot, draw_residuals(calibration, name), quiet=json)
    return 0


def _words(texts: list[str]) -> list[str]:
    return [word for text in texts for word in text.replace(",", " ").split()]


# --- what is printed --------------------------------------------------------------------------------------------------


def _text(result: Calibration, name: str, most: int | None) -> str:
    """Return the report, in mm and degrees."""
    readings = int(result.kept.sum())
    lines = [
        f"{name}: {counted(len(result.combinations), 'combination')} of {counted(len(result.names), 'parameter')} are "
        f"estimated from {readings} readings in {counted(len(result.observation.measurements), 'pose')}"
    ]
    fit = f"chi-square {result.chi2:.4g} for {result.degrees_of_freedom} degrees of freedom"
    right = f" (1 each if the sigmas are right: {result.fit:.2f})" if result.degrees_of_freedom > 0 else ""
    lines.append(f"  {fit}{right}")
    weak = result.subspace.rank - len(result.combinations)
    if weak:
        lines.append(f"  {weak} more could be told apart, but not to 100 expected errors: they stay nominal")
    lines += _held_out(result)
    if len(result.observation.frames):
        lines += ["", "  devices in the world, targets on their nodes"]
        lines += [f"    {_pose(of, pose)}" for of, pose in result.frames.items()]
    lines += _changes(result, most)
    if result.dependencies:
        lines += ["", "  can't be told apart by these measurements (their smallest changes that fit are used)"]
        for dependency in result.dependencies[:most]:
            lines += textwrap.wrap(dependency.text, 108, initial_indent="    ", subsequent_indent="      ")
        lines += _more(result.dependencies, most)
    for names, text in (
        (result.without_effect, "change no reading"),
        (result.opening, "would open loops of an over-constrained mechanism, and stay nominal"),
    ):
        if names:
            listed = f"{counted(len(names), 'parameter')} {text}: {first_of(names, most or len(names))}"
            lines += ["", *textwrap.wrap(listed, 110, initial_indent="  ", subsequent_indent="  ")]
    return "\n".join([*lines, *_outliers(result, most)])


def _held_out(result: Calibration) -> list[str]:
    """Return lines about poses that were not used, if there was a cross-validation."""
    if not result.held_out:
        return []
    lines = ["", f"  cross-validation, {result.folds} parts: root mean square errors of poses that were not used"]
    for part in result.held_out:
        is_length = part.dimension is LENGTH
        errors = (part.before, part.after, part.kept, part.noise)
        before, after, kept, noise = (_shown(error, "m" if is_length else "rad") for error in errors)
        calibrated = f"{after:>14} calibrated" + f" ({kept} without outliers)" * bool(result.outliers)
        kind = "lengths" if is_length else "angles"
        lines.append(f"    {kind:<10}{before:>14} as described{calibrated}{noise:>14} noise of the readings")
    return lines


def _changes(result: Calibration, most: int | None) -> list[str]:
    """Return lines about the parameters that are known by themselves, the most significant changes first."""
    import numpy as np

    changed = [k for k in range(len(result.names) - len(result.observation.frames)) if result.separate[k]]
    significance = np.abs(result.values - result.nominal) / np.maximum(result.sigmas, 1e-300)
    changed.sort(key=lambda k: -float(significance[k]))
    if not changed:
        return []
    lines = ["", f"  {counted(len(changed), 'parameter')} known by themselves, the most significant changes first"]
    for k in changed[:most]:
        name, unit = result.names[k], result.unit(result.names[k])
        change = _shown(result.values[k] - result.nominal[k], unit, "+")
        nominal, sigma = _shown(result.nominal[k], unit), _shown(result.sigmas[k], unit)
        lines.append(f"    {name:<18}{nominal:>16}{change:>16} +- {sigma}")
    return lines + _more(changed, most)


def _outliers(result: Calibration, most: int | None) -> list[str]:
    """Return lines about the readings that are left out."""
    if not result.outliers:
        return []
    lines = ["", f"  {counted(len(result.outliers), 'outlier')} left out"]
    ordered = sorted(result.outliers, key=lambda outlier: -outlier.sigmas)
    quantities = result.observation.measurements.quantities
    for outlier in ordered[:most]:
        residual = _shown(outlier.residual, "m" if quantities[outlier.column].dimension is LENGTH else "rad", "+")
        lines.append(f"    {outlier.where}: {residual}, {outlier.sigmas:.3g} sigma")
    return lines + _more(ordered, most)


def _proposed(proposal: Proposal, poses: Path | None) -> str:
    text = (
        f"next {counted(len(proposal), 'pose')}, D-optimal among random ones within joint limits: standard deviations "
        f"shrink {proposal.gain:.3g} times on average, {proposal.random_gain:.3g} times for random poses"
    )
    if poses is not None:
        return f"{textwrap.fill(text, 110)}\nposes: {poses}"
    return f"{textwrap.fill(text, 110)}\n\n{proposal.text().rstrip()}"


def _pose(name: str, pose: Any) -> str:
    import pinocchio as pin

    place = ", ".join(f"{1e3 * x:.3f}" for x in pose[:3, 3])
    turn = ", ".join(f"{math.degrees(x):.4f}" for x in pin.rpy.matrixToRpy(pose[:3, :3]))
    return f"{name:<12} x, y, z {place} mm; rx, ry, rz {turn} deg"


def _more(things: Any, most: int | None) -> list[str]:
    left = len(things) - most if most is not None else 0
    return [f"    and {left} more (--all)"] if left > 0 else []


def _shown(value: float, unit: str, sign: str = "") -> str:
    if unit == "":
        return f"{value:{sign}.3e}"
    scale, text = (1e3, "mm") if unit == "m" else (math.degrees(1.0), "deg")
    number = scale * value
    return f"{0.0 if abs(number) < 5e-7 else number:{sign}.{4 if abs(number) < 100 else 3}f} {text}"
