"""`draw_plan`: a path around obstacles, as in figures 5 to 10 of C. De Medio and G. Oriolo, "Robot obstacle avoidance
using vortex fields", Advances in Robot Kinematics, Springer 1991; and its clearance."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from cinegen.arrays import Array
from cinegen.collision.body import Body
from cinegen.collision.clearance import clearance_of
from cinegen.collision.scene import Scene
from cinegen.collision.shapes import rounded_hull
from cinegen.collision.triangle_mesh import TriangleMesh
from cinegen.joints import kinematic_data
from cinegen.model.motion_plane import motion_plane
from cinegen.planning.planner import Plan
from cinegen.planning.search import refined
from cinegen.plotting.sheet import BLUE, FAINT, INK, SKY, VERMILION, finish, label, sheet
from cinegen.plotting.view import Projection, along, parallel
from raff2urdf.files import stem_of
from raff2urdf.quantities import LENGTH, shown_scale

OBSTACLE, PATH, STOP, LINK = "#c9ced4", BLUE, VERMILION, SKY
MARGIN = "#f1f3f5"
"""Colour of points nearer to an obstacle than the safety distance."""


_MOMENTS, _FEWER = 15, 10  # configurations that are drawn, in a plane and in space
_MARGIN = 0.05  # around everything, relative to its size
_BEYOND = 0.6  # around the robot, relative to its extent: obstacles are drawn up to there
_WIDE, _STRIP = 6.6, 1.5  # inches: width of a view, and height of the clearance below
_TALL = (2.2, 6.2)  # inches: least and largest height of a view
_SHEET, _LEAST, _MOST = 8.6, 5.0, 10.0  # inches: width of three views, least and largest height
_TEXTS = 0.7  # inches: labels and legend
_X, _Y, _Z = np.eye(3)

_THREE_VIEWS = parallel("top", _X, _Y), parallel("front", _X, _Z), parallel("right", _Y, _Z)
_DIRECTIONS = 180  # of an outline
_SIDES = 720  # of the prism around a cylinder
_EDGE_ON = 1e-6  # how far the normal of a half-space may point out of the picture
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
    layout = _Layout(plan)
    strategy = plan.attempts[-1].strategy if plan.attempts else plan.reason
    title = f"{plan.scene.name}: {plan.status.value}"
    figure, body = sheet(*layout.size, title, f"{robot_name(plan.scene)}: {strategy}")
    maps, strip = layout.panels(body)
    for axes, view in zip(maps, layout.views, strict=True):
        _paint(axes, layout, view, margin)
    _clearance(strip, layout)
    return finish(figure)


def robot_name(scene: Scene) -> str:
    """Return the name of a scene's robot: of its file; its own if it was not loaded from one."""
    if scene.mobile is not None:
        return "mobile robot"
    file = scene.robot.get("file") if isinstance(scene.robot, Mapping) else scene.robot
    return scene.mechanism.name if file is None else stem_of(Path(file))


