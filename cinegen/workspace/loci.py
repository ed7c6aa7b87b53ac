"""`loci`: the curves in a map of two axes along which the robot is singular, and the borders of what it reaches.

The configurations of the map's cells are the grid points; between two of them curves are found by bisection
(`cinegen.singularities.contour`), so they are finer than the cells. No curve is drawn between neighbours on different
branches, nor next to cells that are not evaluated.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.singularities.contour import SingularCurve, SingularityGrid
from cinegen.singularities.crossing import Rows, of_node, of_passive_joints
from cinegen.workspace.cells import CellStatus
from cinegen.workspace.continuation import JUMP, Continuation
from cinegen.workspace.errors import MapError
from cinegen.workspace.specification import MapSpecification, specification_of

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]

MOST = 121
"""Grid points along an axis, at most: of a finer map every second cell is taken, or every third."""

_THERE = 1e-7  # rad or lengths: a configuration that is further from a point belongs to another one
_AT_LIMIT = 1e-4  # rad or m from a limit


def loci(
    dataset: xarray.Dataset, spec: MapSpecification | None = None, report: Callable[[float], None] | None = None
) -> tuple[SingularCurve, ...]:
    """Find singular curves of both types, and the borders of what is reached: singular ones and others (joint limits).

    Of an arm with more actuated joints than motions of the node that count, type 1 is found only at the border: inside
    it occurs at single configurations, not on curves.

    Args:
        dataset: a map over two axes; or a slice of one, together with its specification.
        spec: specification of the cells; the map's own unless given.
        report: called with the finished part, 0 to 1.

    Raises:
        MapError: it is not a map over two axes with two cells or more each.
    """
    spec = specification_of(dataset) if spec is None else spec
    region, mechanism = spec.region, spec.mechanism
    if len(region.axes) != 2 or min(region.shape) < 2:
        raise MapError(
            f"curves are found in maps over two axes with two cells or more each; this one has "
            f"{' x '.join(map(str, region.shape))} cells over {', '.join(region.names)}"
        )
    u, v = (slice(None, None, -(-axis.count // MOST)) for axis in region.axes)
    surface = _Surface(spec)
    first = Rows(of_node(mechanism, spec.node, sum(spec.counted)), spec.rank)
    second = of_passive_joints(mechanism) if mechanism.passive_rank else None
    grid = SingularityGrid(surface, region.axes[0].middles()[u], region.axes[1].middles()[v], first, second)
    cells = dataset[["configuration", "status"]].isel({region.names[0]: u, region.names[1]: v})
    grid.q[:] = cells["configuration"].transpose(*region.names, "joint").values
    evaluated = cells["status"].transpose(*region.names).values != CellStatus.NOT_EVALUATED
    return grid.curves(report, surface.linked, surface.at_limit, evaluated)


class _Surface(Continuation):
    """A region over two axes: configurations at any point of it."""

    def __init__(self, spec: MapSpecification) -> None:
        super().__init__(spec)
        self.over_joints = spec.over_joints
        self._compared = np.ones(self.mechanism.model.nv, dtype=bool)  # joints whose step may be a jump
        if spec.over_joints:
            self._compared[[self.mechanism.v_index(name) for name in self.mechanism.actuated]] = False

    def configuration(self, u: float, v: float, q: Array) -> Array | None:
        """Return a configuration (nq,) at a point, m or rad, on the branch of a nearby q (nq,); None if none is."""
        found = self.at(np.array([u, v]), q)
        return found if found is not None and self.linked(q, found) else None

    def is_at(self, u: float, v: float, q: Array) -> bool:
        """Return whether q (nq,) is a configuration of a point."""
        spec, length, values = self.spec, self.mechanism.length, np.array([[u, v]])
        if spec.over_joints:
            wanted = spec.region.joint_values(self.mechanism, values)[0]
            return bool(np.abs(q[self.actuated] - wanted).max() <= _THERE * max(length, 1.0))
        (point,), (rotation, *_) = spec.region.poses(spec.home, values)
        pose = self.mechanism.placement(q, spec.node)
        turned = pose.rotation @ rotation.T
        angle = 0.0
        if spec.rotation == 2:
            angle = float(np.linalg.norm((turned - np.eye(3)) @ rotation[:, 2]))
        elif spec.rotation == 3:
            angle = float(np.linalg.norm(pin.log3(turned)))
        return max(float(np.linalg.norm(pose.translation - point)) / length, angle) <= _THERE

    def linked(self, q: Array, other: Array) -> bool:
        """Return whether two configurations of neighbours are on one branch."""
        gaps = np.abs(self.mechanism.scaled_difference(q, other))
        return bool(gaps[self._compared].max(initial=0.0) <= JUMP)

    def at_limit(self, q: Array) -> bool:
        """Return whether a joint is at a limit that it must keep to."""
        return self.spec.limits and not bool(self.mechanism.limits.within(q, -_AT_LIMIT))
