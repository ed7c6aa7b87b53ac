"""Figures 1 to 4 of C. De Medio and G. Oriolo, "Robot obstacle avoidance using vortex fields", Advances in Robot
Kinematics, Springer 1991: potential surfaces with their contours, and how a vortex is discarded.

    python examples/papers/vortex_figures.py [FOLDER]

The paper gives no numbers. Here lengths are about 1 m and the attraction's stiffness is 1 N/m. Figures 5 to 10 are
plans of the scenes in robots/scenes: `cinegen.plotting.draw_plan`.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from elliptical_potential import Elliptical, finite_vector
from firas import nan_at_contact
from numpy.typing import ArrayLike, NDArray
from vortex_field import FieldError, Vortex, facing, require_positive

from cinegen.planning.vortices import rotation_axis

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

INK, FAINT = "#2b3036", "#8b929a"
OBSTACLE = "#c9ced4"
PATH, ATTRACTED, VORTEX_COLOUR, MINIMUM = "#0072b2", "#009e73", "#e69f00", "#d55e00"
"""Okabe and Ito's blue, bluish green, orange and vermilion."""


@dataclass(frozen=True, eq=False)
class Paraboloid:
    """Attraction of the goal (equation 1): U_a = k/2 |p - p_G|^2, whose gradient grows with the distance to the goal.

    Attributes:
        goal: (3,) p_G, m.
        stiffness: k_g, N/m.

    Raises:
        FieldError: the goal is not finite, or the stiffness is not above 0.
    """

    goal: Array
    stiffness: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "goal", finite_vector("the goal of an attraction", self.goal))
        require_positive("the stiffness of an attraction", self.stiffness)

    def value(self, points: ArrayLike) -> Array:
        """Return the potential (m,), J, at points (m, 3)."""
        error = np.asarray(points, dtype=float) - self.goal
        return np.asarray(0.5 * self.stiffness * (error * error).sum(axis=-1))

    def gradient(self, points: ArrayLike) -> Array:
        """Return k (p - p_G) (m, 3), N, at points (m, 3). The attraction is its opposite."""
        return np.asarray(self.stiffness * (np.asarray(points, dtype=float) - self.goal))

    def joint_gradient(self, jacobian: ArrayLike, point: ArrayLike) -> Array:
        """Return k J' (p - p_G) (n,), N m for revolute joints and N for prismatic ones.

        Args:
            jacobian: (3, n) of the point's velocity, m/rad or m/m.
            point: (3,) m.
        """
        return np.asarray(np.asarray(jacobian, dtype=float).T @ self.gradient(point))


@dataclass(frozen=True, eq=False)
class PointVortex:
    """Vortex of a point in the plane (equation 4; in space, of a line along z), with its local potential.

    Attributes:
        centre: (3,) O, m; its z does not matter.
        strength: J; negative values rotate clockwise. 1 is equation 4.
        cut: rad; the potential jumps by 2 pi times the strength on the ray from O at this angle from x.

    Raises:
        FieldError: the centre, the strength or the cut is not finite.
    """

    centre: Array
    strength: float = 1.0
    cut: float = -math.pi

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", finite_vector("the centre of a vortex", self.centre))
        for what, value in (("strength", self.strength), ("cut", self.cut)):
            if not math.isfinite(value):
                raise FieldError(f"the {what} of a point's vortex is {value!r}; give a finite number")

    def value(self, points: ArrayLike) -> Array:
        """Return the potential (m,), J: strength times the angle of points (m, 3) about O, from `cut` to a revolution
        beyond it; NaN at O."""
        x, y, r = self._about(points)
        angle = self.cut + np.mod(np.arctan2(y, x) - self.cut, 2.0 * math.pi)
        return np.where(np.isnan(r), np.nan, self.strength * angle)

    def gradient(self, points: ArrayLike) -> Array:
        """Return the strength times (-y, x, 0) / (x^2 + y^2) (m, 3), N, at points (m, 3); continuous across the cut,
        NaN at O."""
        x, y, r = self._about(points)
        return np.asarray((self.strength / r**2)[..., None] * np.stack([-y, x, np.zeros_like(x)], axis=-1))

    def _about(self, points: ArrayLike) -> tuple[Array, Array, Array]:
        """Return x and y of points from O, and their distance, NaN at O."""
        offset = np.asarray(points, dtype=float) - self.centre
        x, y = offset[..., 0], offset[..., 1]
        return x, y, nan_at_contact(np.hypot(x, y))


