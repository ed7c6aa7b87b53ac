"""`loci`: the curves in a map of two axes along which its robot is singular, and where what it reaches ends.

The map's own configurations are the grid, its cells' middles the grid's points; what lies on an edge between two of
them is found by bisection (`cinegen.singularities.contour`), so curves are finer than the cells. Between neighbours
that lie on different branches, and beside cells that nobody has looked at, nothing is drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.errors import ClosureError
from cinegen.ik.seeker import Seeker
from cinegen.ik.task import FrameTask
from cinegen.singularities.contour import SingularCurve, SingularityGrid
from cinegen.singularities.crossing import Rows, of_node, of_passive_joints
from cinegen.workspace.errors import MapError
from cinegen.workspace.settled import How
from cinegen.workspace.specification import MapSpecification
from cinegen.workspace.storage.dataset import specification_of

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]

MOST = 121
"""Grid points along an axis, at most: of a finer map every other cell is taken, or every third."""

_GOAL = 1e-10  # rad or lengths that may be left
_THERE = 1e-7  # rad or lengths: a configuration that far from its point is another's
_JUMP = 0.7  # rad or lengths: neighbours that are further apart are on different branches
_AT_LIMIT = 1e-4  # rad or m from it


def loci(
    dataset: xarray.Dataset, spec: MapSpecification | None = None, say: Callable[[float], None] | None = None
) -> tuple[SingularCurve, ...]:
    """Singular curves of both types, and the borders of what is reached: singular ones, and others (joint limits).

    Of an arm with more motors than the node's motions that count, type 1 is seen only on the border: inside it is at
    single points of what the arm may do, not on curves.

    Args:
        dataset: a map over two axes; or cells of one, with the specification that is of them.
        specification: of the cells; the map's own unless given.
        say: is told which part is done, 0 to 1.

    Raises:
        MapError: this is no map of two axes, each of two cells or more.
    """
    spec = specification_of(dataset) if spec is None else spec
    region = spec.region
    if len(region.axes) != 2 or min(region.shape) < 2:
        raise MapError(
            f"curves are found in a map of two axes with two cells or more, and this has {' x '.join(region.names)}, "
            f"{' x '.join(map(str, region.shape))} cells"
        )
    u, v = (slice(None, None, -(-axis.count // MOST)) for axis in region.axes)
    mechanism, sheet = spec.mechanism, _Sheet(spec)
    first = Rows(of_node(mechanism, spec.node, sum(spec.counted)), spec.rank)
    second = of_passive_joints(mechanism) if mechanism.passive_rank else None
    grid = SingularityGrid(sheet, region.axes[0].middles()[u], region.axes[1].middles()[v], first, second)
    cells = dataset[["configuration", "settled"]].isel({region.names[0]: u, region.names[1]: v})
    grid.q[:] = cells["configuration"].transpose(*region.names, "joint").values
    return grid.curves(
        say, sheet.linked, sheet.stopped, cells["settled"].transpose(*region.names).values != How.NOT_YET
    )


class _Sheet:
    """A region of two axes as a surface: configurations at any of its points, as the map's own are found."""

    def __init__(self, spec: MapSpecification) -> None:
        self.mechanism, self.over_joints = spec.mechanism, spec.of_motors
        self._survey, self._region = spec, spec.region
        tasks = () if self.over_joints else (FrameTask(spec.node, pin.SE3.Identity(), 3, spec.rotation),)
        self._seeker = Seeker(self.mechanism, tasks, spec.limits)
        self._motors = [self.mechanism.q_index(name) for name in self.mechanism.actuated]
        self._moved = np.zeros(self.mechanism.model.nv, dtype=bool)  # by the step itself, which is no jump
        if self.over_joints:
            self._moved[[self.mechanism.v_index(name) for name in self.mechanism.actuated]] = True

    def configuration(self, u: float, v: float, q: Array) -> Array | None:
        """(nq,) at a point, m or rad, on the branch of a q (nq,) near it; None where there is none."""
        found = self._closed(u, v, q) if self.over_joints else self._sought(u, v, q)
        return found if found is not None and self._away(q, found) <= _JUMP else None

    def is_at(self, u: float, v: float, q: Array) -> bool:
        """Whether q (nq,) is a configuration of a point."""
        if self.over_joints:
            wanted = self._region.motors_at(self.mechanism, np.array([[u, v]]))[0]
            return bool(np.abs(q[self._motors] - wanted).max() <= _THERE * max(self.mechanism.length, 1.0))
        there, target = self.mechanism.placement(q, self._survey.node), self._target(u, v)
        turned = there.rotation @ target.rotation.T
        off = 0.0
        if self._survey.rotation == 2:
            off = float(np.linalg.norm((turned - np.eye(3)) @ target.rotation[:, 2]))
        elif self._survey.rotation == 3:
            off = float(np.linalg.norm(pin.log3(turned)))
        away = float(np.linalg.norm(there.translation - target.translation)) / self.mechanism.length
        return max(away, off) <= _THERE

    def linked(self, q: Array, other: Array) -> bool:
        """Whether two configurations of neighbours are on one branch."""
        return self._away(q, other) <= _JUMP

    def stopped(self, q: Array) -> bool:
        """Whether a joint is at a limit that it must keep to."""
        return self._survey.limits and not self.mechanism.limits.within(q, -_AT_LIMIT)

    def _away(self, q: Array, other: Array) -> float:
        gaps = np.abs(self.mechanism.scaled_difference(q, other))
        return float(gaps[~self._moved].max(initial=0.0))

    def _target(self, u: float, v: float) -> pin.SE3:
        points, rotations = self._region.poses_at(self._survey.home, np.array([[u, v]]))
        return pin.SE3(rotations[0], points[0])

    def _sought(self, u: float, v: float, q: Array) -> Array | None:
        self._seeker.tasks[0].target = self._target(u, v)
        return self._seeker.best if self._seeker.seek(q, _GOAL) else None

    def _closed(self, u: float, v: float, q: Array) -> Array | None:
        start = q.copy()
        start[self._motors] = self._region.motors_at(self.mechanism, np.array([[u, v]]))[0]
        try:
            found = self.mechanism.close(start, self.mechanism.actuated)
        except ClosureError:
            return None
        beyond = self._survey.limits and not self.mechanism.limits.within(found)
        return None if beyond else np.asarray(found)
