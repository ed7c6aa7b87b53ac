"""`loci`: the curves in a map of two axes along which the robot is singular, and the borders of what it reaches.

The configurations of the map's cells are the grid points; between two of them curves are found by bisection
(`cinegen.singularities.contour`), so they are finer than the cells. No curve is drawn between neighbours on different
branches, nor next to cells that are not evaluated.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from cinegen.arrays import Array
from cinegen.singularities.contour import SingularCurve, SingularityGrid
from cinegen.workspace.cells import CellStatus
from cinegen.workspace.continuation import Continuation
from cinegen.workspace.errors import MapError
from cinegen.workspace.specification import MapSpecification, specification_of

if TYPE_CHECKING:
    import xarray


MOST = 121
"""Grid points along an axis, at most: of a finer map every second cell is taken, or every third."""

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
    on = Continuation(spec)
    grid = SingularityGrid(on, region.axes[0].middles()[u], region.axes[1].middles()[v])
    cells = dataset[["configuration", "status"]].isel({region.names[0]: u, region.names[1]: v})
    grid.q[:] = cells["configuration"].transpose(*region.names, "joint").values.reshape(grid.q.shape)
    evaluated = cells["status"].transpose(*region.names).values != CellStatus.NOT_EVALUATED

    def at_limit(q: Array) -> bool:
        return spec.limits and not bool(mechanism.limits.within(q, -_AT_LIMIT))

    return grid.curves(report, on.linked, at_limit, evaluated.ravel())
