"""Figures 1 to 4 of C. De Medio and G. Oriolo, "Robot obstacle avoidance using vortex fields", Advances in Robot
Kinematics, Springer 1991: potential surfaces with their contours, and how a vortex is discarded.

The paper gives no numbers. Here lengths are about 1 m and the attraction's stiffness is 1 N/m.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.planning.fields import Elliptical, Paraboloid, PointVortex, Vortex, facing, shorter, turning_axis

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

INK, FAINT = "#2b3036", "#8b929a"
SOLID = "#c9ced4"
WAY, PULL, TURN, STOP = "#0072b2", "#009e73", "#e69f00", "#d55e00"
"""Okabe and Ito's blue, bluish green, orange and vermillion: the way, the attraction, the vortex, a minimum."""

START, GOAL = np.array([-0.8, 0.0, 0.0]), np.array([0.6, 0.0, 0.0])
ATTRACTION = Paraboloid(GOAL)

ROD = np.array([0.02, 0.4, np.inf])
"""(3,) half the edges of the thin rod across SG, m."""
REPULSION = Elliptical(np.zeros(3), ROD, strength=0.05, decay=1.0)

SLOPE = 0.06
"""Of the helicoid, J/rad."""
VORTEX = PointVortex(np.zeros(3), -SLOPE, cut=np.pi / 2.0)
"""It falls counterclockwise from +y on: the robot comes from -x, and goes round below."""

RADIUS = 0.25
"""Of figure 4's disc, m."""
TURNING = Vortex(0.3, reach=0.4)

_SIZE = (10.0, 4.4)  # inches of a surface beside its contours
_TOP = 1.1  # J: surfaces are cut off there
_STEP = 2e-3  # m, along the way of figure 4


def draw_potentials() -> dict[str, Figure]:
    """All four, by name: `draw_potentials()["figure1"].savefig("figure1.png")`."""
    return {"figure1": figure1(), "figure2": figure2(), "figure3": figure3(), "figure4": figure4()}


def stop() -> Array:
    """(3,) where the field of figure 1 stops a robot that comes from the start, m: its local minimum."""
    from scipy.optimize import brentq

    def along(x: float) -> float:
        point = np.array([x, 0.0, 0.0])
        return float(ATTRACTION.gradient(point)[0] + REPULSION.gradient(point)[0])

    # All is symmetric about SG: there it is where the gradient along SG vanishes, between the start and the rod.
    return np.array([brentq(along, START[0], -ROD[0] - 1e-6), 0.0, 0.0])


def figure1() -> Figure:
    """The attraction with an elliptical repulsive potential around a thin rod across SG: the surface, and its contours
    with the local minimum in front of the rod."""
    figure, surface, contours = _pair("Attraction and elliptical repulsion: a rod across the way stops the robot")
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 241), np.linspace(-0.8, 0.8, 193))
    points = _points(x, y)
    total = ATTRACTION.value(points) + REPULSION.value(points)
    part = np.s_[24:-24, 36:]  # the surface: from x = -0.7 on, and up to y = 0.6
    trap = stop()
    at = float(ATTRACTION.value(trap) + REPULSION.value(trap))
    _surface(surface, x[part], y[part], np.minimum(total, _TOP)[part], "U = $U_a$ + $U_{r2}$ (J)", azimuth=-115.0)
    surface.plot(*trap[:2], at, "o", color=STOP, markersize=6, zorder=10)
    levels = np.sort(np.concatenate([np.linspace(0.1, 1.6, 16), [at + 0.005, at + 0.02, at + 0.05]]))
    _contours(contours, x, y, np.minimum(total, 1.7), levels)
    _rectangle(contours, ROD[:2], "rod")
    contours.plot(*trap[:2], "o", color=STOP, label="local minimum", zorder=5)
    _ends(contours)
    _legend(figure, contours)
    return figure


def figure2() -> Figure:
    """The vortex's local potential, arctan(y / x): a helicoid, and contours that do not close."""
    figure, surface, contours = _pair("A point's vortex: its potential is a helicoid, so contours do not close")
    x, y = _disc(0.04, 0.8, -np.pi / 2.0, 7.0 * np.pi / 2.0)
    angle = np.linspace(-0.5, 3.5, x.shape[0])[:, None] * np.pi + 0.0 * x
    _surface(surface, x, y, angle, "$U_v$ (rad)", azimuth=-60.0)
    x, y = _disc(0.04, 0.8, -np.pi, np.pi)
    value = PointVortex(np.zeros(3)).value(_points(x, y))
    value[-1] = np.pi  # the other side of the cut
    lines = _contours(contours, x, y, value, np.radians(np.arange(-180.0, 181.0, 20.0)))
    contours.clabel(lines, lines.levels[1:-1:3], fmt=lambda level: f"{np.degrees(level):.0f}°", fontsize=8)
    _arrows(contours, PointVortex(np.zeros(3)), (0.3, 0.5, 0.7))
    contours.plot([-0.8, -0.04], [0.0, 0.0], color=INK, linestyle="--", linewidth=1.2, label="cut: a jump of 2π")
    contours.plot(0.0, 0.0, "o", color=INK, label="obstacle O")
    _legend(figure, contours)
    return figure