START, GOAL = np.array([-0.8, 0.0, 0.0]), np.array([0.6, 0.0, 0.0])
ATTRACTION = Paraboloid(GOAL)

ROD = np.array([0.02, 0.4, np.inf])
"""(3,) half the edges of the thin rod across SG, m."""
REPULSION = Elliptical(np.zeros(3), ROD, strength=0.05, decay=1.0)

SLOPE = 0.06
"""Of the helicoid, J/rad."""
VORTEX = PointVortex(np.zeros(3), -SLOPE, cut=np.pi / 2.0)
"""It decreases counterclockwise from +y: the robot comes from -x and passes below."""

RADIUS = 0.25
"""Of figure 4's disc, m."""
FIGURE_4_VORTEX = Vortex(0.3, reach=0.4)

_SIZE = (10.0, 4.4)  # inches of a surface beside its contours
_TOP = 1.1  # J: surfaces are cut there
_STEP = 2e-3  # m, along the path of figure 4


def draw_potentials() -> dict[str, Figure]:
    """Return all four by name: `draw_potentials()["figure1"].savefig("figure1.png")`."""
    return {"figure1": figure1(), "figure2": figure2(), "figure3": figure3(), "figure4": figure4()}


def stop() -> Array:
    """Return the local minimum (3,), m, at which the field of figure 1 stops a robot that comes from the start."""
    from scipy.optimize import brentq

    def along(x: float) -> float:
        point = np.array([x, 0.0, 0.0])
        return float(ATTRACTION.gradient(point)[0] + REPULSION.gradient(point)[0])

    # By symmetry it is on SG, where the gradient along SG vanishes between the start and the rod.
    return np.array([brentq(along, START[0], -ROD[0] - 1e-6), 0.0, 0.0])


def figure1() -> Figure:
    """Draw the attraction with an elliptical repulsive potential around a thin rod across SG: the surface, and its
    contours with the local minimum in front of the rod."""
    figure, surface, contours = _pair("Attraction and elliptical repulsion: a rod across the path stops the robot")
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 241), np.linspace(-0.8, 0.8, 193))
    points = _points(x, y)
    total = ATTRACTION.value(points) + REPULSION.value(points)
    part = np.s_[24:-24, 36:]  # the surface: from x = -0.7, up to y = 0.6
    trap = stop()
    at = float(ATTRACTION.value(trap) + REPULSION.value(trap))
    _surface(surface, x[part], y[part], np.minimum(total, _TOP)[part], "U = $U_a$ + $U_{r2}$ (J)", azimuth=-115.0)
    surface.plot(*trap[:2], at, "o", color=MINIMUM, markersize=6, zorder=10)
    levels = np.sort(np.concatenate([np.linspace(0.1, 1.6, 16), [at + 0.005, at + 0.02, at + 0.05]]))
    _contours(contours, x, y, np.minimum(total, 1.7), levels)
    _rectangle(contours, ROD[:2], "rod")
    contours.plot(*trap[:2], "o", color=MINIMUM, label="local minimum", zorder=5)
    _ends(contours)
    _legend(figure, contours)
    return figure


