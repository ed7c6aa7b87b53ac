"""`draw_plan`: a way round obstacles, as in figures 5 to 10 of C. De Medio and G. Oriolo, "Robot obstacle avoidance
using vortex fields", Advances in Robot Kinematics, Springer 1991; and how clear of everything it is."""

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
from cinegen.plotting.potentials import FAINT, INK, SOLID, STOP, WAY
from cinegen.plotting.stage import FRONT, RIGHT, TOP, Stage

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

LINK = "#56b4e9"
"""Okabe and Ito's sky blue: what the robot fills."""
HALO = "#f1f3f5"
"""What is nearer to an obstacle than the safety distance."""

_NAMES = {"top": TOP, "front": FRONT, "right": RIGHT}
_LETTERS = 80  # of a title in a line
_HIGH = 12.0  # safety distances: up to there the clearance is shown


def draw_plan(plan: Plan, margin: bool = True) -> Figure:
    """The robot on its way at about 15 moments that are equally far from each other, from pale at the start to dark at
    the end; the way of its node; the obstacles; and where it got stuck, if it did. Below, the clearance along the way,
    beside the safety distance.

    What moves in a plane is seen along its normal; all else from the top, from the front and from the right. Links are
    drawn as what distances are measured to: their capsules and hulls.

    Args:
        plan: any, also one that did not reach its goal.
        margin: whether the safety distance is drawn around obstacles.

    Returns:
        a matplotlib figure whose last axes is the clearance: `draw_plan(plan).savefig("plan.png")`.
    """
    from matplotlib.figure import Figure

    stage = Stage(plan)
    figure = Figure(figsize=stage.size, layout="constrained", dpi=150)
    maps, strip = stage.panels(figure)
    for axes, view in zip(maps, stage.views, strict=True):
        _paint(axes, stage, view, margin)
    _clearance(strip, stage)
    figure.suptitle(_title(plan), fontsize="medium", color=INK)
    _legend(figure, maps[0])
    return figure


# --- maps --------------------------------------------------------------------------------------------------------


def _paint(axes: Any, stage: Stage, view: Array, margin: bool) -> None:
    scene, plan = stage.plan.scene, stage.plan
    across, upright = stage.shows(view)
    _obstacles(axes, scene, view, (across, upright), margin)
    last = len(stage.path) - 1
    shades = np.linspace(0.0, 1.0, len(stage.moments)) if last else np.ones(1)
    for k, (moment, shade) in enumerate(zip(stage.moments, shades, strict=True)):
        for body, placement in zip(stage.robot, stage.placements(stage.path[moment]), strict=True):
            if body.joint or moment == last:
                order = 2.0 + 0.01 * k if body.joint else 1.9
                _link(axes, outline(body, placement, view), float(shade), order, body.joint == 0)
    trace, goal = stage.trace @ view.T, view @ scene.goal.translation
    axes.plot(*trace.T, color="white", linewidth=3.4, zorder=4.0)
    axes.plot(*trace.T, color=WAY, linewidth=1.8, label=f"way of {scene.node}", zorder=4.1)
    marks = [(trace[0], "s", 7, WAY, "start S"), (goal, "*", 13, WAY, "goal G")]
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
    if len(stage.views) > 1:
        name = next(name for name, one in _NAMES.items() if one is view)
        axes.set_title(name, fontsize=9, color=FAINT)


def _obstacles(axes: Any, scene: Scene, view: Array, shown: tuple[Array, Array], margin: bool) -> None:
    """All edges lie below all faces: where pieces of an obstacle meet, no line is seen."""
    from matplotlib.patches import Polygon

    bodies = [body for obstacle in scene.obstacles for body in obstacle.bodies]
    layers: list[tuple[float, str, dict[str, Any], str, float]] = [
        (0.0, SOLID, {"edgecolor": INK, "linewidth": 1.8}, "obstacle", 1.2)
    ]
    if margin and scene.safety > 0.0:
        halo: dict[str, Any] = {"edgecolor": FAINT, "linewidth": 1.3, "linestyle": (0, (4, 3))}
        layers.insert(0, (scene.safety, HALO, halo, "safety distance", 1.0))
    for wider, colour, line, label, order in layers:
        named: dict[str, Any] = {"label": label}
        for body in bodies:
            corners = _covered(body, view, shown, wider)
            if len(corners) > 2:
                axes.add_patch(Polygon(corners, facecolor="none", **line, zorder=order))
                axes.add_patch(Polygon(corners, facecolor=colour, edgecolor=colour, linewidth=0.5, zorder=order + 0.1))
                if named:
                    # drawn nowhere: what the legend shows of both
                    axes.add_patch(Polygon(np.full((3, 2), np.nan), facecolor=colour, **line, **named))
                    named = {}


