"""`draw_plan`: a path around obstacles, as in figures 5 to 10 of C. De Medio and G. Oriolo, "Robot obstacle avoidance
using vortex fields", Advances in Robot Kinematics, Springer 1991; and its clearance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.body import Body
from cinegen.collision.scene import Scene
from cinegen.planning.planner import Plan
from cinegen.plotting.outline import edge, outline
from cinegen.plotting.plan_layout import PlanLayout
from cinegen.plotting.sheet import finish, label, sheet
from cinegen.plotting.stick import FAINT, INK
from cinegen.plotting.view import Projection

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

OBSTACLE, PATH, STOP, LINK = "#c9ced4", "#0072b2", "#d55e00", "#56b4e9"
"""Grey; Okabe and Ito's blue, vermillion and sky blue."""
MARGIN = "#f1f3f5"
"""Colour of points nearer to an obstacle than the safety distance."""


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
    layout = PlanLayout(plan)
    strategy = plan.attempts[-1].strategy if plan.attempts else plan.reason
    figure, body = sheet(*layout.size, f"{plan.scene.name}: {plan.status.value}", strategy)
    maps, strip = layout.panels(body)
    for axes, view in zip(maps, layout.views, strict=True):
        _paint(axes, layout, view, margin)
    _clearance(strip, layout)
    finish(figure)
    return figure


# --- maps --------------------------------------------------------------------------------------------------------


def _paint(axes: Any, layout: PlanLayout, view: Projection, margin: bool) -> None:
    scene, plan, sides = layout.plan.scene, layout.plan, view.axes[:2]
    low, high = layout.limits(view)
    _obstacles(axes, scene, sides, np.array([low, high]), margin)
    last = len(layout.path) - 1
    shades = np.linspace(0.0, 1.0, len(layout.moments)) if last else np.ones(1)
    for k, (moment, shade) in enumerate(zip(layout.moments, shades, strict=True)):
        for body, placement in zip(layout.robot, layout.placements(layout.path[moment]), strict=True):
            if body.joint or moment == last:
                order = 2.0 + 0.01 * k if body.joint else 1.9
                _link(axes, outline(body, placement, sides), float(shade), order, body.joint == 0)
    trace, goal = layout.trace @ sides.T, sides @ scene.goal.translation
    axes.plot(*trace.T, color="white", linewidth=3.4, zorder=4.0)
    axes.plot(*trace.T, color=PATH, linewidth=1.8, label=f"path of {scene.node}", zorder=4.1)
    marks = [(trace[0], "s", 7, PATH, "start S"), (goal, "*", 13, PATH, "goal G")]
    if not plan and plan.attempts:
        marks.append((trace[-1], "X", 10, STOP, plan.status.value))
    for k, (point, marker, size, colour, text) in enumerate(marks):
        axes.plot(
            *point, marker, color=colour, markersize=size, markeredgecolor="white", markeredgewidth=0.8, label=text,
            zorder=4.2 + 0.1 * k,
        )  # fmt: skip
    axes.set_aspect("equal")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    label(axes, *(f"{_named(direction)} (m)" for direction in sides))
    axes.set_title(view.name, fontsize=9, color=FAINT)


def _obstacles(axes: Any, scene: Scene, view: Array, shown: Array, margin: bool) -> None:
    """Draw obstacles into the part of a view (2, 3) between two corners (2, 2), m.

    All edges are below all faces: no line shows where bodies of an obstacle meet.
    """
    from matplotlib.patches import Polygon

    bodies = [body for obstacle in scene.obstacles for body in obstacle.bodies]
    layers: list[tuple[float, str, dict[str, Any], str, float]] = [
        (0.0, OBSTACLE, {"edgecolor": INK, "linewidth": 1.8}, "obstacle", 1.2)
    ]
    if margin and scene.safety > 0.0:
        margin_line: dict[str, Any] = {"edgecolor": FAINT, "linewidth": 1.3, "linestyle": (0, (4, 3))}
        layers.insert(0, (scene.safety, MARGIN, margin_line, "safety distance", 1.0))
    for growth, colour, line, text, order in layers:
        covered = [_covered(body, view, shown, growth) for body in bodies]
        covered = [corners for corners in covered if len(corners) > 2]
        for corners in covered:
            axes.add_patch(Polygon(corners, facecolor="none", **line, zorder=order))
            axes.add_patch(Polygon(corners, facecolor=colour, edgecolor=colour, linewidth=0.5, zorder=order + 0.1))
        if covered:  # an invisible one for the legend
            axes.add_patch(Polygon(np.full((3, 2), np.nan), facecolor=colour, label=text, **line))


def _covered(body: Body, view: Array, shown: Array, growth: float) -> Array:
    """Return the corners (k, 2) of the part of a view that a body covers; none for a half-space that is not seen
    edge-on."""
    if np.isfinite(body.radius):
        return outline(body, pin.SE3.Identity(), view, growth)
    found = edge(body, view)
    if found is None:
        return np.zeros((0, 2))
    (normal, offset), middle = found, shown.mean(axis=0)
    far = float(np.linalg.norm(np.ptp(shown, axis=0)))
    ahead = min(offset + growth - float(normal @ middle), far)  # of the middle of the picture
    if 2.0 * ahead <= -float(np.abs(normal) @ np.ptp(shown, axis=0)):
        return np.zeros((0, 2))
    foot, side = middle + ahead * normal, far * np.array([-normal[1], normal[0]])
    return np.array([foot - side, foot + side, foot + side - 2.0 * far * normal, foot - side - 2.0 * far * normal])


def _link(axes: Any, corners: Array, shade: float, order: float, is_fixed: bool) -> None:
    """Draw a body of the robot: pale at the start, dark at the end."""
    from matplotlib.patches import Polygon

    if len(corners) < 3:  # a point
        axes.plot(*corners[0], ".", color=_mixed(FAINT, INK, shade), markersize=3, zorder=order)
        return
    face = "white" if is_fixed else _mixed("white", LINK, 0.15 + 0.85 * shade)
    line = _mixed("#cfd4da", INK, shade**1.5)
    axes.add_patch(Polygon(corners, facecolor=face, edgecolor=line, linewidth=0.8, zorder=order))


def _mixed(first: str, second: str, part: float) -> Any:
    """Return a colour between two others."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("", [first, second])(part)


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
    label(axes, "fraction of the motion (%)", "clearance (mm)")
    axes.spines[["top", "right"]].set_visible(False)
