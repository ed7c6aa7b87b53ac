"""Dexterity of a mechanism in a wanted box, and its singularities there, also between a map's samples.

From point to neighbouring point the mechanism is continued on one branch (`BoxConfigurations`). The signs of the
singular values of both types are compared between neighbours (`cinegen.singularities.crossing`): one that has changed
passed through 0. By Weyl's inequality most neighbours only need a look at how much the matrix has changed. What is
smaller than a cell and has no neighbours on both sides, as a singular point that a value touches without changing its
sign, is not seen unless it is one of the points: the smallest values are reported for that.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce

import numpy as np

from cinegen.arrays import Array, Bools, Indices
from cinegen.ik.batch import BatchEvaluator
from cinegen.singularities.ball_joints import balls
from cinegen.singularities.branch import SINGULAR, flood, neighbours
from cinegen.singularities.crossing import Rows, can_vanish
from cinegen.singularities.singularity import SingularityType
from cinegen.workspace.cells import Cells, CellStatus
from cinegen.workspace.continuation import Continuation
from cinegen.workspace.errors import MapError
from cinegen.workspace.quantities import QUANTITIES
from cinegen.workspace.region import GridAxis, Region
from cinegen.workspace.specification import MapSpecification
from raff2urdf.errors import did_you_mean

_EDGE = 1e-9  # of a cell's width: a box that ends on a border does not touch the next cell
_WHOLE = 1e-6  # of a cell's width: less is not cut off
_SAME = 1e-4  # rad or lengths: configurations that are nearer are one


@dataclass(frozen=True)
class WantedBox:
    """Ranges of a region's axes; an axis that is not named is wanted over its whole length.

    Attributes:
        ranges: lower and upper end by the name of the axis, m or rad.

    Raises:
        MapError: a range is empty.
    """

    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, (low, high) in self.ranges.items():
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise MapError(f"wanted box: {name} from {low:g} to {high:g} is no range: give the lower end first")

    def grid(self, region: Region) -> BoxGrid:
        """Return points in the whole box, also on its faces.

        Raises:
            MapError: the box names an axis that the region does not have, or goes beyond it.
        """
        for name in self.ranges:
            if name not in region.names:
                raise MapError(f"wanted box: the maps have no axis '{name}'{did_you_mean(name, region.names)}")
        return BoxGrid(region, [self.ranges.get(axis.name, (axis.low, axis.high)) for axis in region.axes])


class BoxGrid:
    """The middles of the parts of cells that are in a box, and points on its faces, edges and corners next to them.

    Points and cells are numbered with the last axis fastest.

    Args:
        region: the grid of the map.
        ranges: lower and upper end of the box for each axis, m or rad.

    Attributes:
        cells: the cells that the box touches, for each axis.
        shape: number of points along each axis.
        values: (n, axes) coordinates of the points, m or rad.
        middles: (cells,) number of the point in the middle of the part of each cell that is in the box.
        cut: (cells,) whether only a part of each cell is in the box.
        sizes: (cells,) size of the part of each cell that is in the box, in the unit of `Region.sizes`.
        edges: (m, 2) numbers of neighbouring points, the smaller one first.

    Raises:
        MapError: the box goes beyond the region.
    """

    def __init__(self, region: Region, ranges: Sequence[tuple[float, float]]) -> None:
        self.cells = tuple(map(_touched, region.axes, ranges))
        axes, along = [], []
        for axis, cells, sizes, ends in zip(region.axes, self.cells, region.sizes, ranges, strict=True):
            borders = np.clip(axis.borders[cells.start : cells.stop + 1], *ends)
            widths = np.diff(borders)
            whole = widths >= (1.0 - _WHOLE) * axis.width
            middles = np.where(whole, axis.middles(cells), 0.5 * (borders[:-1] + borders[1:]))
            axes.append(np.r_[borders[0], middles, borders[-1]])
            along.append(sizes[cells] * widths / axis.width)
        self.shape = tuple(map(len, axes))
        self.values: Array = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
        self.sizes = np.asarray(reduce(np.multiply.outer, along)).ravel()
        numbers = np.arange(len(self.values)).reshape(self.shape)
        self.middles: Indices = numbers[(slice(1, -1),) * len(axes)].ravel()
        self.cut = (self.values[self.middles] != region.values(self.cells)).any(axis=1)
        rows = [np.moveaxis(numbers, k, 0) for k in range(len(axes))]
        pairs = [np.column_stack([row[:-1].ravel(), row[1:].ravel()]) for row in rows]
        self.edges: Indices = np.concatenate(pairs)


def _touched(axis: GridAxis, ends: tuple[float, float]) -> slice:
    """Return the cells of an axis that a range touches.

    Raises:
        MapError: the range goes beyond the axis.
    """
    first, last = ((end - axis.low) / axis.width for end in ends)
    if first < -_EDGE or last > axis.count + _EDGE:
        raise MapError(
            f"wanted box: {axis.name} from {ends[0]:g} to {ends[1]:g} goes beyond the maps, which end at {axis.low:g} "
            f"and {axis.high:g}: make the maps larger"
        )
    return slice(max(0, math.floor(first + _EDGE)), min(axis.count, math.ceil(last - _EDGE)))


# --- configurations ---------------------------------------------------------------------------------------------


class BoxConfigurations(Continuation):
    """Configurations at all points of a box, continued from neighbour to neighbour, on one branch where possible.

    Args:
        spec: specification of the map.
        grid: the points.
        configurations: (cells along each axis.., nq) of the cells that the box touches, NaN where they are unreachable.

    Attributes:
        q: (n, nq) configuration at each point; NaN where none leads to it.
        parts: number of branches, or of parts of a branch that are not connected in the box.
        redundant: whether the mechanism has infinitely many configurations at a point.
    """

    def __init__(self, spec: MapSpecification, grid: BoxGrid, configurations: Array) -> None:
        super().__init__(spec)
        mechanism, self.grid = spec.mechanism, grid
        self.values = np.concatenate([grid.values, spec.region.values(grid.cells)])  # after the points the cells
        self._free = np.zeros(mechanism.model.nv, dtype=bool)  # joints for which whole turns make no difference
        for name in mechanism.joints:
            limited = spec.limits and np.isfinite(mechanism.limits[name].lower)
            self._free[mechanism.v_index(name)] = not (mechanism.is_prismatic(name) or limited)
        self.redundant = not spec.over_joints and spec.dof > spec.rank
        self._known, self._open = self._from_map(configurations.reshape(-1, configurations.shape[-1]))
        self.q, self.parts = np.full_like(self._known, np.nan), 0
        self._continue()

    @property
    def reached(self) -> Bools:
        """(n,) whether each point is reached."""
        return np.isfinite(self.q[:, 0])

    def end_at(self, first: int, second: int) -> Array | None:
        """Return where the configuration of a point leads at a neighbour: to the known one there, unless the mechanism
        is redundant; None if that is on another branch."""
        known: Array = self.q[second]
        if self.linked(self.q[first], known):
            return known
        end = self.onward(self.values[first], self.values[second], self.q[first])
        if end is None or self.redundant:
            return end
        gaps = self.mechanism.scaled_difference(end, known)
        gaps[self._free] = (gaps[self._free] + np.pi) % (2.0 * np.pi) - np.pi
        return end if np.abs(gaps).max(initial=0.0) <= _SAME else None

    # --- continuation --------------------------------------------------------------------------------------------

    def _from_map(self, configurations: Array) -> tuple[Array, Bools]:
        """Return (n, nq) what the map knows of the points, and (n,) which ones it does not know to be unreachable."""
        grid = self.grid
        count = len(grid.values)
        known, may = np.full((count, configurations.shape[1]), np.nan), np.ones(count, dtype=bool)
        known[grid.middles] = configurations
        reached = np.isfinite(configurations[:, 0])
        may[grid.middles] = reached | grid.cut
        for cell in np.flatnonzero(reached & grid.cut).tolist():
            point = int(grid.middles[cell])
            q = self.onward(self.values[count + cell], self.values[point], configurations[cell])
            known[point] = np.nan if q is None else q
        return known, may

    def _continue(self) -> None:
        near = neighbours(self.grid.shape).tolist()
        for first in np.flatnonzero(np.isfinite(self._known[:, 0])).tolist():
            if not np.isfinite(self.q[first, 0]):
                self.parts += 1
                self.q[first] = self._known[first]
                flood([first], near, self._reach)

    def _reach(self, first: int, second: int) -> bool:
        """Set the configuration at a point to where that of its neighbour leads, on the same branch; return whether it
        is new: False if it had one, or the map knows it to be unreachable, or the path there is blocked.

        Args:
            first: number of the neighbour, which is reached.
            second: number of the point.
        """
        if not self._open[second] or np.isfinite(self.q[second, 0]):
            return False
        q, end = self.q[first], self._known[second]
        if not (np.isfinite(end[0]) and self.same_branch(q, end)):
            end = self.onward(self.values[first], self.values[second], q)
        if end is not None:
            self.q[second] = end
        return end is not None


# --- regularity ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Regularity:
    """Singularities in a box, also between its points.

    Attributes:
        first: whether there is one of type 1.
        second: whether there is one of type 2.
        joined: whether all points are on one branch: from each the mechanism can go to its neighbours in the box.
    """

    first: bool
    second: bool
    joined: bool

    @property
    def kind(self) -> SingularityType:
        """Types of the singularities."""
        return SingularityType.of(self.first, self.second)

    def __bool__(self) -> bool:
        """Return whether there are none, and all points are on one branch."""
        return self.joined and self.kind is SingularityType.NONE


def regularity(box: BoxConfigurations) -> Regularity:
    """Return whether a mechanism is regular in a box, as far as it is reached."""
    edges = box.grid.edges
    edges = edges[box.reached[edges].all(axis=1)]
    joined, passes = box.parts <= 1, {}
    for kind, rows in ((SingularityType.TYPE_1, box.end), (SingularityType.TYPE_2, box.passive)):
        passes[kind] = False
        if rows is None:
            continue
        for first, second in _candidates(box, rows, edges):
            crossed, sure = _crossed(box, rows, first, second)
            joined &= crossed or sure
            if crossed:
                passes[kind] = True
                break
    far = (edge for edge in edges.tolist() if not box.linked(*box.q[edge]))
    joined = joined and all(box.end_at(*edge) is not None for edge in far)
    return Regularity(passes[SingularityType.TYPE_1], passes[SingularityType.TYPE_2], joined)


def _candidates(box: BoxConfigurations, rows: Rows, edges: Indices) -> Iterator[tuple[int, int]]:
    """Yield neighbours between which the singular value can pass through 0 (`crossing.can_vanish`), or of which it is 0
    at one; layer by layer, so that few matrices are kept."""
    layers = box.grid.shape[0]
    layer = len(box.q) // layers
    nothing = np.zeros_like(rows.of(box.mechanism.q_home))
    before = np.zeros((0, *nothing.shape)), np.zeros(0)
    for k in range(layers):
        points = box.q[k * layer : (k + 1) * layer]
        matrices = np.array([rows.of(q) if np.isfinite(q[0]) else nothing for q in points])
        of_layer = matrices, rows.sigma(matrices)
        matrices, sigma = (np.concatenate(pair) for pair in zip(before, of_layer, strict=True))
        offset = max(k - 1, 0) * layer
        first, second = (edges[edges[:, 1] // layer == k] - offset).T
        change = np.linalg.norm(matrices[first] - matrices[second], axis=(1, 2))
        least = np.minimum(sigma[first], sigma[second])
        for edge in np.flatnonzero(can_vanish(sigma[first], sigma[second], change) | (least <= SINGULAR)):
            yield int(first[edge]) + offset, int(second[edge]) + offset
        before = of_layer


def _crossed(box: BoxConfigurations, rows: Rows, first: int, second: int) -> tuple[bool, bool]:
    """Return whether the singular value passes through 0 between two neighbours, or is 0 there; and, if not, whether
    that is certain."""
    if rows.sigma(np.array([rows.of(q) for q in box.q[[first, second]]])).min() <= SINGULAR:
        return True, True
    end = box.end_at(first, second)
    if end is None:
        return False, False
    ends = box.q[first], end
    crossings = list(box.crossings(rows, box.values[first], box.values[second], ends))
    crossed = any(box.is_singular(rows, crossing, ends) for crossing in crossings)
    return crossed, box.redundant or not crossings


# --- dexterity -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class WorstAndMean:
    """A quantity in a box; NaN if nothing of the box is reached.

    Attributes:
        worst: the minimum, at the middles of cells and on the faces of the box.
        mean: of the middles, weighted by the sizes of the cells.
    """

    worst: float
    mean: float


@dataclass(frozen=True)
class Dexterity:
    """Dexterity of a mechanism in a box.

    The mean of 1/condition is the global conditioning index of Gosselin and Angeles ("A global performance index for
    the kinematic optimization of robotic manipulators", ASME J. Mechanical Design 113, 1991).

    Attributes:
        reached: part of the box that is reached, 0 to 1, by the middles of cells.
        whole: whether the whole box is reached, its faces too.
        sigma_1: smallest singular value of type 1, dimensionless.
        conditioning: 1/condition number of the node's motions by the actuated joints: 1 at best, 0 if singular.
        sigma_2: minimum of the singular values of type 2; infinite where there are no passive joints.
    """

    reached: float
    whole: bool
    sigma_1: WorstAndMean
    conditioning: WorstAndMean
    sigma_2: float


def dexterity(box: BoxConfigurations) -> Dexterity:
    """Return the dexterity of a mechanism in a box, as far as it is reached."""
    spec, reached, inner = box.spec, box.reached, box.grid.middles
    sizes = np.zeros(len(box.q))
    sizes[inner] = box.grid.sizes
    q = box.q[reached]
    done = BatchEvaluator(spec.mechanism, spec.node, *spec.counted, balls(spec.mechanism)).at(q)
    cells = Cells(spec, np.full(len(q), CellStatus.REACHABLE, np.uint8), done)
    with np.errstate(divide="ignore"):
        conditioning = np.nan_to_num(1.0 / QUANTITIES["condition"].of(cells).astype(float), nan=0.0)
    sigma_1 = QUANTITIES["sigma_1"].of(cells).astype(float)
    sigma_2 = [box.passive.sigma(box.passive.of(each)[None])[0] for each in q] if box.passive is not None else []

    def summary(values: Array) -> WorstAndMean:
        if not len(values):
            return WorstAndMean(math.nan, math.nan)
        return WorstAndMean(float(values.min()), float(np.average(values, weights=sizes[reached])))

    return Dexterity(
        1.0 if reached[inner].all() else float(sizes[reached].sum() / sizes.sum()),
        bool(reached.all()), summary(sigma_1), summary(conditioning), float(min(sigma_2, default=math.inf)),
    )  # fmt: skip