def figure3() -> Figure:
    """The attraction with the vortex's potential: the surface and its contours. Nothing stops the robot on its way.

    The one minimum is the goal itself, displaced by the vortex that goes on turning: until it is discarded, which is
    before (figure 4).
    """
    figure, surface, contours = _pair("Attraction and vortex: downhill all the way round to the goal")
    start = VORTEX.cut
    x, y = _disc(0.04, 0.95, start, start + 2.0 * np.pi)
    points = _points(x, y)
    potential = VORTEX.value(points)
    potential[-1] = VORTEX.strength * (start + 2.0 * np.pi)  # the other side of the cut
    total = ATTRACTION.value(points) + potential
    total -= float(total.min())
    _surface(surface, x, y, total, "U = $U_a$ + $U_v$ (J)", azimuth=-20.0)
    _contours(contours, x, y, total, np.linspace(0.0, float(total.max()), 26))
    way = _descend()
    contours.plot(*way.T[:2], color=WAY, linewidth=2.2, label="way down")
    contours.plot([0.0, 0.0], [0.04, 0.95], color=INK, linestyle="--", linewidth=1.2, label="cut")
    contours.plot(0.0, 0.0, "o", color=INK, label="obstacle O")
    contours.plot(*way[-1, :2], "o", color=STOP, label="minimum: the goal, displaced", zorder=5)
    _ends(contours)
    _legend(figure, contours)
    return figure


def figure4() -> Figure:
    """How a vortex is discarded: on the way round an obstacle the angle from the vortex to the attraction closes; from
    Q on the way to the goal is free."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Arc, Circle

    figure = Figure(figsize=(7.0, 5.6), layout="constrained", dpi=150)
    axes = figure.add_subplot()
    way, angles = avoided()
    weights = facing(GOAL - way, _normals(way)[1])
    last = int(np.flatnonzero(weights > 0.0)[-1]) + 1
    near = _normals(way)[0] < TURNING.reach
    first = int(np.flatnonzero(near)[0])
    for distance in (0.1, 0.2, TURNING.reach):
        axes.add_patch(Circle((0.0, 0.0), RADIUS + distance, fill=False, edgecolor=FAINT, linewidth=0.6))
    axes.add_patch(Circle((0.0, 0.0), RADIUS, facecolor=SOLID, edgecolor=INK, linewidth=0.8, label="obstacle"))
    axes.plot(*way.T[:2], color=WAY, linewidth=2.0, label="way")
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    marks = np.searchsorted(arc, np.linspace(arc[first] + 0.1, arc[last] - 0.08, 4))
    for k in (*marks, last):
        p, (task, turn) = way[k], _vectors(way[k])
        for vector, colour in ((task, PULL), (turn, TURN)):
            tip = 0.24 * vector / np.linalg.norm(vector)
            axes.annotate(
                "", tuple(p[:2] + tip[:2]), tuple(p[:2]), arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.8}
            )
        if k != last:
            low, high = sorted(np.degrees(np.arctan2(v[1], v[0])) for v in (turn, task))
            axes.add_patch(Arc(p[:2], 0.2, 0.2, theta1=low, theta2=high, color=INK, linewidth=1.0))
            middle = np.radians((low + high) / 2.0)
            place = p[:2] + 0.15 * np.array([np.cos(middle), np.sin(middle)])
            axes.text(
                place[0], place[1], f"{np.degrees(angles[k]):.0f}°", fontsize=8, color=INK, ha="center", va="center"
            )
    axes.plot(*way[last, :2], "o", color=STOP, label="Q: α = 0, the vortex is let go", zorder=6)
    axes.annotate("Q", tuple(way[last, :2]), (0, -14), textcoords="offset points", color=INK, ha="center")
    axes.plot([], [], color=PULL, linewidth=1.8, label="attraction")
    axes.plot([], [], color=TURN, linewidth=1.8, label="vortex")
    axes.plot([], [], color=FAINT, linewidth=0.8, label="distance 0.1, 0.2, 0.4 m")
    _ends(axes)
    _frame(axes)
    axes.set_xlim(-0.9, 0.75)
    axes.set_ylim(-0.7, 0.7)
    axes.set_title("The angle α from the vortex to the attraction closes at Q", fontsize="medium", color=INK)
    _legend(figure, axes)
    return figure


def avoided() -> tuple[Array, Array]:
    """The way of figure 4: (k, 3) points of it, m, and (k,) the angle alpha from the vortex to the attraction there,
    rad, above 0 toward the obstacle."""
    p = START
    way = [p]
    while np.linalg.norm(GOAL - p) > _STEP:
        task, turn = _vectors(p)
        total = task + facing(task, _normals(p)[1]) * turn
        p = p + _STEP * total / np.linalg.norm(total)
        way.append(p)
    points = np.array(way)
    task, (_, normals) = ATTRACTION.gradient(points), _normals(points)
    across = np.cross(_axis(), normals)
    return points, np.arctan2((normals * task).sum(axis=1), -(across * task).sum(axis=1))


def _axis() -> Array:
    """(3,) of figure 4's vortex, kept: the shorter way, and as both are as long, that below."""
    return turning_axis(_normals(START)[1], shorter(GOAL - START), (0.0, -1.0, 0.0), plane=(0.0, 0.0, 1.0))


