"""`draw_loci`: singular curves on a slice of the workspace, over the singular values of its points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.plotting.stick import FAINT, INK
from cinegen.plotting.units import rounded, user_scale
from cinegen.singularities.contour import SingularCurve
from cinegen.singularities.loci import SingularLoci
from cinegen.singularities.singularity import SingularityType

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

TYPE_1, TYPE_2 = "#0072b2", "#d55e00"
"""Okabe and Ito's blue and vermillion."""


def draw_loci(loci: SingularLoci, size: float = 7.0) -> Figure:
    """Draw curves of both types, shaded by the smaller of both singular values, in mm and degrees.

    Args:
        loci: the curves and the singular values of a slice.
        size: width, inches.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(size, 0.86 * size), layout="constrained", dpi=150)
    axes = figure.add_subplot()
    units = [user_scale(loci.of.mechanism, axis.name) for axis in loci.of.axes]
    u, v = (values * scale for values, (scale, _) in zip((loci.u, loci.v), units, strict=True))
    nearness = np.fmin(loci.first, loci.second)
    shade = axes.pcolormesh(u, v, nearness.T, shading="nearest", cmap="Greys_r", vmin=0.0, alpha=0.55, rasterized=True)
    bar = figure.colorbar(shade, ax=axes, shrink=0.8)
    bar.set_label("smallest singular value of both types, dimensionless")
    scale = np.array([units[0][0], units[1][0]])
    for curve in loci.curves:
        _paint(axes, curve, curve.points * scale)
    home = np.array(loci.of.start()) * scale
    axes.plot(*home, marker="+", color=INK, markersize=10, linestyle="none", label="home")
    along, up = (f"{axis.name} ({unit})" for axis, (_, unit) in zip(loci.of.axes, units, strict=True))
    axes.set_xlabel(along)
    axes.set_ylabel(up)
    if units[0][1] == units[1][1]:
        axes.set_aspect("equal")
    axes.set_xlim(u[0], u[-1])
    axes.set_ylim(v[0], v[-1])
    axes.set_title(_title(loci), fontsize="medium", color=INK)
    handles, labels = axes.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    figure.legend(named.values(), named.keys(), loc="outside lower center", ncols=4, frameon=False)
    return figure


def _paint(axes: Any, curve: SingularCurve, points: Array) -> None:
    colours = {SingularityType.TYPE_1: TYPE_1, SingularityType.TYPE_2: TYPE_2}
    names = {SingularityType.TYPE_1: "type 1: motion lost", SingularityType.TYPE_2: "type 2: motion gained"}
    colour = colours.get(curve.kind, FAINT)
    style: dict[str, Any] = {"linestyle": "-" if curve.kind in colours else ":"}
    if len(points) == 1:
        style = {"linestyle": "none", "marker": "."}
    axes.plot(*points.T, color=colour, linewidth=1.8, label=names.get(curve.kind, "end of the branch"), **style)


def _title(loci: SingularLoci) -> str:
    given = loci.of.given(*loci.of.start())
    others = [name for name in given if name not in (axis.name for axis in loci.of.axes)]
    units = {name: user_scale(loci.of.mechanism, name) for name in others}
    at = ", ".join(f"{name} {rounded(given[name] * scale, 6):.4g} {unit}" for name, (scale, unit) in units.items())
    what = loci.of.mechanism.name if loci.of.over_joints else f"{loci.of.node} of {loci.of.mechanism.name}"
    return f"Singularities of {what}" + (f" at {at}" if at else "")
