"""`PlanLayout`: the configurations of a plan that are drawn, their views, and their place on the page."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.body import Body
from cinegen.collision.clearance import clearance_of
from cinegen.collision.scene import Scene
from cinegen.model.motion_plane import motion_plane
from cinegen.planning.planner import Plan, refined
from cinegen.plotting.outline import outline
from cinegen.plotting.view import Projection, along, parallel

if TYPE_CHECKING:
    pass

Array = NDArray[np.float64]

_MOMENTS, _FEWER = 15, 10  # configurations that are drawn, in a plane and in space
_MARGIN = 0.05  # around everything, relative to its size
_BEYOND = 0.6  # around the robot, relative to its extent: obstacles are drawn up to there
_WIDE, _STRIP = 6.6, 1.5  # inches: width of a view, and height of the clearance below
_TALL = (2.2, 6.2)  # inches: least and largest height of a view
_SHEET, _LEAST, _MOST = 8.6, 5.0, 10.0  # inches: width of three views, least and largest height
_TEXTS = 0.7  # inches: labels and legend
_X, _Y, _Z = np.eye(3)

_THREE_VIEWS = parallel("top", _X, _Y), parallel("front", _X, _Z), parallel("right", _Y, _Z)


class PlanLayout:
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
        clearance = clearance_of(scene)
        self.robot = clearance.links
        self.path = refined(mechanism, plan.path)
        self.trace = np.array([mechanism.placement(q, scene.node).translation for q in self.path])
        self.clearances = np.array([clearance.least(q) for q in self.path])
        steps = [np.linalg.norm(mechanism.scaled_difference(a, b)) for a, b in itertools.pairwise(self.path)]
        self.travel = np.cumsum([0.0, *steps])
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
            corners += [_box(*one) for one in zip(self.robot, self.placements(q), strict=True)]
        low, high = np.vstack(corners).min(axis=0), np.vstack(corners).max(axis=0)
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


def _box(body: Body, placement: pin.SE3) -> Array:
    """Return the corners (2, 3) of a box around a body."""
    flat, upright = (outline(body, placement, view.axes[:2]) for view in _THREE_VIEWS[:2])
    return np.array([[*end(flat, axis=0), end(upright[:, 1])] for end in (np.min, np.max)])