def _vectors(p: Array) -> tuple[Array, Array]:
    """(3,) attraction and (3,) vortex at a point of figure 4, N."""
    distance, normal = _normals(p)
    return -ATTRACTION.gradient(p), TURNING.velocity(distance, normal, _axis())


def _normals(points: Array) -> tuple[Array, Array]:
    """(m,) distance and (m, 3) outward normal of points outside figure 4's obstacle."""
    away = np.linalg.norm(points, axis=-1)
    return away - RADIUS, points / away[..., None]


def _descend() -> Array:
    """(k, 3) the way down figure 3's surface from the start, m, by steps along the antigradient."""
    p, way = START, [START]
    while True:
        gradient = ATTRACTION.gradient(p) + VORTEX.gradient(p)
        size = float(np.linalg.norm(gradient))
        if size < 1e-3:
            return np.array(way)
        p = p - min(0.01 / size, 0.2) * gradient
        way.append(p)


def _points(x: Array, y: Array) -> Array:
    """(..., 3) points of the plane."""
    return np.stack([x, y, np.zeros_like(x)], axis=-1)


def _disc(inner: float, outer: float, begin: float, end: float) -> tuple[Array, Array]:
    """x and y of a disc with a hole, m, from an angle to another, rad; angles go down the rows."""
    turns = max(2, round(abs(end - begin) / (2.0 * np.pi) * 180)) + 1
    angle, radius = np.meshgrid(np.linspace(begin, end, turns), np.linspace(inner, outer, 60), indexing="ij")
    return radius * np.cos(angle), radius * np.sin(angle)


def _pair(title: str) -> tuple[Figure, Any, Any]:
    """A figure with a surface to the left and a map to the right."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE, layout="constrained", dpi=150)
    figure.suptitle(title, fontsize="medium", color=INK)
    return figure, figure.add_subplot(1, 2, 1, projection="3d"), figure.add_subplot(1, 2, 2)


def _surface(axes: Any, x: Array, y: Array, z: Array, name: str, azimuth: float) -> None:
    axes.plot_surface(x, y, z, cmap="cividis", rcount=90, ccount=90, linewidth=0.05, edgecolor=INK)
    axes.view_init(elev=38.0, azim=azimuth)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.set_zlabel(name)
    axes.set_title("(a)", color=INK, fontsize="medium")


def _contours(axes: Any, x: Array, y: Array, z: Array, levels: Array) -> Any:
    _frame(axes)
    axes.set_title("(b)", color=INK, fontsize="medium")
    return axes.contour(x, y, z, levels, cmap="cividis", linewidths=0.9)


def _frame(axes: Any) -> None:
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def _ends(axes: Any) -> None:
    """Start and goal."""
    for name, place, marker in (("start S", START, "s"), ("goal G", GOAL, "*")):
        axes.plot(*place[:2], marker, color=WAY, markersize=8 if marker == "*" else 6, label=name, zorder=4)


def _rectangle(axes: Any, half: Array, name: str) -> None:
    from matplotlib.patches import Rectangle

    box = Rectangle(tuple(-half), *(2.0 * half), facecolor=SOLID, edgecolor=INK, linewidth=0.8, label=name, zorder=3)
    axes.add_patch(box)


def _arrows(axes: Any, vortex: PointVortex, radii: tuple[float, ...]) -> None:
    """The vortex on circles around it, as arrows."""
    for radius in radii:
        angle = np.radians(np.arange(10.0, 360.0, 40.0))
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        field = 0.05 * vortex.gradient(_points(x, y))
        arrows = {"color": TURN, "angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.007}
        axes.quiver(x, y, field[:, 0], field[:, 1], zorder=4, **arrows)
    axes.plot([], [], color=TURN, linewidth=1.8, label="vortex V")


def _legend(figure: Any, axes: Any) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=len(labels) if len(labels) < 6 else 3,
        frameon=False,
        fontsize=9,
    )