def _covered(body: Body, view: Array, shown: tuple[Array, Array], wider: float) -> Array:
    """(k, 2) corners of what a body covers of what is shown; none where that is nothing, or a half-space that is not
    seen on its edge."""
    if np.isfinite(body.radius):
        return outline(body, pin.SE3.Identity(), view, wider)
    found = edge(body, view)
    if found is None:
        return np.zeros((0, 2))
    (left, right), (low, high) = shown
    return _behind(np.array([[left, low], [right, low], [right, high], [left, high]]), found[0], found[1] + wider)


def _behind(corners: Array, normal: Array, offset: float) -> Array:
    """(k, 2) the part of a convex polygon (n, 2) with n.p <= c, as I. Sutherland and G. Hodgman cut it (1974)."""
    kept: list[Array] = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        beyond, next_beyond = normal @ a - offset, normal @ b - offset
        if beyond <= 0.0:
            kept.append(a)
        if (beyond <= 0.0) != (next_beyond <= 0.0):
            kept.append(a + beyond / (beyond - next_beyond) * (b - a))
    return np.array(kept).reshape(-1, 2)


def _link(axes: Any, corners: Array, shade: float, order: float, stands: bool) -> None:
    """A body of the robot: pale where it was first, dark where it is in the end."""
    from matplotlib.patches import Polygon

    if len(corners) < 3:  # a point
        axes.plot(*corners[0], ".", color=_mixed(FAINT, INK, shade), markersize=3, zorder=order)
        return
    face = "white" if stands else _mixed("#ffffff", LINK, 0.15 + 0.85 * shade)
    line = _mixed("#cfd4da", INK, shade**1.5)
    axes.add_patch(Polygon(corners, facecolor=face, edgecolor=line, linewidth=0.8, zorder=order))


def _mixed(first: str, second: str, part: float) -> tuple[float, float, float]:
    """A colour between two others."""
    from matplotlib.colors import to_rgb

    a, b = (np.array(to_rgb(colour)) for colour in (first, second))
    red, green, blue = a + part * (b - a)
    return float(red), float(green), float(blue)


def _named(direction: Array) -> str:
    """An axis of the picture: x, y or z, if it is one."""
    return next((name for name, axis in zip("xyz", np.eye(3), strict=True) if direction @ axis > 1.0 - 1e-9), "along")


# --- clearance ---------------------------------------------------------------------------------------------------


def _clearance(axes: Any, stage: Stage) -> None:
    """The shortest distance between any two bodies, over the part of the motion that is done."""
    gone, clearances, safety = stage.gone, 1e3 * stage.clearances, 1e3 * stage.plan.scene.safety
    axes.axhline(safety, color=STOP, linewidth=1.2, linestyle="--")
    axes.annotate(
        f"{safety:g} mm\nto be kept", (1.0, safety), (4, 0), xycoords=axes.get_yaxis_transform(),
        textcoords="offset points", color=STOP, fontsize=8, va="center",
    )  # fmt: skip
    if np.isfinite(clearances).any():
        least, most = float(clearances.min()), float(clearances.max())
        part = 100.0 * gone / max(float(gone[-1]), 1e-300)
        axes.plot(
            part, clearances, color=INK, linewidth=1.3, marker="o" if len(part) == 1 else "", clip_on=len(part) > 1
        )
        if safety > 0.0:
            most = min(most, max(_HIGH * safety, 2.0 * least))  # what is farther away does not matter
        axes.set_ylim(min(0.0, 1.1 * least), 1.1 * max(most, 1.5 * safety, 1e-3))
    else:
        axes.set_ylim(0.0, max(4.0 * safety, 1.0))
        axes.text(0.5, 0.6, "there is nothing to meet", transform=axes.transAxes, color=FAINT, ha="center")
    axes.set_xlim(0.0, 100.0)
    axes.set_xlabel("part of the motion (%)")
    axes.set_ylabel("clearance (mm)")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _title(plan: Plan) -> str:
    how = plan.attempts[-1].words if plan.attempts else plan.reason
    return f"{plan.scene.name}: {plan.status.value}\n{textwrap.fill(how, _LETTERS)}"


def _legend(figure: Figure, axes: Any) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=min(len(labels), 6), frameon=False, fontsize=9,
        columnspacing=1.3,
    )  # fmt: skip
