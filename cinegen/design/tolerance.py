"""`tolerance`: how accurate a mechanism is whose parameters, joints and encoders have errors.

With J = dX / dp, loops closed and the encoders' readings kept (`cinegen.design.design`), errors whose standard
deviations are sigma have, to first order, the covariance

    S = J diag(sigma^2) J^T .

Each error stays within an interval of half-width D. A coordinate x of the node then stays within

    sum_k |dx/dp_k| D_k  +  1/2 sum_kl |d2x/dp_k dp_l| D_k D_l ,

of which the first sum is attained but for terms of second order, and the second bounds these; it is computed from
central differences of J. Terms of third order are left out. Within the play of a joint, its axis is anywhere in a disc
(a ball joint's centre in a ball): there |dx/dp| is the length of the gradient in that disc.

Errors that open loops (`DesignEvaluation.opens`) can't be assembled without force. How the node moves then depends on
the elasticity of the parts, which is not known here: they are left out of S, and listed with the gaps to be forced.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ndtr, ndtri

from cinegen.arrays import Array, ArrayLike, Bools, Indices
from cinegen.design.amounts import Amounts, amount_in, matching, pairs
from cinegen.design.chains import COMPONENTS
from cinegen.design.design import Design, DesignEvaluation
from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters, is_pattern
from cinegen.design.ties import fits
from cinegen.loops.thresholds import CLOSURE
from cinegen.typed_json import as_json
from raff2urdf.errors import did_you_mean
from raff2urdf.quantities import ANGLE, LENGTH, Dimension, has_unit, shown
from raff2urdf.raff.document import Document, LoopKind

INTERVAL = 3.0
"""Half-width of the interval of an error, in standard deviations."""

_CHUNK = 20_000  # samples that are evaluated at once
_STEP = 0.5  # of a central difference, in half-widths
_SMALL = 1e-3  # components of the deviation below this fraction of the largest are not compared
_ROUNDING = 1e-12  # of the characteristic length, and rad: a smaller deviation is none
_SINGULAR = 1e-6  # of the largest singular value of the loops
_ACROSS = {LoopKind.REVOLUTE: 2, LoopKind.PRISMATIC: 2, LoopKind.BALL: 3, LoopKind.RIGID: 0}


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
        position: largest gap of a loop that each opens within its interval, m.
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
        found = self.monte_carlo
        if found is None:
            return ""
        counted, lost = found.count - found.failed, ""
        if found.failed:
            lost = f"; the loops of {found.failed} samples could not be closed"
        compared, ratio = self._ratios()
        if not len(ratio) or counted < 2:
            return f"{counted} samples with loops closed: nothing deviates to first order{lost}"
        names = ", ".join(COMPONENTS[i] for i in compared)
        return (
            f"Monte Carlo, {counted} samples with loops closed: standard deviations ({names}) are {ratio.min():.4f} to "
            f"{ratio.max():.4f} of the linear ones (sampling alone: 1 ± {1.0 / math.sqrt(2.0 * counted):.4f}), the "
            f"covariance differs by {100.0 * self.covariance_error:.2g} %; {found.outside} samples are outside the "
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
        first."""
        column = self.shares[:, int(orientation)]
        return [(self.sources[i], float(column[i])) for i in np.argsort(-column, kind="stable") if column[i] > 0.0]

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: m and rad."""
        found, names = self.monte_carlo, ("node", "pose", "interval", "sigma", "position", "orientation", "covariance")
        return as_json(
            self,
            *names,
            worst_case=as_json(self, "linear", "second_order"),
            contributors=[
                as_json(one, "name", "sigma", "half_width", position=share[0], orientation=share[1])
                for one, share in zip(self.sources, self.shares, strict=True)
            ],
            idle=self.idle,
            forced=as_json(self.forced, "names", "position", "angle", "worst_position", "worst_angle"),
            monte_carlo=found
            and as_json(
                found, "failed", "mean", "covariance", "largest", "outside", samples=found.count,
                covariance_error=self.covariance_error, message=self.agreement,
            ),
        )  # fmt: skip


class Tolerances:
    """Tolerances of a mechanism, from which its accuracy follows at any configuration.

    Args:
        source: as `Parameters` takes it, or parameters: then those that are named in `sigma` must be free there.
        sigma: standard deviations of parameters, by name or pattern: a number in m or rad, or a text such as "0.05mm".
            Later entries replace earlier ones. A number for a pattern that matches lengths and angles is refused. Those
            of the base's pose are matched by patterns that begin with `base` only.
        play: largest displacement of joints and loops, by name: of a revolute or prismatic joint across its axis, of a
            ball joint in any direction; angles are tilts across the axis. `joint3.z` is one component, in the axes of
            the joint's frame.
        encoder: standard deviations of joints' readings, by name.
        interval: half-width of the intervals of `sigma` and `encoder`, in standard deviations.
        robot: name of one robot of a file that holds several.
        ties: see `cinegen.design.ties`; parameters that are tied have one error.

    Attributes:
        design: whose columns have tolerances.
        sources: of errors.
        interval: as given.

    Raises:
        DesignError: an unknown name, a wrong unit, nothing given.
    """

    def __init__(
        self,
        source: str | Path | Document | Parameters,
        sigma: Amounts | None = None,
        play: Amounts | None = None,
        encoder: Amounts | None = None,
        interval: float = INTERVAL,
        robot: str | None = None,
        ties: Iterable[str] = (),
    ) -> None:
        if not 1.0 < interval < 8.0:
            raise DesignError(f"an interval is 1 to 8 standard deviations wide to either side, not {interval:g}")
        deviations, plays, readings = pairs(sigma), pairs(play), pairs(encoder)
        if not (deviations or plays or readings):
            raise DesignError("no tolerances are given: write for instance --sigma 'link*.d=0.05mm, *.alpha=0.02deg'")
        whole = source if isinstance(source, Parameters) else Parameters(source, robot=robot)
        sigmas: dict[int, float] = {}
        named = set[int]()
        for pattern, amount in deviations:
            found = matching(whole, pattern, amount)
            sigmas |= {i: amount_in(pattern, amount, whole.all[i].dimension) for i in found}
            named |= set() if is_pattern(pattern) else set(found)
        encoders: dict[int, str] = {}
        for joint, amount in readings:
            own = whole.own_variable(joint)
            i = whole.find(own.name)
            sigmas[i], encoders[i] = amount_in(f"encoder of {joint}", amount, own.dimension), joint
        if isinstance(source, Parameters):
            parameters = source
        else:
            names = [whole.all[i].name for i in sorted(sigmas)] or [whole.all[0].name]
            parameters = Parameters(whole.document, names, ties, robot=whole.robot.name)
        moved = [one for name, amount in plays for one in _play(whole, name, amount)]
        components = [(joint, c) for joint, _, cs, _ in moved for c in cs]
        for joint, component in (one for one, times in Counter(components).items() if times > 1):
            raise DesignError(f"the play of {joint} along {component} is given twice: remove one")
        self.interval = interval
        self.design = Design(parameters, components)
        self.sources: list[ToleranceSource] = []
        for column, tied in _columns(parameters, sigmas, named).items():
            i = tied[0]
            name = f"{encoders[i]} (encoder)" if i in encoders else parameters.tied_name(column)
            width = interval * sigmas[i]
            self.sources.append(ToleranceSource(name, (column,), sigmas[i], width, parameters.all[i].dimension))
        column = len(parameters)
        for _, name, along, radius in moved:
            columns = tuple(range(column, column + len(along)))
            dimension = ANGLE if along[0].startswith("r") else LENGTH
            deviation = radius / math.sqrt(len(along) + 2.0)  # of a point evenly distributed in a ball
            self.sources.append(ToleranceSource(name, columns, deviation, radius, dimension))
            column += len(along)

    @cached_property
    def closing(self) -> list[ToleranceSource]:
        """The sources that open no loop: at home and most of a few random configurations, since at a singularity there
        are more."""
        samples = [self.design.evaluate(q=q) for q in self.design.mechanism.structure.samples]
        counts = Counter(name for one in samples for name in one.opening)
        opening = {self.design.names.index(name) for name, count in counts.items() if 2 * count > len(samples)}
        return [one for one in self.sources if opening.isdisjoint(one.columns)]

    def at(
        self, q: ArrayLike | None = None, node: str | None = None, samples: int = 0, seed: int = 0
    ) -> ToleranceReport:
        """Return the accuracy of a node.

        Args:
            q: (nq,) configuration, whose actuated joints' values are the readings; home by default.
            node: its name; the end by default.
            samples: of Monte Carlo.
            seed: of the samples.

        Raises:
            ClosureError: the loops can't be closed there.
            UnknownNameError: no such node.
            DesignError: it is singular there: errors are unbounded.
        """
        design, mechanism = self.design, self.design.mechanism
        name = mechanism.end if node is None else node
        mechanism.frame_id(name)
        start = design.close(design.values, mechanism.q_home if q is None else mechanism.structure.checked(q))
        here = design.evaluate(q=start)
        self._check_regular(here)
        closing = self.closing
        jacobian = here.pose_derivative(name, "world")[0]
        deviations, sizes = np.zeros(len(design.names)), np.repeat([1.0 / mechanism.length, 1.0], 3)
        shares, linear, idle = np.zeros((len(closing), 2)), np.zeros(6), []
        for s, one in enumerate(closing):
            columns = jacobian[:, one.columns]
            deviations[list(one.columns)] = one.sigma
            linear += one.half_width * np.linalg.norm(columns, axis=1)
            shares[s] = [one.sigma**2 * (columns[rows] ** 2).sum() for rows in (slice(0, 3), slice(3, 6))]
            if np.abs(columns * sizes[:, None]).max() * one.half_width < 1e-15:
                idle.append(one.name)
        total = shares.sum(axis=0)
        moves = total > (_ROUNDING * np.array([mechanism.length, 1.0])) ** 2
        shares = np.divide(shares, total, out=np.zeros_like(shares), where=moves)
        covariance = (jacobian * deviations**2) @ jacobian.T
        second = self._second_order(here, name, closing)
        report = ToleranceReport(
            mechanism.name, name, start, here.placements(name)[0], tuple(closing), tuple(idle), jacobian, covariance,
            linear, second, shares, self._forced(here, closing), None, self.interval,
        )  # fmt: skip
        if not samples:
            return report
        found = self._monte_carlo(here, name, closing, report.worst, samples, seed)
        return ToleranceReport(**{**vars(report), "monte_carlo": found})

    def accuracy(self, q: Array, node: str) -> Array:
        """Return the root mean square deviation (count,) of a node's position, m, at closed configurations
        (count, nq); NaN where it is singular or open."""
        design = self.design
        here = design.evaluate(q=q, near=True)
        deviations = np.zeros(len(design.names))
        for one in self.closing:
            deviations[list(one.columns)] = one.sigma
        moved = here.pose_derivative(node, "world")[:, :3] * deviations
        found = np.sqrt((moved**2).sum(axis=(1, 2)))
        return np.where((here.gap <= CLOSURE) & self._regular(here) & np.isfinite(found), found, np.nan)

    # --- the worst case ------------------------------------------------------------------------------------------

    def _second_order(self, here: DesignEvaluation, node: str, closing: Sequence[ToleranceSource]) -> Array:
        """Return the bound (6,) of the terms of second order within all intervals."""
        columns = [k for one in closing for k in one.columns]
        widths = np.array([one.half_width for one in closing for _ in one.columns])
        moving = np.abs(here.pose_derivative(node)[0][:, columns]).max(axis=0, initial=0.0) > 0.0
        moving |= np.abs(here.joint_derivative[0][:, columns]).max(axis=0, initial=0.0) > 0.0
        columns, widths = [k for k, is_moving in zip(columns, moving, strict=True) if is_moving], widths[moving]
        if not columns:
            return np.zeros(6)
        jacobians = []
        for sign in (1.0, -1.0):
            values = np.tile(here.p[0], (len(columns), 1))
            values[np.arange(len(columns)), columns] += sign * _STEP * widths
            there = self.design.evaluate(values, here.q, near=True)
            jacobians.append(there.pose_derivative(node, "world")[:, :, columns] * widths)
        bend = np.moveaxis(jacobians[0] - jacobians[1], 0, 2) / (2.0 * _STEP)  # (6, by, along)
        turning = here.pose_derivative(node, "world")[0, 3:, columns] * widths[:, None]  # (along, 3)
        # the rotation vector v changes by (1 - [v]/2 + ...) w
        bend[3:] -= 0.5 * np.moveaxis(np.cross(turning[None], turning[:, None]), 2, 0)
        return np.asarray(0.5 * np.abs(bend).sum(axis=(1, 2)))

    def _forced(self, here: DesignEvaluation, closing: Sequence[ToleranceSource]) -> Forced:
        mechanism = self.design.mechanism
        units, angular = mechanism._loop_units, np.zeros(len(mechanism._loop_units), dtype=bool)
        components = [component for loop in mechanism.loops for component in loop.components]
        angular[: len(components)] = ["r" in component for component in components]
        others = [one for one in self.sources if one not in closing]
        gaps = np.zeros((len(others), len(units)))
        for row, one in zip(gaps, others, strict=True):
            row[:] = one.half_width * np.linalg.norm(here.opens[0][:, one.columns], axis=1) * units
        long, turned = gaps[:, ~angular], gaps[:, angular]
        position, angle = (part.max(axis=1, initial=0.0) for part in (long, turned))
        order = np.argsort(-(position / mechanism.length + angle), kind="stable")
        return Forced(
            tuple(others[i].name for i in order), position[order], angle[order],
            float(long.sum(axis=0).max(initial=0.0)), float(turned.sum(axis=0).max(initial=0.0)),
        )  # fmt: skip

    def _regular(self, here: DesignEvaluation) -> Bools:
        if not self.design.rank:
            return np.ones(len(here), dtype=bool)
        inverse = here._decomposed[1]
        return np.asarray(inverse[:, 0] >= _SINGULAR * inverse[:, -1])

    def _check_regular(self, here: DesignEvaluation) -> None:
        if not self._regular(here)[0]:
            name = self.design.mechanism.name
            raise DesignError(f"{name} is singular there (type 2): small errors move the node without bound")

    # --- Monte Carlo ---------------------------------------------------------------------------------------------

    def _monte_carlo(
        self, here: DesignEvaluation, node: str, closing: Sequence[ToleranceSource], worst: Array, count: int, seed: int
    ) -> MonteCarlo:
        rng, design = np.random.default_rng(seed), self.design
        pose, nominal = here.placements(node)[0], here.p[0]
        sums, squares, largest = np.zeros(6), np.zeros((6, 6)), np.zeros(6)
        outside = failed = 0
        follow = here.joint_derivative[0].T
        for first in range(0, count, _CHUNK):
            errors = self._draw(rng, closing, min(_CHUNK, count - first))
            model = design.mechanism.model
            if model.nq == model.nv:  # closed but for terms of second order
                starts = here.q[0] + errors @ follow
            else:
                starts = np.array([pin.integrate(model, here.q[0], step) for step in errors @ follow])
            there = design.evaluate(nominal + errors, starts, derivatives=False, near=True)
            is_closed = there.gap <= CLOSURE
            failed += int((~is_closed).sum())
            away = deviations(pose, there.placements(node)[is_closed])
            sums += away.sum(axis=0)
            squares += away.T @ away
            largest = np.maximum(largest, np.abs(away).max(axis=0, initial=0.0))
            outside += int((np.abs(away) > worst * (1.0 + 1e-9) + 1e-13).any(axis=1).sum())
        used = max(count - failed, 1)
        mean = sums / used
        return MonteCarlo(count, failed, mean, squares / used - np.outer(mean, mean), largest, outside)

    def _draw(self, rng: np.random.Generator, closing: Sequence[ToleranceSource], count: int) -> Array:
        """Return errors (count, columns): normal ones, cut at their intervals and scaled so that their standard
        deviations are as stated; play evenly distributed in its ball."""
        found = np.zeros((count, len(self.design.names)))
        cut, scale = _cut(self.interval)
        low = ndtr(-cut)
        play = len(self.design.parameters)
        for one in closing:
            if one.columns[0] < play:
                drawn = ndtri(low + (1.0 - 2.0 * low) * rng.random(count))
                found[:, one.columns[0]] = one.sigma * scale * drawn
                continue
            size = len(one.columns)
            along = rng.normal(size=(count, size))
            radius = one.half_width * rng.random(count) ** (1.0 / size)
            found[:, one.columns] = along * (radius / np.linalg.norm(along, axis=1))[:, None]
        return found


def tolerance(
    source: str | Path | Document | Parameters,
    sigma: Amounts | None = None,
    play: Amounts | None = None,
    encoder: Amounts | None = None,
    q: ArrayLike | None = None,
    node: str | None = None,
    samples: int = 0,
    seed: int = 0,
    interval: float = INTERVAL,
    robot: str | None = None,
    ties: Iterable[str] = (),
) -> ToleranceReport:
    """Return the accuracy of a node of a mechanism with tolerances; the arguments are those of `Tolerances` and of
    `Tolerances.at`::

        tolerance("delta4", {"link*.d": "0.05mm", "*.alpha": "0.02deg"}, encoder={"joint1": "0.01deg"}, samples=100_000)

    Raises:
        DesignError: see `Tolerances`.
    """
    return Tolerances(source, sigma, play, encoder, interval, robot, ties).at(q, node, samples, seed)


def deviations(pose: Array, poses: Array) -> Array:
    """Return the deviations (count, 6) of poses (count, 4, 4) from one (4, 4): of the position, m, and the rotation
    vector, rad, in the world's axes."""
    turned = Rotation.from_matrix(poses[:, :3, :3] @ pose[:3, :3].T)
    return np.hstack([poses[:, :3, 3] - pose[:3, 3], turned.as_rotvec()])