class _Layout:
    """Configurations that are drawn, and their views.

    Attributes:
        plan: as given.
        views: one along the normal of a planar robot's plane; else from the top, the front and the right.
        robot: bodies of the robot.
        path: (n, nq) configurations, near each other.
        trace: (n, 3) positions of the node, m.
        clearances: (n,) shortest distance at each, m.
        travel: (n,) length of the joints' path so far, rad and characteristic lengths.
        moments: indices of the configurations that are drawn, about equidistant.
        low, high: (3,) corners of the part of the world that is shown, m.
    """

    def __init__(self, plan: Plan) -> None:
        scene, mechanism = plan.scene, plan.scene.mechanism
        self.plan = plan
        normal = motion_plane(mechanism)
        self.views: tuple[Projection, ...] = _THREE_VIEWS if normal is None else (along(normal),)
        self.robot = clearance_of(scene).links
        fine = replace(plan, path=refined(mechanism, plan.path))
        self.path, self.trace, self.clearances = fine.path, fine.trace, fine.clearances
        steps = [np.linalg.norm(mechanism.scaled_difference(a, b)) for a, b in itertools.pairwise(self.path)]
        self.travel = np.cumsum([0.0, *steps])
        wanted = np.linspace(0.0, self.travel[-1], _MOMENTS if normal is not None else _FEWER)
        self.moments = np.unique(np.abs(self.travel[None] - wanted[:, None]).argmin(axis=1))
        self._data = kinematic_data(mechanism.model)
        self.low, self.high = self._bounds(scene)

    def placements(self, q: Array) -> list[pin.SE3]:
        """Return the poses of the joints of the robot's bodies at q (nq,)."""
        pin.forwardKinematics(self.plan.scene.mechanism.model, self._data, q)
        return [pin.SE3(self._data.oMi[body.joint]) for body in self.robot]

    def _bounds(self, scene: Scene) -> tuple[Array, Array]:
        """Return the bounds of the robot's motion, and of the obstacles near it."""
        ends = [np.vstack([scene.goal.translation, self.trace])]
        for q in self.path[self.moments]:
            ends += [_box(*pair) for pair in zip(self.robot, self.placements(q), strict=True)]
        low, high = np.vstack(ends).min(axis=0), np.vstack(ends).max(axis=0)
        beyond = _BEYOND * float((high - low).max())
        bodies = [body for obstacle in scene.obstacles for body in obstacle.bodies if np.isfinite(body.radius)]
        around = np.vstack([low, high, *(_box(body, pin.SE3.Identity()) for body in bodies)])
        low = np.minimum(low, np.maximum(around.min(axis=0), low - beyond))
        high = np.maximum(high, np.minimum(around.max(axis=0), high + beyond))
        margin = _MARGIN * float((high - low).max()) + scene.safety
        return low - margin, high + margin

    def limits(self, view: Projection) -> Array:
        """Return the lower left and the upper right corner (2, 2) of a view, m."""
        flat = view.project(np.array([self.low, self.high]))[0]
        return np.sort(flat, axis=0)

    @property
    def size(self) -> tuple[float, float]:
        """Size of the page, inches."""
        if len(self.views) == 1:
            return _WIDE, self._tall + _STRIP + _TEXTS
        x, y, z = self.high - self.low
        return _SHEET, float(np.clip(_SHEET * (y + z) / (x + y), _LEAST, _MOST)) + _TEXTS

    @property
    def _tall(self) -> float:
        across, up = np.ptp(self.limits(self.views[0]), axis=0)
        return float(np.clip(_WIDE * up / across, *_TALL))

    def panels(self, figure: Any) -> tuple[list[Any], Any]:
        """Return axes for each view, and for the clearance, below a single view. Of three views the top one is above
        the front one, and the right one next to that."""
        if len(self.views) == 1:
            top, below = figure.subplots(2, 1, height_ratios=[self._tall, _STRIP])
            return [top], below
        x, y, z = self.high - self.low
        (top, strip), (front, right) = figure.subplots(2, 2, width_ratios=[x, y], height_ratios=[y, z])
        figure.delaxes(strip)  # so that it is the last one
        return [top, front, right], figure.add_subplot(strip.get_subplotspec())


# --- maps --------------------------------------------------------------------------------------------------------


