"""Results of a synthesis: starts, the check at other targets, and what people and programs read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cinegen.arrays import Array
from cinegen.design.parameters import Parameters
from cinegen.design.rewriting import rewritten
from cinegen.design.synthesis.designs import FEASIBLE
from cinegen.design.synthesis.problem import SynthesisProblem
from cinegen.design.synthesis.task import DesignObjective, SynthesisTask
from cinegen.proof import Proof
from cinegen.typed_json import as_json
from raff2urdf.errors import counted
from raff2urdf.quantities import NUMBER, shown

_SLIGHT = 1e-3  # by what part constraints may be violated between the targets of the optimiser
_FAILED = 3  # starts whose reasons are listed


@dataclass(frozen=True)
class Start:
    """The result of one start.

    Attributes:
        index: 0 for the file's values.
        x: (variables,) values of the parameters, m and rad, and of `region`, if it is a variable.
        score: of the first objective; larger is better.
        violation: largest violation of a constraint, dimensionless; 0 where all hold.
        violated: the constraint that is violated most; "" where all hold.
        evaluations: designs that were evaluated, each at all targets of the optimiser.
        configurations: that were found.
        targets: (n, rows) at which it ended, of the region as given.
        missed: distance of the furthest target that is not reached, m (and rad); 0 where all are.
        at: that target, m.
        error: why the start ended without a result; "" otherwise.
    """

    index: int
    x: list[float]
    score: float
    violation: float
    violated: str
    evaluations: int
    configurations: int
    targets: list[list[float]]
    missed: float
    at: list[float]
    error: str = ""

    @property
    def is_feasible(self) -> bool:
        """True where all constraints hold at the optimiser's targets."""
        return not self.error and self.violation <= FEASIBLE

    @property
    def text(self) -> str:
        """The end of the start, as people read it."""
        if self.error:
            return self.error
        if self.is_feasible:
            return "all constraints hold"
        if self.missed > 0.0:
            return f"{1e3 * self.missed:.3g} mm from a target"
        return f"{self.violated} is violated by {self.violation:.3g}"


@dataclass(frozen=True, eq=False)
class Check:
    """A design at targets that the optimiser did not see.

    Attributes:
        points: number of targets.
        reached: how many are reached from home without a change of the assembly mode.
        within_limits: at how many the joints are within their limits.
        sigma: (least, greatest) singular value, dimensionless by the characteristic length of the mechanism as given.
        condition: largest condition number.
        values: of the objectives.
        margins: least margin of each constraint, dimensionless; negative where it is violated.
    """

    points: int
    reached: int
    within_limits: int
    sigma: tuple[float, float]
    condition: float
    values: tuple[float, ...]
    margins: Mapping[str, float]

    @property
    def holds(self) -> bool:
        """True where all targets are reached and all constraints hold, to a thousandth."""
        limits = self.margins.get("joint_limits", 0.0) >= -FEASIBLE
        return self.reached == self.points and limits and all(margin >= -_SLIGHT for margin in self.margins.values())

    @property
    def violated(self) -> list[str]:
        """Names of the constraints that do not hold."""
        allowed = {"joint_limits": FEASIBLE}
        return [name for name, least in self.margins.items() if least < -allowed.get(name, _SLIGHT)]


@dataclass(frozen=True, eq=False)
class FrontPoint:
    """A point of a Pareto front: none of the others is as good in all objectives and better in one.

    Attributes:
        values: of the objectives at the optimiser's targets.
        p: (parameters,) m and rad.
        scale: of the region.
        check: at other targets.
    """

    values: tuple[float, ...]
    p: Array
    scale: float
    check: Check


