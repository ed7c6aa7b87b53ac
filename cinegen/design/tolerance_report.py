"""The result of a tolerance analysis: variances, contributors, and how far to believe them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cinegen.arrays import Array, Indices
from cinegen.design.chains import COMPONENTS
from cinegen.typed_json import as_json
from raff2urdf.errors import counted
from raff2urdf.quantities import Dimension

_SMALL = 1e-3  # components of the deviation below this fraction of the largest are not compared
_ROUNDING = 1e-9  # fractions of the variance that differ by less are equal

INTERVAL = 3.0
"""Half-width of the interval of an error, in standard deviations."""


class ToleranceSource(NamedTuple):
    """A source of errors: one number, or the components of a joint's play.

    Attributes:
        name: of the parameter, `joint3 (play)` or `joint1 (encoder)`.
        columns: of the design.
        sigma: standard deviation of each component, m or rad.
        half_width: of its interval, or the radius of the disc or ball that it stays in, m or rad.
        dimension: length or angle.
    """

    name: str
    columns: tuple[int, ...]
    sigma: float
    half_width: float
    dimension: Dimension


@dataclass(frozen=True, eq=False)
class MonteCarlo:
    """Errors drawn at random, with loops closed.

    Attributes:
        count: number of samples.
        failed: of which the loops could not be closed.
        mean: (6,) mean deviation, m and rad.
        covariance: (6, 6).
        largest: (6,) largest deviation met.
        outside: number of samples outside the worst case in any component.
    """

    count: int
    failed: int
    mean: Array
    covariance: Array
    largest: Array
    outside: int


@dataclass(frozen=True, eq=False)
class Forced:
    """Tolerances that open loops.

    Attributes:
        names: of these sources, the one that opens most first.
        position: largest gap of a loop that each opens within its interval, m; of a coupling, that of the
            joint that follows, whose term has the factor 1 in RAFF.
        angle: likewise, rad.
        worst_position: gap if all are at the worst ends of their intervals, m.
        worst_angle: likewise, rad.
    """

    names: tuple[str, ...]
    position: Array
    angle: Array
    worst_position: float
    worst_angle: float


@dataclass(frozen=True, eq=False)
class ToleranceReport:
    """The accuracy of a node. Deviations are in the world's axes at its origin: position above rotation vector.

    Attributes:
        name: of the robot.
        node: the node.
        q: (nq,) configuration.
        pose: (4, 4) of the node there, m.
        sources: of errors, those that open loops left out.
        idle: names of sources that do not move the node.
        jacobian: (6, columns) of the design's columns, m and rad by m and rad.
        covariance: (6, 6), m and rad.
        linear: (6,) worst case to first order, m and rad.
        second_order: (6,) bound of the terms of second order.
        shares: (sources, 2) fraction of the variance of position and orientation that each contributes.
        forced: tolerances that open loops.
        contradicting: those that do so only while all actuated joints keep their readings: actuation is redundant.
        monte_carlo: None without samples.
        interval: half-width of the intervals, in standard deviations.
    """

    name: str
    node: str
    q: Array
    pose: Array
    sources: tuple[ToleranceSource, ...]
    idle: tuple[str, ...]
    jacobian: Array
    covariance: Array
    linear: Array
    second_order: Array
    shares: Array
    forced: Forced
    contradicting: Forced
    monte_carlo: MonteCarlo | None
    interval: float

    def __repr__(self) -> str:
        x, angle = self.position, math.degrees(self.orientation)
        return f"<ToleranceReport of {self.node}: {1000.0 * x:.4g} mm, {angle:.4g} degrees (1 sigma)>"

    @property
    def sigma(self) -> Array:
        """(6,) standard deviations, m and rad."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def position(self) -> float:
        """Root mean square deviation of the position, m."""
        return float(np.sqrt(np.trace(self.covariance[:3, :3])))

    @property
    def orientation(self) -> float:
        """Root mean square deviation of the orientation, rad."""
        return float(np.sqrt(np.trace(self.covariance[3:, 3:])))

    @property
    def worst(self) -> Array:
        """(6,) the worst case within all intervals: to first order, and the bound of what is of second order."""
        return self.linear + self.second_order

    @property
    def agreement(self) -> str:
        """The sentence that states how well the linear covariance and Monte Carlo agree; "" without samples."""
        drawn = self.monte_carlo
        if drawn is None:
            return ""
        closed, lost = drawn.count - drawn.failed, ""
        if drawn.failed:
            lost = f"; the loops of {drawn.failed} samples could not be closed"
        compared, ratio = self._ratios()
        if closed < 2:
            return f"{counted(closed, 'sample')} with loops closed: too few to compare{lost}"
        if not len(ratio):
            return f"{closed} samples with loops closed: nothing deviates to first order{lost}"
        names = ", ".join(COMPONENTS[i] for i in compared)
        return (
            f"Monte Carlo, {closed} samples with loops closed: standard deviations ({names}) are {ratio.min():.4f} to "
            f"{ratio.max():.4f} of the linear ones (sampling alone: 1 ± {1.0 / math.sqrt(2.0 * closed):.4f}), the "
            f"covariance differs by {100.0 * self.covariance_error:.2g} %; {drawn.outside} samples are outside the "
            f"worst case, the largest deviation is {100.0 * self._used():.0f} % of it{lost}"
        )

    @property
    def covariance_error(self) -> float:
        """Largest difference of an element of the covariance of Monte Carlo from the linear one, relative to the
        product of the two standard deviations; of components that deviate. NaN without samples."""
        if self.monte_carlo is None:
            return math.nan
        at = np.ix_(self._compared, self._compared)
        size = np.outer(self.sigma, self.sigma)[at]
        return float(np.abs((self.monte_carlo.covariance - self.covariance)[at] / size).max(initial=0.0))

    @property
    def _compared(self) -> Indices:
        """Components whose deviation is not negligible beside that of others of their kind."""
        largest = np.repeat([self.sigma[:3].max(), self.sigma[3:].max()], 3)
        return np.flatnonzero(self.sigma > np.maximum(_SMALL * largest, 1e-15))

    def _ratios(self) -> tuple[Indices, Array]:
        assert self.monte_carlo is not None
        compared = self._compared
        return compared, np.sqrt(np.diag(self.monte_carlo.covariance)[compared]) / self.sigma[compared]

    def _used(self) -> float:
        assert self.monte_carlo is not None
        counts = self.worst > 1e-15
        return float((self.monte_carlo.largest[counts] / self.worst[counts]).max(initial=0.0))

    def contributors(self, orientation: bool = False) -> list[tuple[ToleranceSource, float]]:
        """Return the sources and their fractions of the variance of the position, or of the orientation, the largest
        first; fractions that differ by rounding are equal, and in the order of the sources."""
        column = self.shares[:, int(orientation)]
        order = np.argsort(-column)
        rank = np.cumsum(np.diff(column[order], prepend=1.0) < -_ROUNDING)
        return [(self.sources[i], float(column[i])) for i in order[np.lexsort((order, rank))] if column[i] > 0.0]

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: m and rad."""
        drawn, names = self.monte_carlo, ("node", "pose", "interval", "sigma", "position", "orientation", "covariance")
        return as_json(
            self,
            *names,
            worst_case=as_json(self, "linear", "second_order"),
            contributors=[
                as_json(source, "name", "sigma", "half_width", position=share[0], orientation=share[1])
                for source, share in zip(self.sources, self.shares, strict=True)
            ],
            idle=self.idle,
            **{
                key: as_json(gaps, "names", "position", "angle", "worst_position", "worst_angle")
                for key, gaps in (("forced", self.forced), ("contradicting", self.contradicting))
            },
            monte_carlo=drawn
            and as_json(
                drawn, "failed", "mean", "covariance", "largest", "outside", samples=drawn.count,
                covariance_error=self.covariance_error, message=self.agreement,
            ),
        )  # fmt: skip
