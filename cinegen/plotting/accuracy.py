"""Pictures of accuracy: the largest contributors to the error of a node, and what measurements differ from a robot
before and after its calibration."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from cinegen.design.calibration import Calibration
from cinegen.design.tolerance_report import ToleranceReport
from cinegen.plotting.sheet import BLUE, FAINT, INK, LABEL, ORANGE, VERMILION, finish, label, sheet
from raff2urdf.errors import counted
from raff2urdf.quantities import ANGLE, LENGTH, Dimension

if TYPE_CHECKING:
    from cinegen.design.calibration.result import HeldOut

_BARS = 12  # of a side, at most
_WIDE, _TALL = 7.5, 2.1  # inches: width, and height of each row
_LIMIT = 3.0  # standard deviations, drawn as lines
_MOST = 8.0  # standard deviations, of the lower panel


def draw_tolerance(report: ToleranceReport, size: float = 9.0, name: str | None = None) -> Figure:
    """Draw what the largest sources of errors contribute to a node's position and orientation.

    Bars are standard deviations that each source alone causes; numbers are fractions of the variance.

    Args:
        report: of `cinegen.design.tolerance`.
        size: width, inches.
        name: of the robot in the title; its own by default.
    """
    sides = [(report.contributors(turned), turned) for turned in (False, True)]
    bars = max((min(len(contributors), _BARS) for contributors, _ in sides), default=0)
    title = f"{name or report.name}: accuracy of {report.node}"
    text = f"position {1e3 * report.position:.4g} mm, orientation {math.degrees(report.orientation):.4g}° (1 sigma)" + (
        f"\n{report.agreement}" if report.agreement else ""
    )
    figure, body = sheet(size, 1.0 + 0.24 * max(bars, 2), title, text)
    for axes, (contributors, turned) in zip(body.subplots(1, 2), sides, strict=True):
        total, unit = (math.degrees(report.orientation), "°") if turned else (1e3 * report.position, "mm")
        shown = contributors[:_BARS]
        names = [f"{source.name} ({_shown(source.sigma, source.dimension)})" for source, _ in shown]
        sizes = [total * math.sqrt(share) for _, share in shown]
        places = np.arange(len(shown))
        axes.barh(places, sizes, color=ORANGE if turned else BLUE, height=0.7)
        for place, width, (_, share) in zip(places, sizes, shown, strict=True):
            axes.annotate(f" {100.0 * share:.1f} %", (width, place), va="center", fontsize=LABEL, color=INK)
        axes.set_yticks(places, names)
        axes.invert_yaxis()
        axes.margins(x=0.18)
        axes.grid(axis="x", color=FAINT, alpha=0.25)
        more = f"\n({len(contributors) - _BARS} more not shown)" if len(contributors) > _BARS else ""
        label(axes, f"{'orientation' if turned else 'position'} by one source alone, 1 sigma ({unit}){more}")
    return finish(figure)


def draw_residuals(calibration: Calibration, name: str | None = None) -> Figure:
    """Draw the residuals of all readings over the poses, in their standard deviations: at nominal values, and after
    calibration with the outliers marked.

    Args:
        calibration: whose residuals they are.
        name: of the robot in the title; its own by default.

    Returns:
        a matplotlib figure: `draw_residuals(calibration).savefig("residuals.png")`.
    """
    name = name or calibration.parameters.robot.name
    held = ", ".join(
        f"{_shown(each.before, each.dimension)} before, {_shown(each.after, each.dimension)} after{_kept(each)} (noise "
        f"{_shown(each.noise, each.dimension)})"
        for each in calibration.held_out
    )
    count = len(calibration.observation.measurements)
    title = (
        f"{name}: {counted(len(calibration.combinations), 'combination')} of parameters from {counted(count, 'pose')}"
    )
    figure, body = sheet(_WIDE, 2.0 * _TALL + 0.7, title, f"Held-out poses: {held}" if held else "No cross-validation")
    upper, lower = body.subplots(2, 1, sharex=True)
    poses = np.arange(1, len(calibration.before) + 1)
    for axes, residuals in ((upper, calibration.before), (lower, calibration.after)):
        sizes = residuals / calibration.standard
        for dimension, colour, text in ((LENGTH, BLUE, "lengths"), (ANGLE, ORANGE, "angles")):
            columns = [k for k, each in enumerate(calibration.observation.quantities) if each.dimension is dimension]
            if columns:
                shifts = np.linspace(-0.25, 0.25, len(columns)) if len(columns) > 1 else np.zeros(1)
                x = np.broadcast_to(poses[:, None] + shifts, sizes[:, columns].shape)
                kept = calibration.kept[:, columns]
                axes.plot(x[kept], sizes[:, columns][kept], ".", color=colour, markersize=3.0, label=text)
        axes.axhline(0.0, color=FAINT, linewidth=0.8)
        axes.grid(color=FAINT, alpha=0.25)
    for limit in (-_LIMIT, _LIMIT):
        lower.axhline(limit, color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
    if calibration.outliers:
        at = np.array([each.pose + 1 for each in calibration.outliers])
        sizes = np.array([math.copysign(each.sigmas, each.residual) for each in calibration.outliers])
        edge = 0.95 * _MOST
        text = f"outliers, those beyond {_MOST:g} at the edge"
        lower.plot(at, np.clip(sizes, -edge, edge), "x", color=VERMILION, markersize=5.0, label=text)
    lower.set_ylim(-_MOST, _MOST)
    label(upper, y="before: residual / sigma")
    label(lower, "pose", "after: residual / sigma")
    return finish(figure)


def _kept(held_out: HeldOut) -> str:
    return f", {_shown(held_out.kept, held_out.dimension)} without outliers" if held_out.kept != held_out.after else ""


def _shown(value: float, dimension: Dimension) -> str:
    return f"{1e3 * value:.3g} mm" if dimension is LENGTH else f"{math.degrees(value):.3g}°"
