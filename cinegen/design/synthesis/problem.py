"""Synthesis: values of the parameters with which a mechanism does a task best.

Each start is a sequence of nonlinear programs with exact derivatives (SLSQP of scipy). A worst case is a largest lower
bound t: maximise t with t <= f_i(p) at points i, to which those of a finer grid are added where f or a constraint is
worse (exchange of points), until none is. The answer is then checked at points that the optimiser did not see, on the
mechanism as it is loaded from the file that is written.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters
from cinegen.design.synthesis.linkages import LinkageSynthesis, PrecisionProblem
from cinegen.design.synthesis.objectives import Scores, Scoring
from cinegen.design.synthesis.reaching import Reached, Reaching
from cinegen.design.synthesis.task import DesignObjective, Precision, Task, load_task, task_of
from cinegen.errors import CinegenError
from raff2urdf import Document
from raff2urdf.files import write_all

Array = NDArray[np.float64]

_ROUNDS = 8  # of exchange
_WORSE = 1e-7  # below the bound at points of the optimiser: the point is added
_FEASIBLE = 1e-6
_UNSEEN = 512  # points of the check
_SLIGHT = 1e-3
_ADDED = 4  # points of one round for each kind


@dataclass(frozen=True)
class Start:
    """The result of one start.

    Attributes:
        index: 0 for the file's values.
        p: (parameters,) m and rad.
        score: of the first objective; larger is better.
        violation: largest violation of a constraint, dimensionless; 0 where all hold.
        evaluations: designs that were evaluated, each at all points of the optimiser.
        missed: distance of the furthest point that is not reached, m (and rad); 0 where all are.
        at: that point, m.
    """

    index: int
    p: list[float]
    score: float
    violation: float
    evaluations: int
    missed: float
    at: list[float]


@dataclass(frozen=True, eq=False)
class Check:
    """The result at points that the optimiser did not see.

    Attributes:
        points: number of points.
        reached: how many are reached from home without a change of the assembly mode.
        within_limits: at how many the joints are within their limits.
        sigma: (least, greatest) singular value, dimensionless by the characteristic length of the mechanism as given.
        condition: largest condition number.
        values: of the objectives.
    """

    points: int
    reached: int
    within_limits: int
    sigma: tuple[float, float]
    condition: float
    values: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Synthesis:
    """The result of a synthesis.

    Attributes:
        task: as given.
        parameters: free ones of the file.
        p: (parameters,) best values, m and rad.
        before: values of the objectives with the file's parameters; NaN where they do not do the task.
        values: of the objectives, at the points of the optimiser.
        check: at other points.
        starts: all of them.
        front: (values, p) of a Pareto front; empty for one objective.
        bound: names of parameters at one of their bounds.
    """

    task: Task
    parameters: Parameters
    p: Array
    before: tuple[float, ...]
    values: tuple[float, ...]
    check: Check
    starts: tuple[Start, ...]
    front: tuple[tuple[tuple[float, ...], Array], ...]
    bound: tuple[str, ...]

    @property
    def raff(self) -> str:
        """The RAFF file with these values."""
        return self.parameters.with_values(self.p)

    @property
    def evaluations(self) -> int:
        """Designs that were evaluated."""
        return sum(start.evaluations for start in self.starts)

    @property
    def holds(self) -> bool:
        """True where all constraints hold at the points of the check, singular values to a thousandth."""
        check, (low, high) = self.check, self.task.singular_values
        limited = not self.task.joint_limits or check.within_limits == check.points
        within = low * (1.0 - _SLIGHT) <= check.sigma[0] and check.sigma[1] <= high * (1.0 + _SLIGHT)
        return check.reached == check.points and limited and within

    @property
    def text(self) -> str:
        """The result as people read it."""
        names = self.parameters.names
        lines = [f"{self.parameters.robot.name}: {len(self.starts)} starts, {self.evaluations} designs evaluated"]
        for objective, old, new in zip(self.task.objectives, self.before, self.values, strict=True):
            was = "the task is not done" if np.isnan(old) else f"{old:.6g}"
            lines.append(f"  {objective.text}: {new:.6g}{' m' * (objective.quantity == 'size')} (before: {was})")
        for name, old, new in zip(names, self.parameters.values, self.p, strict=True):
            at = " (at its bound)" if name in self.bound else ""
            lines.append(f"  {name:<12} {self.parameters.text(name, old)} -> {self.parameters.text(name, new, 7)}{at}")
        check = self.check
        lines.append(
            f"  checked at {check.points} other points: {check.reached} reached without a change of the assembly mode, "
            f"{check.within_limits} within joint limits"
        )
        lines.append(
            f"  singular values there {check.sigma[0]:.4g} to {check.sigma[1]:.4g}, condition number at most "
            f"{check.condition:.4g}"
        )
        if not self.holds:
            lines.append("  not all constraints hold at these points: the result does not do the whole task")
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return the result for JSON: m and rad; null for what is infinite, and where the file's own values do not do
        the task."""
        check = self.check
        return {
            "robot": self.parameters.robot.name,
            "parameters": dict(zip(self.parameters.names, self.p.tolist(), strict=True)),
            "before": dict(zip(self.parameters.names, self.parameters.values.tolist(), strict=True)),
            "objectives": [
                {"objective": one.text, "value": _finite(new), "before": _finite(old)}
                for one, new, old in zip(self.task.objectives, self.values, self.before, strict=True)
            ],
            "check": {
                "points": check.points,
                "reached": check.reached,
                "within_limits": check.within_limits,
                "singular_values": [_finite(x) for x in check.sigma],
                "condition": _finite(check.condition),
                "objectives": [_finite(x) for x in check.values],
                "holds": self.holds,
            },
            "evaluations": self.evaluations,
            "starts": [start.__dict__ for start in self.starts],
            "front": [{"values": list(values), "parameters": p.tolist()} for values, p in self.front],
            "at_bound": list(self.bound),
        }