@dataclass(frozen=True, eq=False)
class Synthesis:
    """The result of a synthesis.

    Attributes:
        problem: what was solved.
        p: (parameters,) best values, m and rad.
        scale: of the region; 1 unless that is an objective.
        before: values of the objectives with the file's parameters; NaN where they do not do the task.
        values: of the objectives, at the targets of the optimiser.
        check: at other targets.
        proof: of the region, if the task wants it proved.
        starts: all of them.
        front: of several objectives; empty for one.
        bound: names of variables at one of their bounds.
        evaluations: designs that were evaluated by the optimiser.
        configurations: that were found for it.
    """

    problem: SynthesisProblem
    p: Array
    scale: float
    before: tuple[float, ...]
    values: tuple[float, ...]
    check: Check
    proof: Proof | None
    starts: tuple[Start, ...]
    front: tuple[FrontPoint, ...]
    bound: tuple[str, ...]
    evaluations: int
    configurations: int

    @property
    def task(self) -> SynthesisTask:
        """The task as given."""
        return self.problem.task

    @property
    def parameters(self) -> Parameters:
        """The free parameters of the file."""
        return self.problem.parameters

    @property
    def raff(self) -> str:
        """The RAFF file with these values."""
        parameters = self.parameters
        return rewritten(parameters.document, self.problem.document_with(self.p), parameters.robot.name)

    @property
    def holds(self) -> bool:
        """True where all constraints hold at the targets of the check, and the region is proved if that is wanted."""
        return self.check.holds and (self.proof is None or bool(self.proof))

    def value_text(self, objective: DesignObjective, value: float) -> str:
        """Return the value of an objective as people read it."""
        if math.isnan(value):
            return "the task is not done"
        if objective.quantity == "torque" and self.problem.scoring.dimension("torque") is NUMBER:
            return f"{value:.6g} of the limit"
        dimension = self.problem.scoring.dimension(objective.quantity)
        return f"{value:.6g}" if dimension is NUMBER else shown(value, dimension, 6)

    @property
    def text(self) -> str:
        """The result as people read it."""
        parameters, check = self.parameters, self.check
        lines = [
            f"{parameters.robot.name}: {counted(len(self.starts), 'start')}, {counted(self.evaluations, 'design')} "
            f"evaluated at {self.configurations} configurations"
        ]
        failed = [start for start in self.starts if not start.is_feasible]
        if failed:
            lines.append(f"  {len(failed)} of the starts found no feasible design:")
            lines += [f"    start {start.index + 1}: {start.text}" for start in failed[:_FAILED]]
            lines += [f"    and {len(failed) - _FAILED} more"] * (len(failed) > _FAILED)
        for objective, old, new in zip(self.task.objectives, self.before, self.values, strict=True):
            texts = self.value_text(objective, new), self.value_text(objective, old)
            lines.append(f"  {objective.text}: {texts[0]} (before: {texts[1]})")
        for name, old, new in zip(parameters.names, parameters.values, self.p, strict=True):
            at = " (at its bound)" if name in self.bound else ""
            lines.append(f"  {name:<12} {parameters.text(name, old)} -> {parameters.text(name, new, 7)}{at}")
        lines += self._front_lines
        lines.append(
            f"  checked at {check.points} {'targets' if len(self.task.reach.given) else 'other points'}: "
            f"{check.reached} reached without a change of the assembly mode, {check.within_limits} within joint limits"
        )
        lines.append(
            f"  singular values there {check.sigma[0]:.4g} to {check.sigma[1]:.4g}, condition number at most "
            f"{check.condition:.4g}"
        )
        if self.proof is not None:
            lines.append(f"  {self.proof.message}: {self.proof.region_text}")
            lines += [] if self.proof else ["  the region is not proved: the result does not do the whole task"]
        if not check.holds:
            which = f" ({', '.join(check.violated)})" if check.violated else ""
            lines.append(f"  not all constraints hold at these points{which}: the result does not do the whole task")
        return "\n".join(lines)

    @property
    def _front_lines(self) -> list[str]:
        if not self.front:
            return []
        objectives = self.task.objectives
        rows = [[objective.quantity for objective in objectives] + ["at other points"]]
        for point in self.front:
            texts = list(map(self.value_text, objectives, point.values))
            chosen = " <- written" if np.array_equal(point.p, self.p) else ""
            rows.append([*texts, ("holds" if point.check.holds else "does not hold") + chosen])
        widths = [max(len(row[k]) for row in rows) + 2 for k in range(len(rows[0]))]
        lines = ["    " + "".join(text.ljust(width) for text, width in zip(row, widths, strict=True)) for row in rows]
        return [f"  Pareto front, {counted(len(self.front), 'design')}:", *(line.rstrip() for line in lines)]

    def as_dict(self) -> dict[str, Any]:
        """Return the result for JSON: m and rad; null for what is infinite, and where the file's own values do not do
        the task."""
        names, parameters = self.parameters.names, self.parameters
        return as_json(
            self,
            robot=parameters.robot.name,
            parameters=dict(zip(names, self.p, strict=True)),
            before=dict(zip(names, parameters.values, strict=True)),
            region=self.scale,
            objectives=[
                {"objective": objective.text, "value": new, "before": old}
                for objective, new, old in zip(self.task.objectives, self.values, self.before, strict=True)
            ],
            check=_as_dict(self.check),
            **({} if self.proof is None else {"proof": as_json(self.proof, "proved", "refuted", "undecided", "boxes")}),
            evaluations=self.evaluations,
            configurations=self.configurations,
            starts=[{k: v for k, v in asdict(start).items() if k != "targets"} for start in self.starts],
            front=[
                {
                    "values": point.values,
                    "parameters": dict(zip(names, point.p, strict=True)),
                    "region": point.scale,
                    "check": _as_dict(point.check),
                }
                for point in self.front
            ],
            at_bound=self.bound,
        )


def _as_dict(check: Check) -> dict[str, Any]:
    names = ("points", "reached", "within_limits", "condition", "margins", "holds")
    return as_json(check, *names, singular_values=check.sigma, objectives=check.values)
