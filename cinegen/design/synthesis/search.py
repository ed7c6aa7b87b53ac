"""`synthesize`: local optimisations from many starts, in several processes if there are any, kept in a state file."""

from __future__ import annotations

import hashlib
import json
import pickle
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from cinegen.arrays import Array
from cinegen.cluster import check_workers, connected, each, processes
from cinegen.design.errors import DesignError
from cinegen.design.synthesis.front import front_of, knee
from cinegen.design.synthesis.linkage_result import LinkageSynthesis
from cinegen.design.synthesis.linkages import PrecisionProblem
from cinegen.design.synthesis.problem import Goal, SynthesisProblem
from cinegen.design.synthesis.result import Check, FrontPoint, Start, Synthesis
from cinegen.design.synthesis.task import Precision, SynthesisTask
from cinegen.design.synthesis.task_file import load_task, task_of
from cinegen.errors import CinegenError
from cinegen.proof import Proof, prove
from raff2urdf import Document
from raff2urdf.errors import counted
from raff2urdf.files import write_all

Report = Callable[[str, int, int], object]

_UNSEEN = 512  # targets of the check
_AROUND = 1e-3  # bounds around the values of the written file, m and rad


def synthesize(
    source: str | Path | Document,
    task: SynthesisTask | Precision | Mapping[str, Any] | str | Path,
    robot: str | None = None,
    state: Path | None = None,
    report: Report = lambda text, done, total: None,
    workers: int | None = 1,
    scheduler: str | None = None,
) -> Synthesis | LinkageSynthesis:
    """Return the values of parameters with which a mechanism does a task best, or meets precision points.

    Args:
        source: as for `cinegen.design.Parameters`.
        task: a TOML file, its keys and values, or a task.
        robot: name of one robot of a file that holds several.
        state: file with what is finished: written after each start, and read if it is of the same task.
        report: called with what is done, and how many starts of how many.
        workers: processes on this machine that share the starts; None for one for each core.
        scheduler: address of a Dask scheduler whose workers share them instead.

    Raises:
        DesignError: the task does not fit the mechanism; a parameter has no effect; the task can't be done.
        ClusterError: workers can't be started.
        MissingExtraError: a package of an extra is needed.
    """
    check_workers(workers, scheduler)
    if not isinstance(task, SynthesisTask | Precision):
        task = task_of(task) if isinstance(task, Mapping) else load_task(task)
    if isinstance(task, Precision):
        return PrecisionProblem(source, task, robot).solved(report)
    problem = SynthesisProblem(source, task, robot)
    problem.check_effects()
    return _Search(problem, state, report, workers, scheduler).result()