def figure2() -> Figure:
    """Draw the vortex's local potential, arctan(y / x): a helicoid, whose contours do not close."""
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
    """Draw the attraction with the vortex's potential: the surface and its contours. No local minimum stops the robot.

    The only minimum is the goal itself, displaced by the vortex while that is active; it is discarded before (figure
    4).
    """
    figure, surface, contours = _pair("Attraction and vortex: downhill all around to the goal")
    start = VORTEX.cut
    x, y = _disc(0.04, 0.95, start, start + 2.0 * np.pi)
    points = _points(x, y)
    potential = VORTEX.value(points)
    potential[-1] = VORTEX.strength * (start + 2.0 * np.pi)  # the other side of the cut
    total = ATTRACTION.value(points) + potential
    total -= float(total.min())
    _surface(surface, x, y, total, "U = $U_a$ + $U_v$ (J)", azimuth=-20.0)
    _contours(contours, x, y, total, np.linspace(0.0, float(total.max()), 26))
    path = _descend()
    contours.plot(*path.T[:2], color=PATH, linewidth=2.2, label="path of descent")
    contours.plot([0.0, 0.0], [0.04, 0.95], color=INK, linestyle="--", linewidth=1.2, label="cut")
    contours.plot(0.0, 0.0, "o", color=INK, label="obstacle O")
    contours.plot(*path[-1, :2], "o", color=MINIMUM, label="minimum: the goal, displaced", zorder=5)
    _ends(contours)
    _legend(figure, contours)
    return figure


def figure4() -> Figure:
    """Draw how a vortex is discarded: along the path around an obstacle the angle from the vortex to the attraction
    closes; from Q the line to the goal is free."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Arc, Circle

    figure = Figure(figsize=(7.0, 5.6), layout="constrained", dpi=150)
    axes = figure.add_subplot()
    path, angles = avoided()
    weights = facing(GOAL - path, _normals(path)[1])
    last = int(np.flatnonzero(weights > 0.0)[-1]) + 1
    near = _normals(path)[0] < FIGURE_4_VORTEX.reach
    first = int(np.flatnonzero(near)[0])
    for distance in (0.1, 0.2, FIGURE_4_VORTEX.reach):
        axes.add_patch(Circle((0.0, 0.0), RADIUS + distance, fill=False, edgecolor=FAINT, linewidth=0.6))
    axes.add_patch(Circle((0.0, 0.0), RADIUS, facecolor=OBSTACLE, edgecolor=INK, linewidth=0.8, label="obstacle"))
    axes.plot(*path.T[:2], color=PATH, linewidth=2.0, label="path")
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    marks = np.searchsorted(arc, np.linspace(arc[first] + 0.1, arc[last] - 0.08, 4))
    for k in (*marks, last):
        p, (attraction, vortex) = path[k], _vectors(path[k])
        for vector, colour in ((attraction, ATTRACTED), (vortex, VORTEX_COLOUR)):
            tip = 0.24 * vector / np.linalg.norm(vector)
            axes.annotate(
                "", tuple(p[:2] + tip[:2]), tuple(p[:2]), arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.8}
            )
        if k != last:
            low, high = sorted(np.degrees(np.arctan2(v[1], v[0])) for v in (vortex, attraction))
            axes.add_patch(Arc(p[:2], 0.2, 0.2, theta1=low, theta2=high, color=INK, linewidth=1.0))
            middle = np.radians((low + high) / 2.0)
            place = p[:2] + 0.15 * np.array([np.cos(middle), np.sin(middle)])
            axes.text(
                place[0], place[1], f"{np.degrees(angles[k]):.0f}°", fontsize=8, color=INK, ha="center", va="center"
            )
    axes.plot(*path[last, :2], "o", color=MINIMUM, label="Q: α = 0, the vortex is discarded", zorder=6)
    axes.annotate("Q", tuple(path[last, :2]), (0, -14), textcoords="offset points", color=INK, ha="center")
    axes.plot([], [], color=ATTRACTED, linewidth=1.8, label="attraction")
    axes.plot([], [], color=VORTEX_COLOUR, linewidth=1.8, label="vortex")
    axes.plot([], [], color=FAINT, linewidth=0.8, label="distance 0.1, 0.2, 0.4 m")
    _ends(axes)
    _frame(axes)
    axes.set_xlim(-0.9, 0.75)
    axes.set_ylim(-0.7, 0.7)
    axes.set_title("The angle α from the vortex to the attraction closes at Q", fontsize="medium", color=INK)
    _legend(figure, axes)
    return figure


def avoided() -> tuple[Array, Array]:
    """Return the path of figure 4: points (k, 3), m, and the angle alpha from the vortex to the attraction (k,), rad,
    positive toward the obstacle."""
    p = START
    path = [p]
    while np.linalg.norm(GOAL - p) > _STEP:
        attraction, vortex = _vectors(p)
        total = attraction + facing(attraction, _normals(p)[1]) * vortex
        p = p + _STEP * total / np.linalg.norm(total)
        path.append(p)
    points = np.array(path)
    attraction, (_, normals) = ATTRACTION.gradient(points), _normals(points)
    across = np.cross(_axis(), normals)
    return points, np.arctan2((normals * attraction).sum(axis=1), -(across * attraction).sum(axis=1))


def _axis() -> Array:
    """Return the axis of figure 4's vortex (3,): the shorter side and, as both are equal, the lower one."""
    return rotation_axis(_normals(START)[1], GOAL - START, (0.0, -1.0, 0.0), plane=(0.0, 0.0, 1.0))


