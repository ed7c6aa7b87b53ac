"""`draw_plan`: a path around obstacles, as in figures 5 to 10 of C. De Medio and G. Oriolo, "Robot obstacle avoidance
using vortex fields", Advances in Robot Kinematics, Springer 1991; and its clearance."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.body import Body
from cinegen.collision.scene import Scene
from cinegen.planning.planner import Plan
from cinegen.plotting.outline import edge, outline
from cinegen.plotting.plan_layout import FRONT, RIGHT, TOP, PlanLayout
from cinegen.plotting.stick import FAINT, INK

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

OBSTACLE, PATH, STOP, LINK = "#c9ced4", "#0072b2", "#d55e00", "#56b4e9"
"""Grey; Okabe and Ito's blue, vermillion and sky blue."""
MARGIN = "#f1f3f5"
"""Colour of points nearer to an obstacle than the safety distance."""

_NAMES = {"top": TOP, "front": FRONT, "right": RIGHT}
_LETTERS = 80  # in a line of the title
_HIGHEST = 12.0  # safety distances: largest clearance that is shown


def draw_plan(plan: Plan, margin: bool = True) -> Figure:
    """Draw the robot on its path at about 15 equidistant configurations, from pale at the start to dark at the end; the
    path of its node; the obstacles; and where it got stuck. Below, the clearance along the path with the safety
    distance.

    A planar robot is drawn along the normal of its plane; others from the top, the front and the right. Links are drawn
    as the convex bodies to which distances are measured.

    Args:
        plan: any plan, also one that did not reach its goal.
        margin: whether the safety distance is drawn around obstacles.

    Returns:
        a matplotlib figure whose last axes show the clearance: `draw_plan(plan).savefig("plan.png")`.
    """
    from matplotlib.figure import Figure

    layout = PlanLayout(plan)
    figure = Figure(figsize=layout.size, layout="constrained", dpi=150)
    maps, strip = layout.panels(figure)
    for axes, view in zip(maps, layout.views, strict=True):
        _paint(axes, layout, view, margin)
    _clearance(strip, layout)
    figure.suptitle(_title(plan), fontsize="medium", color=INK)
    _legend(figure, maps[0])
    return figure


# --- maps --------------------------------------------------------------------------------------------------------


def _paint(axes: Any, layout: PlanLayout, view: Array, margin: bool) -> None:
    scene, plan = layout.plan.scene, layout.plan
    across, upright = layout.shows(view)
    _obstacles(axes, scene, view, (across, upright), margin)
    last = len(layout.path) - 1
    shades = np.linspace(0.0, 1.0, len(layout.moments)) if last else np.ones(1)
    for k, (moment, shade) in enumerate(zip(layout.moments, shades, strict=True)):
        for body, placement in zip(layout.robot, layout.placements(layout.path[moment]), strict=True):
            if body.joint or moment == last:
                order = 2.0 + 0.01 * k if body.joint else 1.9
                _link(axes, outline(body, placement, view), float(shade), order, body.joint == 0)
    trace, goal = layout.trace @ view.T, view @ scene.goal.translation
    axes.plot(*trace.T, color="white", linewidth=3.4, zorder=4.0)
    axes.plot(*trace.T, color=PATH, linewidth=1.8, label=f"path of {scene.node}", zorder=4.1)
    marks = [(trace[0], "s", 7, PATH, "start S"), (goal, "*", 13, PATH, "goal G")]
    if not plan and plan.attempts:
        marks.append((trace[-1], "X", 10, STOP, plan.status.value))
    for k, (place, marker, size, colour, label) in enumerate(marks):
        axes.plot(
            *place, marker, color=colour, markersize=size, markeredgecolor="white", markeredgewidth=0.8, label=label,
            zorder=4.2 + 0.1 * k,
        )  # fmt: skip
    axes.set_aspect("equal")
    axes.set_xlim(*across)
    axes.set_ylim(*upright)
    for label, direction in zip((axes.set_xlabel, axes.set_ylabel), view, strict=True):
        label(f"{_named(direction)} (m)")
    if len(layout.views) > 1:
        name = next(name for name, one in _NAMES.items() if one is view)
        axes.set_title(name, fontsize=9, color=FAINT)


def _obstacles(axes: Any, scene: Scene, view: Array, shown: tuple[Array, Array], margin: bool) -> None:
    """Draw obstacles. All edges are below all faces: no line shows where pieces of an obstacle meet."""
    from matplotlib.patches import Polygon

    bodies = [body for obstacle in scene.obstacles for body in obstacle.bodies]
    layers: list[tuple[float, str, dict[str, Any], str, float]] = [
        (0.0, OBSTACLE, {"edgecolor": INK, "linewidth": 1.8}, "obstacle", 1.2)
    ]
    if margin and scene.safety > 0.0:
        margin_line: dict[str, Any] = {"edgecolor": FAINT, "linewidth": 1.3, "linestyle": (0, (4, 3))}
        layers.insert(0, (scene.safety, MARGIN, margin_line, "safety distance", 1.0))
    for growth, colour, line, label, order in layers:
        named: dict[str, Any] = {"label": label}
        for body in bodies:
            corners = _covered(body, view, shown, growth)
            if len(corners) > 2:
                axes.add_patch(Polygon(corners, facecolor="none", **line, zorder=order))
                axes.add_patch(Polygon(corners, facecolor=colour, edgecolor=colour, linewidth=0.5, zorder=order + 0.1))
                if named:
                    # invisible, for the legend
                    axes.add_patch(Polygon(np.full((3, 2), np.nan), facecolor=colour, **line, **named))
                    named = {}