class _Search:
    """All optimisations of one problem."""

    def __init__(
        self, problem: SynthesisProblem, state: Path | None, report: Report, workers: int | None, scheduler: str | None
    ) -> None:
        self.problem, self.task, self.report = problem, problem.task, report
        self._state = _State(state, problem)
        self._workers, self._scheduler = workers, scheduler

    def result(self) -> Synthesis:
        problem, task = self.problem, self.task
        starts = self._starts()
        good = sorted((each for each in starts if each.is_feasible), key=lambda each: -each.score)
        if not good:
            self._state.remove()  # there is nothing to continue
            raise DesignError(_impossible(problem, starts))
        x, front = np.array(good[0].x), tuple[FrontPoint, ...]()
        problem.evaluations = problem.configurations = 0
        if len(task.objectives) > 1:
            points = self._front([np.array(each.x) for each in good])
            x, front = points[0], tuple(self._front_point(each) for each in points)
            # the one that is written does the task, if any of them does
            allowed = [k for k, each in enumerate(front) if each.check.holds] or list(range(len(front)))
            k = allowed[knee(np.array([self._scores(points[i]) for i in allowed]))]
            x = points[k]
        evaluations = problem.evaluations + sum(each.evaluations for each in starts)
        configurations = problem.configurations + sum(each.configurations for each in starts)
        p, scale = problem.split(x)
        width = problem.high - problem.low
        bound = tuple(
            name
            for name, value, w, a, b in zip(problem.names, x, width, problem.low, problem.high, strict=True)
            if min(value - a, b - value) < 1e-6 * w
        )
        return Synthesis(
            problem, p, scale, self._before(), self._values(x), checked(problem, x), proved(problem, x), tuple(starts),
            front, bound, evaluations, configurations,
        )  # fmt: skip

    # --- starts ----------------------------------------------------------------------------------------------------

    def _starts(self) -> list[Start]:
        """Return the results of all starts; those of the state are not repeated."""
        problem, state = self.problem, self._state
        if not state.origins:
            state.origins = [origin.tolist() for origin in self._origins()]
            state.write()
        todo = [k for k in range(len(state.origins)) if k not in state.starts]
        finished = len(state.starts)
        source, robot = problem.parameters.document, problem.parameters.robot.name
        count = processes(self._workers, self._scheduler, len(todo)) if todo else 1
        several = self._scheduler is not None or count > 1
        if todo:
            self.report(f"start {finished + 1}", finished, len(state.origins))
        with connected(self._scheduler, count) if several else nullcontext() as client:
            tasks = [(k, state.origins[k]) for k in todo]
            shared = (pickle.dumps((source, self.task, robot)) if client else problem,)
            for (k, _), future in each(client, _solved, tasks, *shared):
                state.starts[k] = future.result()
                state.write()
                finished += 1
                if finished < len(state.origins):
                    self.report(f"start {finished + 1}", finished, len(state.origins))
        return [state.starts[k] for k in sorted(state.starts)]

    def _origins(self) -> list[Array]:
        """Return where the starts begin: at the file's values, then at a Sobol sequence."""
        problem, count = self.problem, self.task.starts
        from scipy.stats import qmc

        power = int(np.ceil(np.log2(max(count, 2))))
        others = qmc.Sobol(len(problem.parameters), seed=0).random_base2(power)[: count - 1]
        n = len(problem.parameters)
        origins = np.tile(problem.written, (len(others), 1))
        origins[:, :n] = problem.low[:n] + others * (problem.high - problem.low)[:n]
        return [problem.written, *origins]

    # --- what was found --------------------------------------------------------------------------------------------

    def _front(self, good: list[Array]) -> list[Array]:
        state = self._state

        def keep(designs: list[list[float]]) -> None:
            state.front = designs
            state.write()

        problem = self.problem
        problem.restart()
        problem.begin(problem.written)
        if problem.violation(problem.at(problem.written)) <= 0.0:
            good = [*good, problem.written]
        return front_of(problem, good, list(state.front), keep, self.report)

    def _front_point(self, x: Array) -> FrontPoint:
        p, scale = self.problem.split(x)
        return FrontPoint(self._values(x), p, scale, checked(self.problem, x))

    def _scores(self, x: Array) -> list[float]:
        problem = self.problem
        problem.begin(x)
        scores = problem.at(x)
        return [problem.value(objective, scores) for objective in self.task.objectives]

    def _values(self, x: Array) -> tuple[float, ...]:
        """Return the values of the objectives at the targets of the finest grid."""
        problem = self.problem
        problem.restart()
        if not len(problem.reach.given):
            problem.points = np.vstack([problem.points, *problem.grids])
        problem.begin(x)
        scores = problem.at(x)
        values = tuple(
            problem.scoring.shown(objective, problem.value(objective, scores)) for objective in self.task.objectives
        )
        problem.restart()
        return values

    def _before(self) -> tuple[float, ...]:
        """Return the values of the objectives with the file's parameters, where these do the task; the region as large
        as they let it."""
        problem, x = self.problem, self.problem.written
        problem.restart()
        if self.task.grows:
            n, bounds = len(problem.parameters), (problem.low.copy(), problem.high.copy())
            problem.low[:n] = problem.high[:n] = x[:n]
            goals = [Goal(objective) for objective in self.task.objectives if objective.quantity == "region"]
            try:
                x = problem.optimised(x, goals)
            finally:
                problem.low, problem.high = bounds
        problem.begin(x)
        scores = problem.at(x)
        good = scores.reached.is_reached.all() and (scores.sigma.values > 0.0).all()
        return self._values(x) if good else (float("nan"),) * len(self.task.objectives)


def _solved(problem: SynthesisProblem | bytes, start: tuple[int, list[float]]) -> Start:
    """Return the result of a start; in another process, of a problem whose arguments were pickled."""
    loaded = _problem_of(problem) if isinstance(problem, bytes) else problem
    return _solved_start(loaded, start[0], np.array(start[1]))


@lru_cache(maxsize=1)
def _problem_of(pickled: bytes) -> SynthesisProblem:
    return SynthesisProblem(*pickle.loads(pickled))


def _solved_start(problem: SynthesisProblem, index: int, x: Array) -> Start:
    problem.restart()
    problem.evaluations = problem.configurations = 0
    first = problem.task.objectives[0]
    try:
        x = problem.optimised(x, [Goal(first)])
        scores = problem.at(x)
        reached = scores.reached
        worst = int(np.argmax(reached.distance))
        missed = 0.0 if reached.is_reached[worst] else float(np.linalg.norm(reached.error[worst]))
        outcome = problem.value(first, scores), problem.violation(scores), problem.violated(scores)
    except (CinegenError, np.linalg.LinAlgError) as error:
        return Start(
            index, x.tolist(), -1e300, 1e300, "", problem.evaluations, problem.configurations, [], 0.0, [], str(error)
        )
    return Start(
        index,
        x.tolist(),
        *outcome,
        problem.evaluations,
        problem.configurations,
        problem.points.tolist(),
        missed,
        reached.targets[worst].tolist(),
    )