def synthesize(
    source: str | Path | Document,
    task: Task | Precision | Mapping[str, Any] | str | Path,
    robot: str | None = None,
    state: Path | None = None,
    report: Callable[[str, int, int], object] = lambda text, done, total: None,
) -> Synthesis | LinkageSynthesis:
    """Return the values of parameters with which a mechanism does a task best, or meets precision points.

    Args:
        source: as for `cinegen.design.Parameters`.
        task: a TOML file, its keys and values, or a task.
        robot: name of one robot of a file that holds several.
        state: file with the finished starts: written after each, and read if it is of the same task.
        report: called with what is done, and how many starts of how many.

    Raises:
        DesignError: the task does not fit the mechanism; a parameter has no effect; the task can't be done.
    """
    if not isinstance(task, Task | Precision):
        task = task_of(task) if isinstance(task, Mapping) else load_task(task)
    if isinstance(task, Precision):
        return PrecisionProblem(source, task, robot).solved(report)
    problem = SynthesisProblem(source, task, robot)
    return problem.solved(state, report)


class SynthesisProblem:
    """A task for a mechanism.

    Args:
        source: as for `cinegen.design.Parameters`.
        task: what is wanted.
        robot: name of one robot of a file that holds several.

    Attributes:
        task: as given.
        parameters: the free ones.
        scoring: of its designs.
        points: (count, axes) where the optimiser looks, m.
        evaluations: designs that were evaluated.

    Raises:
        DesignError: the task does not fit the mechanism; a parameter has no effect.
    """

    def __init__(self, source: str | Path | Document, task: Task, robot: str | None = None) -> None:
        self.task = task
        common = {"ties": task.ties, "robot": robot}
        self.parameters = Parameters(source, list(task.parameters), bounds=task.parameters, **common)  # type: ignore[arg-type]
        self._check_parameters()
        actuated = self.parameters.mechanism.actuated
        own = [self.parameters.own_variable(name).name for name in actuated]
        further = Parameters(self.parameters.document, [*task.parameters, *own], **common)  # type: ignore[arg-type]
        self.reaching = Reaching(self.parameters, further, task.reach, task.node)
        self._check_effects()
        self.scoring = Scoring(task, self.reaching)
        self.low, self.high = self.parameters.bounds.T
        self.points = task.reach.grid(3)
        self.evaluations = 0
        self._known: Reached | None = None
        self._cache: tuple[bytes, Scores] | None = None

    def _check_parameters(self) -> None:
        parameters = self.parameters
        for name in parameters.names:
            joint = parameters.all[parameters.find(name)].joint
            if joint:
                raise DesignError(f"{name} is the variable of {joint}, which moves: the task can't choose it")
        loose = [name for name, b in zip(parameters.names, parameters.bounds, strict=True) if not np.isfinite(b).all()]
        if loose:
            raise DesignError(f"{', '.join(loose)}: without bounds: give them in [parameters], as low..high")

    def _check_effects(self) -> None:
        mechanism, parameters = self.parameters.mechanism, self.parameters
        here = self.reaching.every.evaluate(q=np.array([mechanism.q_home, *mechanism.random_closed(5)]))
        opening = [name for name in here.opening if name in parameters.names]
        if opening:
            raise DesignError(
                f"{', '.join(opening)}: a change opens the loops of {mechanism.name}, which can't be assembled then: "
                "leave it out, or tie it to the parameters that must change with it"
            )
        none = self.reaching.design.without_effect([self.reaching.node])
        sized = {i for one in self.task.objectives if one.of for i in parameters.matching(one.of)}
        idle = [name for name in parameters.names if name in none and parameters.find(name) not in sized]
        if idle:
            raise DesignError(
                f"{', '.join(idle)}: without any effect on {self.reaching.node} and the loops: leave it out"
            )

    # --- designs -------------------------------------------------------------------------------------------------

    def begin(self, p: Array) -> None:
        """Continue from the file's values to others at all points."""
        self._known = self.reaching.from_home(p, self.points)
        self._cache = None

    def at(self, p: ArrayLike) -> Scores:
        """Return the scores of a design at the points of the optimiser, continued from the last that reached them."""
        values = np.asarray(p, dtype=float)
        key = values.tobytes()
        if self._cache is None or self._cache[0] != key:
            if self._known is None:
                self.begin(values)
            assert self._known is not None
            reached = self.reaching.continued(self._known, values, self.points)
            self.evaluations += 1
            if reached.is_reached.all() or not self._known.is_reached.all():
                self._known = reached
            self._cache = key, self.scoring.at(reached)
        return self._cache[1]

    def value(self, objective: DesignObjective, scores: Scores) -> float:
        """Return the score of an objective; larger is better."""
        found, _ = self.scoring.points(objective, scores)
        return float(found.mean() if objective.over == "mean" else found.min())

    def violation(self, scores: Scores) -> float:
        """Return the largest violation of a constraint, dimensionless."""
        return float(max(0.0, -self.scoring.constraints(scores)[0].min(initial=0.0)))

    # --- optimisation --------------------------------------------------------------------------------------------

    def optimised(
        self, p: Array, objective: DesignObjective, others: tuple[tuple[DesignObjective, float], ...] = ()
    ) -> Array:
        """Return the best values near others at all points of a grid: points are added until none is worse.

        Args:
            p: (parameters,) where to begin.
            objective: what is optimised.
            others: further objectives, each with the least score that is allowed.
        """
        self.begin(p)
        if self.violation(self.at(p)) > _FEASIBLE:
            p = self._program(p, None, others)
            if not self.at(p).reached.is_reached.all():
                return p  # what comes nearest
        for _ in range(_ROUNDS):
            p = self._program(p, objective, others)
            if not self._exchange(p, objective):
                break
        return p

    def _program(
        self, p: Array, objective: DesignObjective | None, others: tuple[tuple[DesignObjective, float], ...]
    ) -> Array:
        """Return the solution of the program at the present points; without an objective, the least violation."""
        from scipy.optimize import minimize

        size, n = self.high - self.low, len(p)
        scoring = self.scoring
        worst = objective is None or objective.over == "worst"

        def split(x: Array) -> tuple[Scores, float]:
            return self.at(np.clip(self.low + x[:n] * size, self.low, self.high)), float(x[-1]) if worst else 0.0

        def goal(x: Array) -> tuple[float, Array]:
            if worst:
                return -float(x[-1]), np.append(np.zeros(n), -1.0)
            assert objective is not None
            values, slopes = scoring.points(objective, split(x)[0])
            return -float(values.mean()), -slopes.mean(0) * size

        def bounds_of(x: Array) -> tuple[Array, Array]:
            scores, t = split(x)
            values, slopes = scoring.constraints(scores)
            by_t = np.zeros(len(values))
            for other, least in others:
                found, by_p = scoring.points(other, scores)
                if other.over == "mean":
                    found, by_p = found.mean(keepdims=True), by_p.mean(0, keepdims=True)
                values, slopes = np.append(values, found - least), np.vstack([slopes, by_p])
                by_t = np.append(by_t, np.zeros(len(found)))
            if objective is None:
                values, by_t = values - t, by_t - 1.0
            elif worst:
                found, by_p = scoring.points(objective, scores)
                values, slopes = np.append(values, found - t), np.vstack([slopes, by_p])
                by_t = np.append(by_t, -np.ones(len(found)))
            slopes = slopes * size
            return values, np.hstack([slopes, by_t[:, None]]) if worst else slopes

        start = (p - self.low) / size
        limits: list[tuple[float | None, float | None]] = [(0.0, 1.0)] * n
        if worst:
            scores = self.at(p)
            t = self.value(objective, scores) if objective else -self.violation(scores)
            start, limits = np.append(start, t), [*limits, (None, None if objective else 1e-3)]
        found = minimize(
            lambda x: goal(x)[0], start, jac=lambda x: goal(x)[1], method="SLSQP", bounds=limits,
            constraints={"type": "ineq", "fun": lambda x: bounds_of(x)[0], "jac": lambda x: bounds_of(x)[1]},
            options={"maxiter": 100, "ftol": 1e-12},
        )  # fmt: skip
        return np.asarray(np.clip(self.low + found.x[:n] * size, self.low, self.high))

    def _exchange(self, p: Array, objective: DesignObjective) -> bool:
        """Add the points of a finer grid where an objective or a constraint is worse; return whether there are any."""
        if len(self.task.reach.points):
            return False
        grid = self.task.reach.grid({0: 1, 1: 41, 2: 17}.get(self.task.reach.varying, 9))
        present = self.at(p)
        fine = self.scoring.at(self._from_nearest(present.reached, p, grid))
        low, high = self.task.singular_values
        bars = [(fine.sigma[:, 0], low), (fine.sigma[:, 1], 1.0 / high), *((one, 0.0) for one in fine.margins.T)]
        if objective.over == "worst" and objective.quantity != "size":
            bars.append((self.scoring.points(objective, fine)[0], self.value(objective, present)))
        added: set[int] = set()
        for values, bar in bars:
            order = np.argsort(values)[:_ADDED]
            added.update(int(i) for i in order[values[order] < bar - _WORSE])
        new_points = [grid[i] for i in sorted(added) if (np.abs(self.points - grid[i]).max(1) > 1e-12).all()]
        if not new_points:
            return False
        self.points = np.vstack([self.points, new_points])
        known = self._from_nearest(present.reached, p, self.points)
        self._known, self._cache = known, None
        return True

    def _from_nearest(self, known: Reached, p: Array, targets: Array) -> Reached:
        nearest = np.argmin(np.linalg.norm(targets[:, None] - known.targets[None], axis=2), axis=1)
        start = replace(
            known, targets=known.targets[nearest], q=known.q[nearest], error=known.error[nearest],
            distance=known.distance[nearest],
        )  # fmt: skip
        return self.reaching.continued(start, p, targets)

    # --- all starts ----------------------------------------------------------------------------------------------

    def solved(self, state: Path | None, report: Callable[[str, int, int], object]) -> Synthesis:
        """Return the best of all starts, checked; see `synthesize`."""
        first = self.task.objectives[0]
        finished = self._read(state)
        for index, p in enumerate(self.starts()):
            if index < len(finished):
                continue
            report(f"start {index + 1}", index, self.task.starts)
            self.points, self.evaluations = self.task.reach.grid(3), 0
            finished.append(self._start(index, p, first))
            self._write(state, finished)
        good = [one for one in finished if one.violation <= _FEASIBLE]
        if not good:
            if state is not None:
                state.unlink(missing_ok=True)  # there is nothing to continue
            raise DesignError(self._impossible(finished))
        best = max(good, key=lambda one: one.score)
        front = self._front(best, report) if len(self.task.objectives) == 2 else ()
        p = np.array(best.p) if not front else _knee(front, self.task.objectives)
        self.points = self.task.reach.grid(3)
        self.begin(p)
        scores = self.at(p)
        values = tuple(self.scoring.shown(one, self.value(one, scores)) for one in self.task.objectives)
        width = self.high - self.low
        bound = tuple(
            name
            for name, x, w, a, b in zip(self.parameters.names, p, width, self.low, self.high, strict=True)
            if min(x - a, b - x) < 1e-6 * w
        )
        return Synthesis(
            self.task, self.parameters, p, self._before(), values, self.checked(p), tuple(finished), front, bound
        )

    def starts(self) -> Array:
        """Return the values (starts, parameters) where the starts begin: the file's, then a Sobol sequence."""
        from scipy.stats import qmc

        count = self.task.starts
        power = int(np.ceil(np.log2(max(count, 2))))
        others = qmc.Sobol(len(self.low), seed=0).random_base2(power)[: count - 1]
        return np.vstack([self.parameters.values, self.low + others * (self.high - self.low)])

    def _start(self, index: int, p: Array, objective: DesignObjective) -> Start:
        try:
            p = self.optimised(p, objective)
        except (CinegenError, np.linalg.LinAlgError):  # a start among impossible designs
            return Start(index, p.tolist(), -1e300, 1e300, self.evaluations, 0.0, [])
        scores = self.at(p)
        reached = scores.reached
        worst = int(np.argmax(reached.distance))
        missed = 0.0 if reached.is_reached[worst] else float(np.linalg.norm(reached.error[worst]))
        return Start(
            index, p.tolist(), self.value(objective, scores), self.violation(scores), self.evaluations, missed,
            reached.targets[worst].tolist(),
        )  # fmt: skip

    def _impossible(self, finished: list[Start]) -> str:
        name, axes = self.parameters.robot.name, self.task.reach.axes
        nearest = min(finished, key=lambda one: one.violation)
        if nearest.missed > 0.0:
            at = ", ".join(f"{axis} {1e3 * x:.6g} mm" for axis, x in zip(axes, nearest.at, strict=True))
            return (
                f"{name}: the task can't be reached from any of {len(finished)} starts: with the dimensions that come "
                f"nearest, {at} is still {1e3 * nearest.missed:.3g} mm away: widen the bounds of the "
                "parameters, or make the region smaller"
            )
        return (
            f"{name}: no values of the parameters were found from {len(finished)} starts that keep all constraints: "
            f"the best violate one by {nearest.violation:.3g} (dimensionless): widen the bounds, loosen a constraint, "
            "or give more starts"
        )

    def _before(self) -> tuple[float, ...]:
        p = self.parameters.values
        self.begin(p)
        scores = self.at(p)
        if not scores.reached.is_reached.all():
            return (float("nan"),) * len(self.task.objectives)
        return tuple(self.scoring.shown(one, self.value(one, scores)) for one in self.task.objectives)

    def checked(self, p: Array) -> Check:
        """Return the result at points that the optimiser did not see, on the mechanism of the file that is written."""
        from scipy.stats import qmc

        reach = self.task.reach
        if len(reach.points):
            targets = reach.points
        else:
            unit = qmc.Sobol(len(reach.axes), seed=1).random(_UNSEEN)
            targets = reach.low + unit * (reach.high - reach.low)
        written = SynthesisProblem(
            self.parameters.document_with(p), replace(self.task, parameters=self._around(p)), self.parameters.robot.name
        )
        reaching = written.reaching
        reaching.length = self.reaching.length
        scores = written.scoring.at(reaching.from_home(written.parameters.values, targets))
        good = scores.reached.is_reached & (scores.sigma[:, 0] > 0.0)
        values = tuple(
            self.scoring.shown(one, self.value(one, scores)) if one.quantity != "size" else
            self.scoring.size(p, one.of)[0] for one in self.task.objectives
        )  # fmt: skip
        sigma, inverse, condition = scores.sigma.min(0)
        return Check(
            len(targets),
            int(good.sum()),
            int((scores.margins >= -_FEASIBLE).all(axis=1).sum()),
            (float(sigma), float(1.0 / inverse) if inverse > 0.0 else float("inf")),
            float(1.0 / condition) if condition > 0.0 else float("inf"),
            values,
        )

    def _around(self, p: Array) -> dict[str, tuple[float, float] | str]:
        """Return bounds that hold the values of the written file."""
        return {name: (float(x) - 1e-3, float(x) + 1e-3) for name, x in zip(self.parameters.names, p, strict=True)}

    def _front(
        self, best: Start, report: Callable[[str, int, int], object]
    ) -> tuple[tuple[tuple[float, ...], Array], ...]:
        """Return a Pareto front: the first objective, with the second at least as good as steps between both ends."""
        one, two = self.task.objectives
        found: list[tuple[float, float, Array]] = []

        def keep(p: Array) -> Array:
            scores = self.at(p)
            if self.violation(scores) <= _FEASIBLE:
                found.append((self.value(one, scores), self.value(two, scores), p))
            return p

        self.points = self.task.reach.grid(3)
        first = keep(self.optimised(np.array(best.p), one))
        last = keep(self.optimised(first, two))
        if len(found) < 2:
            return ()
        p, total = first, self.task.front
        for k, least in enumerate(np.linspace(found[0][1], found[1][1], total)[1:-1], 1):
            report("Pareto front", k, total)
            p = keep(self.optimised(p if k > 1 else last, one, ((two, float(least)),)))
        kept = [a for a in found if not any(b[0] >= a[0] and b[1] >= a[1] and b[:2] != a[:2] for b in found)]
        kept.sort(key=lambda each: each[0])
        return tuple(((self.scoring.shown(one, a), self.scoring.shown(two, b)), p) for a, b, p in kept)

    # --- state ---------------------------------------------------------------------------------------------------

    @property
    def _fingerprint(self) -> str:
        task = json.dumps(self.task.written, sort_keys=True, default=str) + repr(replace(self.task, written={}))
        return hashlib.sha256((task + self.parameters.with_values(self.parameters.values)).encode()).hexdigest()

    def _read(self, state: Path | None) -> list[Start]:
        if state is None or not state.is_file():
            return []
        try:
            values = json.loads(state.read_text(encoding="utf-8"))
            if values["task"] == self._fingerprint:
                return [Start(**one) for one in values["starts"]]
        except (OSError, ValueError, KeyError, TypeError):
            raise DesignError(f"{state}: is no state of a synthesis: remove it, or name another") from None
        raise DesignError(f"{state}: belongs to another task or robot: remove it, or name another")

    def _write(self, state: Path | None, starts: list[Start]) -> None:
        if state is not None:
            content = {"task": self._fingerprint, "starts": [one.__dict__ for one in starts]}
            write_all({state: json.dumps(content).encode()})


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _knee(front: tuple[tuple[tuple[float, ...], Array], ...], objectives: tuple[DesignObjective, ...]) -> Array:
    """Return the values of the point of a front that is nearest to the best of both objectives, each divided by its
    range."""
    signs = [1.0 if one.is_maximised else -1.0 for one in objectives]
    values = np.array([values for values, _ in front]) * signs
    span = np.ptp(values, axis=0)
    lack = (values.max(0) - values) / np.where(span > 0.0, span, 1.0)
    return front[int(np.argmin(np.linalg.norm(lack, axis=1)))][1]
