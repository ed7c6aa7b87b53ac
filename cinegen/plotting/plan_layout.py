"""`PlanLayout`: what is drawn of a plan, in which views, and where on the page."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.body import Body
from cinegen.collision.clearance import clearance_of
from cinegen.collision.scene import Scene
from cinegen.model import Mechanism
from cinegen.model.motion_plane import motion_plane
from cinegen.planning.planner import Plan, refined
from cinegen.plotting.outline import outline

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_MOMENTS, _FEWER = 15, 10  # configurations that are drawn, in a plane and in space
_MARGIN = 0.05  # around everything, relative to its size
_BEYOND = 0.6  # around the robot, relative to its extent: obstacles are drawn up to there
_WIDE, _STRIP = 6.6, 1.5  # inches: width of a view, and height of the clearance below
_TALL = (2.2, 6.2)  # inches: least and largest height of a view
_SHEET, _LEAST, _MOST = 8.6, 5.0, 10.0  # inches: width of three views, least and largest height
_WORDS = 0.9  # inches: text above and below
_X, _Y, _Z = np.eye(3)

TOP, FRONT, RIGHT = np.array([_X, _Y]), np.array([_X, _Z]), np.array([_Y, _Z])
"""Unit vectors (2, 3) of a view in the world: to the right, and up."""


class PlanLayout:
    """What is drawn, and in which views.

    Attributes:
        plan: as given.
        views: (2, 3) each, unit vectors to the right, and up.
        robot: bodies of the robot.
        path: (n, nq) configurations, near each other.
        trace: (n, 3) positions of the node, m.
        clearances: (n,) shortest distance at each, m.
        travel: (n,) length of the joints' path so far, rad and characteristic lengths.
        moments: indices of the configurations that are drawn, about equidistant.
        low, high: (3,) corners of what is shown, m.
    """

    def __init__(self, plan: Plan) -> None:
        scene, mechanism = plan.scene, plan.scene.mechanism
        self.plan = plan
        normal = motion_plane(mechanism)
        self.views = (TOP, FRONT, RIGHT) if normal is None else (_flat(normal),)
        clearance = clearance_of(scene)
        self.robot = clearance.links
        self.path = refined(mechanism, plan.path)
        self.trace = np.array([mechanism.placement(q, scene.node).translation for q in self.path])
        self.clearances = np.array([clearance.least(q) for q in self.path])
        self.travel = _travel(mechanism, self.path)
        wanted = np.linspace(0.0, self.travel[-1], _MOMENTS if normal is not None else _FEWER)
        self.moments = np.unique(np.abs(self.travel[None] - wanted[:, None]).argmin(axis=1))
        self._data = mechanism.model.createData()
        self.low, self.high = self._bounds(scene)

    def placements(self, q: Array) -> list[pin.SE3]:
        """Return the poses of the joints of the robot's bodies at q (nq,)."""
        pin.forwardKinematics(self.plan.scene.mechanism.model, self._data, q)
        return [pin.SE3(self._data.oMi[body.joint]) for body in self.robot]

    def _bounds(self, scene: Scene) -> tuple[Array, Array]:
        """Return the bounds of the robot's motion, and of the obstacles near it."""
        corners = [scene.goal.translation[None], self.trace]
        for q in self.path[self.moments]:
            for body, placement in zip(self.robot, self.placements(q), strict=True):
                corners.append(_box(body, placement))
        low, high = np.vstack(corners).min(axis=0), np.vstack(corners).max(axis=0)
        beyond = _BEYOND * float((high - low).max())
        seen = [
            _box(body, pin.SE3.Identity()) for o in scene.obstacles for body in o.bodies if np.isfinite(body.radius)
        ]
        around = np.vstack([low, high, *seen])
        low = np.minimum(low, np.maximum(around.min(axis=0), low - beyond))
        high = np.maximum(high, np.minimum(around.max(axis=0), high + beyond))
        margin = _MARGIN * float((high - low).max()) + scene.safety
        return low - margin, high + margin

    def shows(self, view: Array) -> tuple[Array, Array]:
        """Return the left and right (2,), and the lower and upper (2,) ends of a view, m."""
        ends = np.sort(np.stack([view @ self.low, view @ self.high]), axis=0)
        return ends[:, 0], ends[:, 1]

    @property
    def size(self) -> tuple[float, float]:
        """Size of the page, inches."""
        if len(self.views) == 1:
            return _WIDE, self._tall + _STRIP + _WORDS
        x, y, z = self.high - self.low
        return _SHEET, float(np.clip(_SHEET * (y + z) / (x + y), _LEAST, _MOST)) + _WORDS

    @property
    def _tall(self) -> float:
        across, up = (float(np.ptp(ends)) for ends in self.shows(self.views[0]))
        return float(np.clip(_WIDE * up / across, *_TALL))

    def panels(self, figure: Figure) -> tuple[list[Any], Any]:
        """Return axes for each view, and for the clearance, below a single view. Of three views the top one is above
        the front one, and the right one next to that."""
        if len(self.views) == 1:
            top, below = figure.subplots(2, 1, height_ratios=[self._tall, _STRIP])
            return [top], below
        x, y, z = self.high - self.low
        (top, strip), (front, right) = figure.subplots(2, 2, width_ratios=[x, y], height_ratios=[y, z])
        figure.delaxes(strip)  # so that it is the last one
        return [top, front, right], figure.add_subplot(strip.get_subplotspec())


def _flat(normal: Array) -> Array:
    """Return a view (2, 3) along a normal: y, or else z, is up, and the axis to the right is positive."""
    up = _Y if abs(normal[2]) > 0.9 else _Z
    up = up - normal * (up @ normal)
    up = up / np.linalg.norm(up)
    right = np.cross(up, normal)
    return np.array([right * np.sign(right[np.abs(right).argmax()]), up])


def _travel(mechanism: Mechanism, path: Array) -> Array:
    """Return the length (n,) of a path (n, nq) up to each configuration."""
    steps = (mechanism.scaled_difference(a, b) for a, b in itertools.pairwise(path))
    return np.concatenate([[0.0], np.cumsum([np.linalg.norm(step) for step in steps])])


def _box(body: Body, placement: pin.SE3) -> Array:
    """Return the corners (2, 3) of a box around a body."""
    flat, upright = outline(body, placement, TOP), outline(body, placement, FRONT)
    return np.array([[*end(flat, axis=0), end(upright[:, 1])] for end in (np.min, np.max)])
