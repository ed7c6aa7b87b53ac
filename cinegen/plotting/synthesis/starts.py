"""Pictures of all results of a synthesis: where the starts ended, and the Pareto front."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from cinegen.arrays import Array
from cinegen.design.synthesis import Synthesis
from cinegen.plotting.sheet import BLUE, FAINT, ORANGE, VERMILION, finish, graph, label
from cinegen.plotting.synthesis.wording import heading_of, unit_of

_WIDE = 7.2  # inches


def draw_parameters(result: Synthesis, good: list[Array]) -> Figure:
    """Draw the parameters within their ranges: of the file, where starts ended, and chosen.

    Args:
        result: of the synthesis.
        good: (parameters,) values of the starts that keep all constraints.
    """

    names = result.parameters.names
    low, high = result.parameters.bounds.T
    figure, axes = graph(_WIDE, 0.9 + 0.3 * len(names))
    at = np.arange(len(names))
    axes.hlines(at, 0.0, 1.0, color=FAINT, linewidth=0.8)
    style: dict[str, Any] = {"linestyle": "none", "clip_on": False, "zorder": 4.0}
    axes.plot((result.parameters.values - low) / (high - low), at, marker="o", markerfacecolor="white", color=ORANGE,
              markersize=6.0, markeredgewidth=1.4, label="before", **style)  # fmt: skip
    for k, p in enumerate(good):
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

    objectives = [result.task.objectives[k] for k in (first, second)]
    scales = np.array([unit_of(goal.quantity, result.torque_unit)[0] for goal in objectives])
    values = np.array([point.values for point in result.front])[:, [first, second]] * scales
    figure, axes = graph(_WIDE, 3.4)
    if len(result.task.objectives) == 2:
        order = np.argsort(values[:, 0])
        axes.plot(*values[order].T, color=BLUE, linewidth=0.9)
    axes.plot(*values.T, "o", color=BLUE, markersize=4.5, label="Pareto front")
    chosen = np.array(result.values)[[first, second]] * scales
    axes.plot(*chosen, "D", color=VERMILION, markersize=7.0, label="chosen")
    before = np.array(result.before)[[first, second]] * scales
    if np.isfinite(before).all():
        axes.plot(*before, "o", markerfacecolor="white", color=ORANGE, markersize=6.0, markeredgewidth=1.4,
                  label="before")  # fmt: skip
    axes.grid(color=FAINT, alpha=0.25)
    label(
        axes,
        *(
            f"{heading_of(goal.quantity, result.torque_unit)}{'' if goal.is_maximised else ': less is better'}"
            for goal in objectives
        ),
    )
    return finish(figure)