def _covered(body: Body, view: Array, shown: tuple[Array, Array], growth: float) -> Array:
    """Return the corners (k, 2) of the part of the picture that a body covers; none for a half-space that is not seen
    edge-on."""
    if np.isfinite(body.radius):
        return outline(body, pin.SE3.Identity(), view, growth)
    found = edge(body, view)
    if found is None:
        return np.zeros((0, 2))
    (left, right), (low, high) = shown
    return _behind(np.array([[left, low], [right, low], [right, high], [left, high]]), found[0], found[1] + growth)


def _behind(corners: Array, normal: Array, offset: float) -> Array:
    """Return the part (k, 2) of a convex polygon (n, 2) with n.p <= c (I. Sutherland and G. Hodgman, 1974)."""
    kept: list[Array] = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        beyond, next_beyond = normal @ a - offset, normal @ b - offset
        if beyond <= 0.0:
            kept.append(a)
        if (beyond <= 0.0) != (next_beyond <= 0.0):
            kept.append(a + beyond / (beyond - next_beyond) * (b - a))
    return np.array(kept).reshape(-1, 2)


def _link(axes: Any, corners: Array, shade: float, order: float, is_fixed: bool) -> None:
    """Draw a body of the robot: pale at the start, dark at the end."""
    from matplotlib.patches import Polygon

    if len(corners) < 3:  # a point
        axes.plot(*corners[0], ".", color=_mixed(FAINT, INK, shade), markersize=3, zorder=order)
        return
    face = "white" if is_fixed else _mixed("#ffffff", LINK, 0.15 + 0.85 * shade)
    line = _mixed("#cfd4da", INK, shade**1.5)
    axes.add_patch(Polygon(corners, facecolor=face, edgecolor=line, linewidth=0.8, zorder=order))


def _mixed(first: str, second: str, part: float) -> tuple[float, float, float]:
    """Return a colour between two others."""
    from matplotlib.colors import to_rgb

    a, b = (np.array(to_rgb(colour)) for colour in (first, second))
    red, green, blue = a + part * (b - a)
    return float(red), float(green), float(blue)


def _named(direction: Array) -> str:
    """Return the name of an axis of the picture: x, y or z, if it is one."""
    return next((name for name, axis in zip("xyz", np.eye(3), strict=True) if direction @ axis > 1.0 - 1e-9), "along")


# --- clearance ---------------------------------------------------------------------------------------------------


def _clearance(axes: Any, layout: PlanLayout) -> None:
    """Draw the shortest distance between any two bodies, over the fraction of the motion."""
    travel, clearances, safety = layout.travel, 1e3 * layout.clearances, 1e3 * layout.plan.scene.safety
    axes.axhline(safety, color=STOP, linewidth=1.2, linestyle="--")
    axes.annotate(
        f"{safety:g} mm\nsafety", (1.0, safety), (4, 0), xycoords=axes.get_yaxis_transform(),
        textcoords="offset points", color=STOP, fontsize=8, va="center",
    )  # fmt: skip
    if np.isfinite(clearances).any():
        least, most = float(clearances.min()), float(clearances.max())
        part = 100.0 * travel / max(float(travel[-1]), 1e-300)
        axes.plot(
            part, clearances, color=INK, linewidth=1.3, marker="o" if len(part) == 1 else "", clip_on=len(part) > 1
        )
        if safety > 0.0:
            most = min(most, max(_HIGHEST * safety, 2.0 * least))  # larger clearances do not matter
        axes.set_ylim(min(0.0, 1.1 * least), 1.1 * max(most, 1.5 * safety, 1e-3))
    else:
        axes.set_ylim(0.0, max(4.0 * safety, 1.0))
        axes.text(0.5, 0.6, "no obstacles", transform=axes.transAxes, color=FAINT, ha="center")
    axes.set_xlim(0.0, 100.0)
    axes.set_xlabel("fraction of the motion (%)")
    axes.set_ylabel("clearance (mm)")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _title(plan: Plan) -> str:
    strategy = plan.attempts[-1].strategy if plan.attempts else plan.reason
    return f"{plan.scene.name}: {plan.status.value}\n{textwrap.fill(strategy, _LETTERS)}"


def _legend(figure: Figure, axes: Any) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=min(len(labels), 6), frameon=False, fontsize=9,
        columnspacing=1.3,
    )  # fmt: skip