def _vectors(p: Array) -> tuple[Array, Array]:
    """Return the attraction (3,) and the vortex (3,) at a point of figure 4, N."""
    distance, normal = _normals(p)
    return -ATTRACTION.gradient(p), FIGURE_4_VORTEX.velocity(distance, normal, _axis())


def _normals(points: Array) -> tuple[Array, Array]:
    """Return distances (m,) and outward normals (m, 3) of points outside figure 4's obstacle."""
    away = np.linalg.norm(points, axis=-1)
    return away - RADIUS, points / away[..., None]


def _descend() -> Array:
    """Return the path (k, 3), m, down figure 3's surface from the start, by steps along the antigradient."""
    p, path = START, [START]
    while True:
        gradient = ATTRACTION.gradient(p) + VORTEX.gradient(p)
        size = float(np.linalg.norm(gradient))
        if size < 1e-3:
            return np.array(path)
        p = p - min(0.01 / size, 0.2) * gradient
        path.append(p)


def _points(x: Array, y: Array) -> Array:
    """Return points (..., 3) of the plane."""
    return np.stack([x, y, np.zeros_like(x)], axis=-1)


def _disc(inner: float, outer: float, begin: float, end: float) -> tuple[Array, Array]:
    """Return x and y of an annulus, m, between two angles, rad, which vary along the rows."""
    turns = max(2, round(abs(end - begin) / (2.0 * np.pi) * 180)) + 1
    angle, radius = np.meshgrid(np.linspace(begin, end, turns), np.linspace(inner, outer, 60), indexing="ij")
    return radius * np.cos(angle), radius * np.sin(angle)


def _pair(title: str) -> tuple[Figure, Any, Any]:
    """Return a figure with axes for a surface on the left and for contours on the right."""
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
    """Mark start and goal."""
    for name, place, marker in (("start S", START, "s"), ("goal G", GOAL, "*")):
        axes.plot(*place[:2], marker, color=PATH, markersize=8 if marker == "*" else 6, label=name, zorder=4)


def _rectangle(axes: Any, half: Array, name: str) -> None:
    from matplotlib.patches import Rectangle

    box = Rectangle(tuple(-half), *(2.0 * half), facecolor=OBSTACLE, edgecolor=INK, linewidth=0.8, label=name, zorder=3)
    axes.add_patch(box)


def _arrows(axes: Any, vortex: PointVortex, radii: tuple[float, ...]) -> None:
    """Draw the vortex as arrows on circles around it."""
    for radius in radii:
        angle = np.radians(np.arange(10.0, 360.0, 40.0))
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        field = 0.05 * vortex.gradient(_points(x, y))
        arrows = {"color": VORTEX_COLOUR, "angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.007}
        axes.quiver(x, y, field[:, 0], field[:, 1], zorder=4, **arrows)
    axes.plot([], [], color=VORTEX_COLOUR, linewidth=1.8, label="vortex V")


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


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    for name, figure in draw_potentials().items():
        figure.savefig(folder / f"{name}.png")
