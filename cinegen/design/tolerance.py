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
from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ndtr, ndtri

from cinegen.arrays import Array, ArrayLike, Bools
from cinegen.design.amounts import Amounts, amount_in, pairs, sizes_by_index
from cinegen.design.design import Design
from cinegen.design.errors import DesignError
from cinegen.design.evaluation import DesignEvaluation
from cinegen.design.parameters import Parameters, is_pattern
from cinegen.design.ties import names_in
from cinegen.design.tolerance_input import columns_of, play_of
from cinegen.design.tolerance_report import INTERVAL, Forced, MonteCarlo, ToleranceReport, ToleranceSource
from cinegen.loops.thresholds import CLOSURE
from raff2urdf.quantities import ANGLE, LENGTH
from raff2urdf.raff.document import Document

_CHUNK = 20_000  # samples that are evaluated at once
_STEP = 0.5  # of a central difference, in half-widths
_ROUNDING = 1e-12  # of the characteristic length, and rad: a smaller deviation is none
_SINGULAR = 1e-6  # of the largest singular value of the loops


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
        sigmas = sizes_by_index(whole, deviations)
        named = {whole.find(name) for name, _ in deviations if not is_pattern(name)}
        encoders: dict[int, str] = {}
        for joint, amount in readings:
            variable = whole.own_variable(joint)
            i = whole.find(variable.name)
            if i in named:
                raise DesignError(
                    f"the reading of {joint} is {variable.name}: its error is given twice, as sigma and as encoder"
                )
            sigmas[i], encoders[i] = amount_in(f"encoder of {joint}", amount, variable.dimension), joint
        if isinstance(source, Parameters):
            parameters = source
        else:
            ties = (ties,) if isinstance(ties, str) else tuple(ties)
            for tie in ties:
                if not sigmas.keys() & {whole.find(each) for each in names_in(tie)}:
                    raise DesignError(f"the tie '{tie}' has no effect: give one of its parameters a tolerance")
            names = [whole.all[i].name for i in sorted(sigmas)] or [whole.all[0].name]
            parameters = Parameters(whole.document, names, ties, robot=whole.robot.name)
        moved = [each for name, amount in plays for each in play_of(whole, name, amount)]
        components = [(joint, c) for joint, _, cs, _ in moved for c in cs]
        for joint, component in (each for each, times in Counter(components).items() if times > 1):
            raise DesignError(f"the play of {joint} along {component} is given twice: remove one")
        self.interval = interval
        self.design = Design(parameters, components)
        self.sources: list[ToleranceSource] = []
        for column, tied in columns_of(parameters, sigmas, named).items():
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
        return self._closing(self.design)

    @cached_property
    def contradicting(self) -> list[ToleranceSource]:
        """The sources that open loops only while all actuated joints keep their readings, since actuation is
        redundant."""
        design, mechanism = self.design, self.design.mechanism
        if len(mechanism.actuated) <= mechanism.mobility:
            return []
        assembled = self._closing(Design(design.parameters, design.play, fixed=()))
        return [each for each in assembled if each not in self.closing]

    def _closing(self, design: Design) -> list[ToleranceSource]:
        samples = [design.evaluate(q=q) for q in design.mechanism.structure.samples]
        counts = Counter(name for each in samples for name in each.opening)
        opening = {design.names.index(name) for name, count in counts.items() if 2 * count > len(samples)}
        return [each for each in self.sources if opening.isdisjoint(each.columns)]

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
        evaluation = design.evaluate(q=start)
        self._check_regular(evaluation)
        closing = self.closing
        jacobian = evaluation.pose_derivative(name, "world")[0]
        deviations, sizes = np.zeros(len(design.names)), np.repeat([1.0 / mechanism.length, 1.0], 3)
        shares, linear, idle = np.zeros((len(closing), 2)), np.zeros(6), []
        for s, source in enumerate(closing):
            columns = jacobian[:, source.columns]
            deviations[list(source.columns)] = source.sigma
            linear += source.half_width * np.linalg.norm(columns, axis=1)
            shares[s] = [source.sigma**2 * (columns[rows] ** 2).sum() for rows in (slice(0, 3), slice(3, 6))]
            if np.abs(columns * sizes[:, None]).max() * source.half_width < 1e-15:
                idle.append(source.name)
        total = shares.sum(axis=0)
        moves = total > (_ROUNDING * np.array([mechanism.length, 1.0])) ** 2
        shares = np.divide(shares, total, out=np.zeros_like(shares), where=moves)
        covariance = (jacobian * deviations**2) @ jacobian.T
        second = self._second_order(evaluation, name, closing)
        contradicting = self.contradicting
        others = [source for source in self.sources if source not in closing and source not in contradicting]
        report = ToleranceReport(
            mechanism.name, name, start, evaluation.placements(name)[0], tuple(closing), tuple(idle), jacobian,
            covariance, linear, second, shares, self._forced(evaluation, others),
            self._forced(evaluation, contradicting), None, self.interval,
        )  # fmt: skip
        if not samples:
            return report
        drawn = self._monte_carlo(evaluation, name, closing, report.worst, samples, seed)
        return ToleranceReport(**{**vars(report), "monte_carlo": drawn})

    def accuracy(self, q: Array, node: str) -> Array:
        """Return the root mean square deviation of a node's position, sqrt(trace S) with the rows x, y, z of the
        module's S: sqrt(sum_kx (sigma_k dx/dp_k)^2).

        Args:
            q: (count, nq) closed configurations.
            node: its name.

        Returns:
            (count,) m; NaN where the mechanism is singular or open.
        """
        design = self.design
        evaluation = design.evaluate(q=q, near=True)
        deviations = np.zeros(len(design.names))
        for source in self.closing:
            deviations[list(source.columns)] = source.sigma
        moved = evaluation.pose_derivative(node, "world")[:, :3] * deviations
        errors = np.sqrt((moved**2).sum(axis=(1, 2)))
        return np.where((evaluation.gap <= CLOSURE) & self._regular(evaluation) & np.isfinite(errors), errors, np.nan)

    # --- the worst case ------------------------------------------------------------------------------------------

    def _second_order(self, evaluation: DesignEvaluation, node: str, closing: Sequence[ToleranceSource]) -> Array:
        """Return the bound (6,) of the terms of second order within all intervals."""
        columns = [k for source in closing for k in source.columns]
        widths = np.array([source.half_width for source in closing for _ in source.columns])
        moving = np.abs(evaluation.pose_derivative(node)[0][:, columns]).max(axis=0, initial=0.0) > 0.0
        moving |= np.abs(evaluation.joint_derivative[0][:, columns]).max(axis=0, initial=0.0) > 0.0
        columns, widths = [k for k, is_moving in zip(columns, moving, strict=True) if is_moving], widths[moving]
        if not columns:
            return np.zeros(6)
        jacobians = []
        for sign in (1.0, -1.0):
            values = np.tile(evaluation.p[0], (len(columns), 1))
            values[np.arange(len(columns)), columns] += sign * _STEP * widths
            changed = self.design.evaluate(values, evaluation.q, near=True)
            jacobians.append(changed.pose_derivative(node, "world")[:, :, columns] * widths)
        bend = np.moveaxis(jacobians[0] - jacobians[1], 0, 2) / (2.0 * _STEP)  # (6, by, along)
        turning = evaluation.pose_derivative(node, "world")[0, 3:, columns] * widths[:, None]  # (along, 3)
        # the rotation vector v changes by (1 - [v]/2 + ...) w
        bend[3:] -= 0.5 * np.moveaxis(np.cross(turning[None], turning[:, None]), 2, 0)
        return np.asarray(0.5 * np.abs(bend).sum(axis=(1, 2)))

    def _forced(self, evaluation: DesignEvaluation, others: Sequence[ToleranceSource]) -> Forced:
        mechanism = self.design.mechanism
        units = mechanism._loop_units
        turns = ["r" in component for loop in mechanism.loops for component in loop.components]
        turns += [not mechanism.is_prismatic(coupling.follower) for coupling in mechanism.couplings]
        angular = np.array(turns, dtype=bool)
        gaps = np.zeros((len(others), len(units)))
        for row, source in zip(gaps, others, strict=True):
            row[:] = source.half_width * np.linalg.norm(evaluation.opens[0][:, source.columns], axis=1) * units
        long, turned = gaps[:, ~angular], gaps[:, angular]
        position, angle = (part.max(axis=1, initial=0.0) for part in (long, turned))
        order = np.argsort(-(position / mechanism.length + angle), kind="stable")
        return Forced(
            tuple(others[i].name for i in order), position[order], angle[order],
            float(long.sum(axis=0).max(initial=0.0)), float(turned.sum(axis=0).max(initial=0.0)),
        )  # fmt: skip

    def _regular(self, evaluation: DesignEvaluation) -> Bools:
        if not self.design.rank:
            return np.ones(len(evaluation), dtype=bool)
        inverse = evaluation._decomposed[1]
        return np.asarray(inverse[:, 0] >= _SINGULAR * inverse[:, -1])

    def _check_regular(self, evaluation: DesignEvaluation) -> None:
        if not self._regular(evaluation)[0]:
            name = self.design.mechanism.name
            raise DesignError(f"{name} is singular there (type 2): small errors move the node without bound")

    # --- Monte Carlo ---------------------------------------------------------------------------------------------

    def _monte_carlo(
        self,
        evaluation: DesignEvaluation,
        node: str,
        closing: Sequence[ToleranceSource],
        worst: Array,
        count: int,
        seed: int,
    ) -> MonteCarlo:
        rng, design = np.random.default_rng(seed), self.design
        pose, nominal = evaluation.placements(node)[0], evaluation.p[0]
        sums, squares, largest = np.zeros(6), np.zeros((6, 6)), np.zeros(6)
        outside = failed = 0
        follow = evaluation.joint_derivative[0].T
        for first in range(0, count, _CHUNK):
            errors = self._draw(rng, closing, min(_CHUNK, count - first))
            model = design.mechanism.model
            if model.nq == model.nv:  # closed but for terms of second order
                starts = evaluation.q[0] + errors @ follow
            else:
                starts = np.array([pin.integrate(model, evaluation.q[0], step) for step in errors @ follow])
            samples = design.evaluate(nominal + errors, starts, derivatives=False, near=True)
            is_closed = samples.gap <= CLOSURE
            failed += int((~is_closed).sum())
            away = deviations(pose, samples.placements(node)[is_closed])
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
        errors = np.zeros((count, len(self.design.names)))
        cut, scale = _cut(self.interval)
        low = ndtr(-cut)
        play = len(self.design.parameters)
        for source in closing:
            if source.columns[0] < play:
                drawn = ndtri(low + (1.0 - 2.0 * low) * rng.random(count))
                errors[:, source.columns[0]] = source.sigma * scale * drawn
                continue
            size = len(source.columns)
            along = rng.normal(size=(count, size))
            radius = source.half_width * rng.random(count) ** (1.0 / size)
            errors[:, source.columns] = along * (radius / np.linalg.norm(along, axis=1))[:, None]
        return errors


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

    least = 1e-2
    if interval <= least / deviation(least):  # narrower than about an even distribution
        raise DesignError(f"an interval of {interval:g} standard deviations is narrower than any normal distribution's")
    cut = float(brentq(lambda c: c / deviation(c) - interval, least, interval))
    return cut, 1.0 / deviation(cut)
