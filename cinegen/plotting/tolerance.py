"""`draw_tolerance`: the largest contributors to the error of a node, as bars."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from cinegen.design.tolerance import ToleranceReport
from cinegen.plotting.sheet import BLUE, FAINT, INK, LABEL, ORANGE, finish, label, sheet
from raff2urdf.quantities import ANGLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST = 12  # bars


def draw_tolerance(report: ToleranceReport, size: float = 9.0, name: str | None = None) -> Figure:
    """Draw what the largest sources of errors contribute to a node's position and orientation.

    Bars are standard deviations that each source alone causes; numbers are fractions of the variance.

    Args:
        report: of `cinegen.design.tolerance`.
        size: width, inches.
        name: of the robot in the title; its own by default.
    """
    sides = [(report.contributors(turned), turned) for turned in (False, True)]
    bars = max((min(len(found), _MOST) for found, _ in sides), default=0)
    title = f"{name or report.name}: accuracy of {report.node}"
    text = f"position {1e3 * report.position:.4g} mm, orientation {math.degrees(report.orientation):.4g}° (1 sigma)" + (
        f"\n{report.agreement}" if report.agreement else ""
    )
    figure, body = sheet(size, 1.0 + 0.24 * max(bars, 2), title, text)
    for axes, (found, turned) in zip(body.subplots(1, 2), sides, strict=True):
        total, unit = (math.degrees(report.orientation), "°") if turned else (1e3 * report.position, "mm")
        shown = found[:_MOST]
        names = [f"{one.name} ({_amount(one.sigma, one.dimension is ANGLE)})" for one, _ in shown]
        sizes = [total * math.sqrt(share) for _, share in shown]
        places = np.arange(len(shown))
        axes.barh(places, sizes, color=ORANGE if turned else BLUE, height=0.7)
        for place, width, (_, share) in zip(places, sizes, shown, strict=True):
            axes.annotate(f" {100.0 * share:.1f} %", (width, place), va="center", fontsize=LABEL, color=INK)
        axes.set_yticks(places, names)
        axes.invert_yaxis()
        axes.margins(x=0.18)
        axes.grid(axis="x", color=FAINT, alpha=0.25)
        more = f"\n({len(found) - _MOST} more not shown)" if len(found) > _MOST else ""
        label(axes, f"{'orientation' if turned else 'position'} by one source alone, 1 sigma ({unit}){more}")
    return finish(figure)


def _amount(sigma: float, is_angle: bool) -> str:
    return f"{math.degrees(sigma):.3g}°" if is_angle else f"{1e3 * sigma:.3g} mm"