def _impossible(problem: SynthesisProblem, finished: list[Start]) -> str:
    name, axes = problem.parameters.robot.name, problem.task.reach.axes
    nearest = min(finished, key=lambda start: start.violation)
    if nearest.error:
        return f"{name}: all of {len(finished)} starts failed: {nearest.error}"
    if nearest.missed > 0.0 and nearest.violated == "singular_values":  # lost targets count there
        at = ", ".join(f"{axis} {1e3 * x:.6g} mm" for axis, x in zip(axes, nearest.at, strict=False))
        return (
            f"{name}: the task can't be reached from any of {len(finished)} starts: with the dimensions that come "
            f"nearest, {at} is still {1e3 * nearest.missed:.3g} mm away: widen the bounds of the "
            "parameters, or make the region smaller"
        )
    return (
        f"{name}: no values of the parameters were found from {counted(len(finished), 'start')} that keep all "
        f"constraints: the best violate {nearest.violated} by {nearest.violation:.3g} (dimensionless): widen the "
        "bounds, loosen a constraint, or give more starts"
    )


def checked(problem: SynthesisProblem, x: Array) -> Check:
    """Return a design at targets that the optimiser did not see, on the mechanism of the file that is written."""
    p, scale = problem.split(x)
    around: dict[str, tuple[float, float] | str] = {
        name: (float(value) - _AROUND, float(value) + _AROUND)
        for name, value in zip(problem.parameters.names, p, strict=True)
    }
    document = problem.document_with(p)
    written = SynthesisProblem(document, replace(problem.task, parameters=around), problem.parameters.robot.name)
    written.reaching.length = problem.reaching.length
    written.scoring.take_references(problem.scoring)
    targets = problem.reach.samples(_UNSEEN, seed=1)
    scores = written.scores_from_home(written.parameters.values, targets, scale)
    sigma, inverse, condition = scores.sigma.values.min(axis=0)
    constraints = written.scoring.constraints(scores)
    margins = {name: float(rows.values.min()) for name, rows in constraints.items() if rows.values.size}
    low, high = problem.task.singular_values
    margins["singular_values"] = float(min(sigma / low, inverse * high)) - 1.0
    good = scores.reached.is_reached & (scores.sigma.values[:, 0] > 0.0)
    return Check(
        len(targets),
        int(good.sum()),
        int((scores.margins.values >= -1e-6).all(axis=1).sum()),
        (float(sigma), float(1.0 / inverse) if inverse > 0.0 else float("inf")),
        float(1.0 / condition) if condition > 0.0 else float("inf"),
        tuple(
            written.scoring.shown(objective, written.value(objective, scores)) for objective in problem.task.objectives
        ),
        margins,
    )


def proved(problem: SynthesisProblem, x: Array) -> Proof | None:
    """Return the proof of the region with a design, on the mechanism of the file that is written; None if it is not
    wanted."""
    task, (p, scale) = problem.task, problem.split(x)
    if not task.proved:
        return None
    mechanism, reach = problem.parameters.mechanism_with(p), task.reach
    middle, half = 0.5 * (reach.low + reach.high), 0.5 * scale * (reach.high - reach.low)
    varies = half > 0.0
    names = np.array(reach.axes)
    over = dict(zip(names[varies], np.stack([middle - half, middle + half], axis=1)[varies].tolist(), strict=True))
    at = dict(zip(names[~varies], middle[~varies].tolist(), strict=True))
    shape = "ball" if reach.radius else "box"
    return prove(mechanism, over, at, task.node or None, limits=task.joint_limits, shape=shape)


class _State:
    """The finished work in a file, so that the same command continues.

    Attributes:
        origins: where each start begins.
        starts: results by the index of their start.
        front: finished designs of the front.
    """

    def __init__(self, path: Path | None, problem: SynthesisProblem) -> None:
        self._path = path
        self.origins: list[list[float]] = []
        self.starts: dict[int, Start] = {}
        self.front: list[list[float]] = []
        task = problem.task
        text = json.dumps(task.written, sort_keys=True, default=str) + repr(replace(task, written={}))
        text += problem.parameters.with_values(problem.parameters.values)
        self._fingerprint = hashlib.sha256(text.encode()).hexdigest()
        if path is not None and path.is_file():
            self._read(path)

    def _read(self, path: Path) -> None:
        try:
            values = json.loads(path.read_text(encoding="utf-8"))
            if values["task"] == self._fingerprint:
                self.origins, self.front = values["origins"], values["front"]
                self.starts = {start["index"]: Start(**start) for start in values["starts"]}
                return
        except (OSError, ValueError, KeyError, TypeError):
            raise DesignError(f"{path}: is no state of a synthesis: remove it, or name another") from None
        raise DesignError(f"{path}: belongs to another task or robot: remove it, or name another")

    def write(self) -> None:
        if self._path is not None:
            starts = [asdict(self.starts[k]) for k in sorted(self.starts)]
            content = {"task": self._fingerprint, "origins": self.origins, "starts": starts, "front": self.front}
            write_all({self._path: json.dumps(content).encode()})

    def remove(self) -> None:
        if self._path is not None:
            self._path.unlink(missing_ok=True)