def _cut(interval: float) -> tuple[float, float]:
    """Return where a normal distribution is cut, and by what it is scaled then, so that its standard deviation is 1 and
    its interval as wide as wanted."""

    def deviation(cut: float) -> float:
        density = math.exp(-0.5 * cut * cut) / math.sqrt(2.0 * math.pi)
        return math.sqrt(1.0 - 2.0 * cut * density / (2.0 * float(ndtr(cut)) - 1.0))

    if interval <= math.sqrt(3.0):  # narrower than an even distribution
        raise DesignError(f"an interval of {interval:g} standard deviations is narrower than any normal distribution's")
    cut = float(brentq(lambda c: c / deviation(c) - interval, 1e-2, interval))
    return cut, 1.0 / deviation(cut)


# --- what is given ----------------------------------------------------------------------------------------------------


def _columns(parameters: Parameters, sigmas: Mapping[int, float], named: Container[int]) -> dict[int, list[int]]:
    """Return the columns that have tolerances, and the indices in `Parameters.all` of what these belong to: parameters
    that are tied err alike.

    Args:
        parameters: the free ones, with ties.
        sigmas: standard deviations, by index.
        named: indices that were named, not matched by a pattern.

    Raises:
        DesignError: parameters that are tied have different tolerances; one that follows from others was named, or
            those have none.
    """
    matrix, found, following = parameters.ties.matrix, dict[int, list[int]](), list[int]()
    for i in sorted(sigmas):
        columns = np.flatnonzero(matrix[i])
        if len(columns) == 1 and abs(matrix[i, columns[0]]) == 1.0:
            found.setdefault(int(columns[0]), []).append(i)
        else:
            following.append(i)
    for own in found.values():
        for i in own[1:]:
            if sigmas[i] != sigmas[own[0]]:
                first, second = (parameters.all[k] for k in (own[0], i))
                texts = [shown(sigmas[k], first.dimension) for k in (own[0], i)]
                raise DesignError(
                    f"{first.name} and {second.name} are tied, but have different tolerances: {' and '.join(texts)}"
                )
    for i in following:
        masters = np.flatnonzero(matrix[i]).tolist()
        lacking = [parameters.names[k] for k in masters if k not in found]
        if i in named or lacking:
            follows = " and ".join(parameters.names[k] for k in masters) or "a constant"
            raise DesignError(
                f"{parameters.all[i].name} follows from {follows} by a tie: give the tolerance to "
                f"{' and '.join(lacking or [parameters.names[k] for k in masters]) or 'a parameter that is not tied'}"
            )
    return found


