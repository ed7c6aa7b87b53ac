"""Singular curves: `paint_curves` in any axes; `draw_loci` on a slice, over the singular values of its points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke

from cinegen.arrays import Array
from cinegen.plotting.sheet import BLUE, INK, LABEL, VERMILION, finish, label, sheet
from cinegen.singularities.contour import SingularCurve
from cinegen.singularities.loci import SingularLoci
from cinegen.singularities.singularity import SingularityType
from cinegen.user_units import coordinate_text, user_scale

TYPE_1, TYPE_2 = BLUE, VERMILION
"""Colours of singular curves."""

_STYLES = {
    SingularityType.TYPE_1: (TYPE_1, "type 1: lost DoF"),
    SingularityType.TYPE_2: (TYPE_2, "type 2: uncontrolled DoF"),
    SingularityType.NONE: ("#4b525a", "border, not singular"),
}
_BORDER = 0.55  # width of a border, over that of a singular curve
_CASING = 1.5  # points: white around lines


def draw_loci(loci: SingularLoci, size: float = 7.0, name: str | None = None) -> Figure:
    """Draw curves of both types, shaded by the smaller of both singular values, in m and degrees.

    Args:
        loci: the curves and the singular values of a slice.
        size: width, inches.
        name: of the robot in the title; its own by default.
    """
    slice_, mechanism, start = loci.of, loci.of.mechanism, loci.of.start()
    names = [axis.name for axis in slice_.axes]
    scales, units = zip(*(user_scale(mechanism, name) for name in names), strict=True)
    robot = name or mechanism.name
    subject = "singularities over actuated joints" if slice_.over_joints else f"singularities of {slice_.node}"
    fixed = [coordinate_text(mechanism, *pair) for pair in slice_.given(*start).items() if pair[0] not in names]
    figure, body = sheet(size, 0.8 * size, f"{robot}: {subject}", ", ".join(fixed))
    axes = body.add_subplot()
    u, v = loci.u * scales[0], loci.v * scales[1]
    nearness = np.fmin(loci.first, loci.second)
    shade = axes.pcolormesh(u, v, nearness.T, shading="nearest", cmap="Greys_r", vmin=0.0, alpha=0.55, rasterized=True)
    bar = body.colorbar(shade, ax=axes, shrink=0.8)
    bar.set_label("smallest singular value of both types, dimensionless", fontsize=LABEL, color=INK)
    bar.ax.tick_params(labelsize="small")
    paint_curves(axes, loci.curves, lambda points: points * scales)
    axes.plot(*(start * np.array(scales)), marker="+", color=INK, markersize=10, linestyle="none", label="home")
    label(axes, *(f"{name} ({unit})" for name, unit in zip(names, units, strict=True)))
    if units[0] == units[1]:
        axes.set_aspect("equal")
    axes.set_xlim(u[0], u[-1])
    axes.set_ylim(v[0], v[-1])
    return finish(figure)


def paint_curves(
    axes: Axes, curves: Sequence[SingularCurve], drawn: Callable[[Array], Array], width: float = 1.8
) -> None:
    """Draw singular curves, and borders that are not singular.

    Args:
        axes: of matplotlib.
        curves: in m and rad.
        drawn: returns the points (n, 2) of a curve in the axes.
        width: of singular curves, points.
    """
    for curve in sorted(curves, key=lambda curve: curve.kind is not SingularityType.NONE):
        colour, text = _STYLES[curve.kind]
        singular = curve.kind is not SingularityType.NONE
        wide = width if singular else _BORDER * width
        style: dict[str, Any] = {"linestyle": "-"}
        if len(curve.points) == 1:
            style = {"linestyle": "none", "marker": ".", "markersize": 2.0 * wide}
        (line,) = axes.plot(
            *drawn(curve.points).T, color=colour, linewidth=wide, zorder=3.0, label=text, solid_joinstyle="round",
            **style,
        )  # fmt: skip
        if singular:
            line.set_path_effects([Stroke(linewidth=wide + _CASING, foreground="white"), Normal()])
