"""Pictures of all results of a synthesis: where the starts ended, and the Pareto front."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from cinegen.design.synthesis import QUANTITIES, Synthesis
from cinegen.plotting.sheet import BLUE, FAINT, ORANGE, VERMILION, finish, graph, label
from raff2urdf.quantities import NUMBER, shown_scale

_WIDE = 7.2  # inches


def heading_of(result: Synthesis, quantity: str) -> tuple[float, str]:
    """Return the factor from SI to what is shown of a quantity, and its meaning with that unit."""
    dimension = result.problem.scoring.dimension(quantity)
    scale, unit = shown_scale(dimension)
    unit = "of the limit" if quantity == "torque" and dimension is NUMBER else unit
    return scale, QUANTITIES[quantity].meaning + f" ({unit})" * bool(unit)


def draw_parameters(result: Synthesis) -> Figure:
    """Draw the parameters within their ranges: of the file, where feasible starts ended, and chosen."""
    names = result.parameters.names
    low, high = result.parameters.bounds.T
    figure, axes = graph(_WIDE, 0.9 + 0.3 * len(names))
    at = np.arange(len(names))
    axes.hlines(at, 0.0, 1.0, color=FAINT, linewidth=0.8)
    style: dict[str, Any] = {"linestyle": "none", "clip_on": False, "zorder": 4.0}
    axes.plot((result.parameters.values - low) / (high - low), at, marker="o", markerfacecolor="white", color=ORANGE,
              markersize=6.0, markeredgewidth=1.4, label="before", **style)  # fmt: skip
    ends = [np.array(start.x)[: len(names)] for start in result.starts if start.is_feasible]
    for k, p in enumerate(ends):
        axes.plot((p - low) / (high - low), at, marker="|", color=BLUE, markersize=13.0,
                  label="where a start ended" if not k else None, **style)  # fmt: skip
    axes.plot((result.p - low) / (high - low), at, marker="D", color=VERMILION, markersize=5.0, label="after", **style)
    axes.set_yticks(at, names)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.0)
    axes.margins(y=0.3)
    axes.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0], ["lower bound", "25 %", "50 %", "75 %", "upper bound"])
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.tick_params(axis="y", length=0, pad=8.0)
    label(axes)
    return finish(figure)


def draw_front(result: Synthesis, first: int, second: int) -> Figure:
    """Draw a Pareto front by two of its objectives, with the chosen point and the robot of the file."""
    chosen = [first, second]
    scales, texts = zip(*(heading_of(result, result.task.objectives[k].quantity) for k in chosen), strict=True)
    front, after, before = (
        np.array(values)[..., chosen] * scales
        for values in ([point.values for point in result.front], result.values, result.before)
    )
    figure, axes = graph(_WIDE, 3.4)
    axes.plot(*front.T, "o", color=BLUE, markersize=4.5, label="Pareto front")
    axes.plot(*after, "D", color=VERMILION, markersize=7.0, label="chosen")
    if np.isfinite(before).all():
        axes.plot(*before, "o", markerfacecolor="white", color=ORANGE, markersize=6.0, markeredgewidth=1.4,
                  label="before")  # fmt: skip
    axes.grid(color=FAINT, alpha=0.25)
    label(axes, *texts)
    return finish(figure)