def _play(whole: Parameters, name: str, amount: float | str) -> list[tuple[str, str, list[str], float]]:
    """Return the joint or loop, the name of the source, the components and the amount of a play."""
    mechanism = whole.mechanism
    kinds = {loop.name: _ACROSS[loop.kind] for loop in mechanism.loops}
    kinds |= dict.fromkeys(mechanism.joints, 2) | dict.fromkeys(mechanism.balls, 3)
    joint, dot, component = name.rpartition(".")
    if name not in kinds and dot and joint in kinds and component in COMPONENTS:
        value = amount_in(f"play of {name}", amount, ANGLE if component.startswith("r") else LENGTH)
        return [(joint, f"{name} (play)", [component], value)]
    if name not in kinds:
        raise DesignError(
            f"{mechanism.name} has no joint or loop '{name}' to have play{did_you_mean(name, list(kinds))}"
        )
    if not kinds[name]:
        raise DesignError(f"loop '{name}' is rigid: it has no play; give that of a joint next to it")
    tilts = isinstance(amount, str) and fits(amount, ANGLE) and has_unit(amount)
    value = amount_in(f"play of {name}", amount, ANGLE if tilts else LENGTH)
    if tilts and kinds[name] == 3:
        raise DesignError(f"'{name}' is a ball joint: its play is a length, not {amount}")
    return [
        (
            name,
            f"{name} ({'tilt' if tilts else 'play'})",
            list(COMPONENTS[3:5] if tilts else COMPONENTS[: kinds[name]]),
            value,
        )
    ]