def _paint(axes: Any, layout: _Layout, view: Projection, margin: bool) -> None:
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

    All edges are below all faces: no line shows where bodies of an obstacle meet. Meshes that are not convex are drawn
    without their safety distance.
    """
    bodies = [body for obstacle in scene.obstacles for body in obstacle.bodies if body.interior is None]
    meshes = [body.as_described for obstacle in scene.obstacles for body in obstacle.bodies if body.interior]
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
        triangles = [_triangles(body, view) for body in meshes] if colour == OBSTACLE else []
        for corners in triangles:
            axes.add_collection(
                PolyCollection(list(corners), facecolor=colour, edgecolor=colour, linewidth=0.5, zorder=1.3)
            )
        if covered or triangles:  # an invisible one for the legend
            axes.add_patch(Polygon(np.full((3, 2), np.nan), facecolor=colour, label=text, **line))


def _triangles(body: Body, view: Array) -> Array:
    """Return the corners (n, 3, 2) of the triangles of a mesh in a view."""
    corners = TriangleMesh(body.shape).corners
    return np.asarray((corners @ body.placement.rotation.T + body.placement.translation) @ view.T)


def _covered(body: Body, view: Array, shown: Array, growth: float) -> Array:
    """Return the corners (k, 2) of the part of a view that a body covers; none for a half-space that is not seen
    edge-on."""
    if np.isfinite(body.radius):
        return outline(body, pin.SE3.Identity(), view, growth)
    line = edge(body, view)
    if line is None:
        return np.zeros((0, 2))
    (normal, offset), middle = line, shown.mean(axis=0)
    far = float(np.linalg.norm(np.ptp(shown, axis=0)))
    ahead = min(offset + growth - float(normal @ middle), far)  # of the middle of the picture
    if 2.0 * ahead <= -float(np.abs(normal) @ np.ptp(shown, axis=0)):
        return np.zeros((0, 2))
    foot, side = middle + ahead * normal, far * np.array([-normal[1], normal[0]])
    return np.array([foot - side, foot + side, foot + side - 2.0 * far * normal, foot - side - 2.0 * far * normal])


def _link(axes: Any, corners: Array, shade: float, order: float, is_fixed: bool) -> None:
    """Draw a body of the robot: pale at the start, dark at the end."""
    if len(corners) < 3:  # a point
        axes.plot(*corners[0], ".", color=_mixed(FAINT, INK, shade), markersize=3, zorder=order)
        return
    face = "white" if is_fixed else _mixed("white", LINK, 0.15 + 0.85 * shade)
    line = _mixed("#cfd4da", INK, shade**1.5)
    axes.add_patch(Polygon(corners, facecolor=face, edgecolor=line, linewidth=0.8, zorder=order))


def _mixed(first: str, second: str, part: float) -> Any:
    """Return a colour between two others."""
    return LinearSegmentedColormap.from_list("", [first, second])(part)


def _named(direction: Array) -> str:
    """Return the name of an axis of the picture: x, y or z, if it is one."""
    return next((name for name, axis in zip("xyz", np.eye(3), strict=True) if direction @ axis > 1.0 - 1e-9), "along")


# --- clearance ---------------------------------------------------------------------------------------------------


def _clearance(axes: Any, layout: _Layout) -> None:
    """Draw the shortest distance between any two bodies, over the fraction of the motion."""
    scale, unit = shown_scale(LENGTH)
    travel, clearances, safety = layout.travel, scale * layout.clearances, scale * layout.plan.scene.safety
    axes.axhline(safety, color=STOP, linewidth=1.2, linestyle="--")
    axes.annotate(
        f"{safety:g} {unit}\nsafety", (1.0, safety), (4, 0), xycoords=axes.get_yaxis_transform(),
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
        axes.set_ylim(min(0.0, 1.1 * least), 1.1 * max(most, 1.5 * safety, 1e-6 * scale))
    else:
        axes.set_ylim(0.0, max(4.0 * safety, 1e-3 * scale))
        axes.text(0.5, 0.6, "no obstacles", transform=axes.transAxes, color=FAINT, ha="center")
    axes.set_xlim(0.0, 100.0)
    label(axes, "fraction of the motion (%)", f"clearance ({unit})")
    axes.spines[["top", "right"]].set_visible(False)


# --- outlines ---------------------------------------------------------------------------------------------------


def outline(body: Body, placement: pin.SE3, view: Array, margin: float = 0.0) -> Array:
    """Return the corners (k, 2) of a body's outline, in order, m; one corner for a point.

    A convex body is the hull of some points, grown by a ball. So is its outline: in each direction u of the picture it
    ends at the point that is outermost, and beyond that by the ball's radius.

    Args:
        body: not a half-space, see `edge`.
        placement: pose of its joint in the world.
        view: (2, 3) unit vectors of the picture in the world: to the right, and up.
        margin: m: the body is grown by this on all sides.
    """
    points, radius = _hull(body, placement)
    flat = points @ view.T
    angles = np.arange(_DIRECTIONS) * (2.0 * np.pi / _DIRECTIONS)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    corners = flat[(directions @ flat.T).argmax(axis=1)] + (radius + margin) * directions
    new = (corners != np.roll(corners, 1, axis=0)).any(axis=1)
    return np.asarray(corners[new] if new.any() else corners[:1])


def edge(body: Body, view: Array) -> tuple[Array, float] | None:
    """Return the normal n (2,) and the offset c, m, of a half-space in the world: in the picture it covers all points p
    with n.p <= c. None if it is not seen edge-on: it covers the whole picture."""
    normal = body.placement.rotation @ np.array(body.shape.n)
    projected = view @ normal
    if np.linalg.norm(projected) < 1.0 - _EDGE_ON:
        return None
    return projected, float(body.shape.d + normal @ body.placement.translation)


def _box(body: Body, placement: pin.SE3) -> Array:
    """Return two opposite corners (2, 3) of a box around a body, m."""
    points, radius = _hull(body, placement)
    return np.array([points.min(axis=0) - radius, points.max(axis=0) + radius])


def _hull(body: Body, placement: pin.SE3) -> tuple[Array, float]:
    """Return points (n, 3) in the world, m, whose hull is a body once a ball of the radius has grown it."""
    points, radius = rounded_hull(body.shape, _SIDES)
    pose = placement * body.placement
    return points @ pose.rotation.T + pose.translation, radius
