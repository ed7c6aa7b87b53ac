"""`synthesis_report`: a synthesis as one HTML file for reading and printing."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np

from cinegen.design.synthesis import LinkageSynthesis, Reach, Start, Synthesis, SynthesisProblem
from cinegen.errors import CinegenError
from cinegen.plotting.synthesis.levels import RegionField, draw_field
from cinegen.plotting.synthesis.linkage import write_linkage
from cinegen.plotting.synthesis.page import ReportPage, drawing
from cinegen.plotting.synthesis.robots import draw_designs
from cinegen.plotting.synthesis.starts import draw_front, draw_parameters
from cinegen.plotting.synthesis.wording import (
    change_text,
    constraint_texts,
    heading_of,
    name_of,
    objective_text,
    reach_text,
    unit_of,
    value_text,
)
from raff2urdf.quantities import LENGTH, shown

_GRID = {0: 1, 1: 101, 2: 31}  # points along each axis of a region, by the axes along which it is wide
_VOLUME = 9
_SAME = 1e-3  # of the ranges of the parameters
_MOST = 50  # starts and points of a front that are listed


def synthesis_report(result: Synthesis | LinkageSynthesis) -> str:
    """Return a report of a synthesis: one HTML file, with pictures inside and nothing to load.

    Args:
        result: of `cinegen.design.synthesize`.

    Raises:
        raff2urdf.RaffError: matplotlib is not installed.
    """
    with drawing():
        if isinstance(result, LinkageSynthesis):
            return write_linkage(result)
        return _Report(result).written()


class _Report:
    def __init__(self, result: Synthesis) -> None:
        self.result, self.task, self.parameters = result, result.task, result.parameters
        self.problem = result.problem
        self.node = result.task.node or result.parameters.mechanism.end
        self.name = result.parameters.robot.name
        goal = " and ".join(objective_text(objective) for objective in result.task.objectives)
        self.page = ReportPage(f"{self.name}: {goal}")

    def written(self) -> str:
        self._summary()
        self._task()
        self._robots()
        self._parameters()
        self._objectives()
        self._fields()
        if self.result.front:
            self._front()
        self._starts()
        self._check()
        if self.task.written:
            self.page.section("The task as it was given")
            encode = json.JSONEncoder(default=str, ensure_ascii=False).encode
            self.page.listing("\n".join(f"{key} = {encode(value)}" for key, value in self.task.written.items()))
        return self.page.text_of_page()

    # --- sections ------------------------------------------------------------------------------------------------

    def _summary(self) -> None:
        result, check = self.result, self.result.check
        source = Path(self.parameters.document.source.name).name
        changes = []
        for objective, old, new in zip(self.task.objectives, result.before, result.values, strict=True):
            was = "" if np.isnan(old) else f", before {self._text(objective.quantity, old)}"
            changes.append(f"{name_of(objective.quantity)} {self._text(objective.quantity, new)}{was}")
        holds = (
            f"All constraints hold at {check.points} {self._unseen}."
            if result.holds
            else f"Not all constraints hold at {check.points} {self._unseen}: the result does not do the whole task."
        )
        self.page.text(f"Dimensions of {self.name} ({source}) with which {self.node} does this task best.")
        self.page.status(f"{'; '.join(changes)}. {holds}", good=result.holds)

    @property
    def _unseen(self) -> str:
        return "points of the task" if len(self.task.reach.given) else "points that the optimiser did not see"

    def _task(self) -> None:
        task, parameters = self.task, self.parameters
        self.page.section("Task")
        pairs = [("reach", f"{self.node} reaches {reach_text(task.reach)}")]
        pairs += [("objective", objective_text(objective)) for objective in task.objectives]
        pairs += [
            ("constraint", text) for text in constraint_texts(task, self.problem.scoring.most, self.result.torque_unit)
        ]
        pairs.append(("parameters", f"{len(parameters)}, see below"))
        pairs += [("tie", tie) for tie in task.ties]
        pairs.append(("starts", str(task.starts)))
        self.page.terms(pairs)
        self.page.text(
            "Singular values are the least and the largest speeds of the node for unit velocities of the actuated "
            f"joints; lengths are divided by {shown(parameters.mechanism.length, LENGTH)}, the characteristic length "
            "of the robot as given. The condition number is their ratio."
        )

    def _robots(self) -> None:
        result, reach = self.result, self.task.reach
        self.page.section("Robot before and after")
        designs, notes = {}, []
        for title, p in (("before", self.parameters.values), ("after", result.p)):
            try:
                designs[title] = self.parameters.mechanism_with(p)
            except CinegenError as error:
                notes.append(f"The robot {title} can't be drawn: {error}.")
        where = "the point nearest to the middle" if len(reach.given) else "the middle of the region"
        if designs:
            targets = self.problem.targets(_density(reach, self.problem))
            caption = f"Node {self.node} in {where}; both robots in one scale."
            self.page.picture(draw_designs(designs, reach, self.node, targets), caption)
        self.page.text(*notes)

    def _parameters(self) -> None:
        result, parameters = self.result, self.parameters
        self.page.section("Parameters")
        notes = [
            f"at its {'lower' if p - low < high - p else 'upper'} bound" if name in result.bound else ""
            for name, p, (low, high) in zip(parameters.names, result.p, parameters.bounds, strict=True)
        ]
        self.page.parameters(parameters, result.p, parameters.names, notes)
        if result.bound:
            self.page.text("A wider range of the parameters that are at a bound may improve the objectives further.")
        good = [self.problem.split(np.array(start.x))[0] for start in result.starts if start.is_feasible]
        if len(result.p):
            self.page.picture(draw_parameters(result, good), "Parameters within their ranges")

    def _objectives(self) -> None:
        result = self.result
        self.page.section("Objectives")
        unseen = "at the points" if len(self.task.reach.given) else f"at {result.check.points} unseen points"
        each = zip(self.task.objectives, result.before, result.values, result.check.values, strict=True)
        rows = [
            [
                objective_text(objective), self._text(objective.quantity, old), self._text(objective.quantity, new),
                change_text(objective, old, new), self._text(objective.quantity, checked),
            ]
            for objective, old, new, checked in each
        ]  # fmt: skip
        self.page.table("Values", ["objective", "before", "after", "change", f"after, {unseen}"], rows)

    def _fields(self) -> None:
        result, reach = self.result, self.task.reach
        targets = self.problem.targets(_density(reach, self.problem))
        sides = [self.problem.quantities_at(p, targets, result.scale) for p in (self.parameters.values, result.p)]
        known = [name for name in sides[1] if name in sides[0]]
        wanted = [each.quantity for each in self.task.objectives if each.quantity in known]
        wanted = list(dict.fromkeys(wanted)) or [name for name in known if name in ("sigma_1", "sigma_max")]
        better = {each.quantity: each.is_maximised for each in self.task.objectives}
        axes = len(reach.axes)
        best = max((each for each in result.starts if each.is_feasible), key=lambda each: each.score)
        grown, looked = (reach.scaled(np.array(each), result.scale) for each in (targets, best.targets))
        for name in wanted:
            title = (
                f"{heading_of(name, result.torque_unit)} {'at the points' if len(reach.given) else 'over the region'}"
            )
            self.page.section(title[0].upper() + title[1:])
            values = unit_of(name, result.torque_unit)[0] * np.array([side[name] for side in sides])
            maximised = better.get(name, name == "sigma_1")
            field = RegionField(name, reach.axes, grown[:, :axes], values, maximised, looked[:, :axes])
            reached = np.isfinite(values).sum(axis=1)
            self.page.picture(
                draw_field(field, not len(reach.given)),
                f"{len(targets)} points; {reached[0]} are reached before, {reached[1]} after. "
                f"{'Larger' if maximised else 'Smaller'} values are better; grey is not reached.",
            )

    def _front(self) -> None:
        result, objectives = self.result, self.task.objectives
        self.page.section("Pareto front")
        chosen = [bool(np.array_equal(each.p, result.p)) for each in result.front]
        self.page.text(
            f"{len(result.front)} robots, each better than any other in one objective and worse in another. The chosen "
            "one is nearest to the best of all objectives, each divided by its range."
        )
        names = [name_of(each.quantity) for each in objectives]
        for k, j in itertools.combinations(range(len(names)), 2):
            self.page.picture(draw_front(result, k, j), f"{names[j]} over {names[k]}")
        rows = [
            [
                *(self._text(each.quantity, value) for each, value in zip(objectives, point.values, strict=True)),
                *(self.parameters.text(name, x) for name, x in zip(self.parameters.names, point.p, strict=True)),
                "holds" if point.check.holds else "does not hold",
                "chosen" if mark else "",
            ]
            for point, mark in zip(result.front, chosen, strict=True)
        ]  # fmt: skip
        headings = [*names, *self.parameters.names, "at other points", ""]
        self.page.table("Robots of the front", headings, rows[:_MOST])
        if len(rows) > _MOST:
            self.page.text(f"{len(rows) - _MOST} more are not listed.")

    def _starts(self) -> None:
        result = self.result
        self.page.section("Starts")
        good = [start for start in result.starts if start.is_feasible]
        best = max(good, key=lambda start: start.score, default=None)
        same = [start for start in good if best is not None and self._is_same(start, best)]
        self.page.text(
            f"{result.evaluations} designs were evaluated, with {result.configurations} configurations.",
            f"{len(same)} of {len(result.starts)} starts ended at the best dimensions, to a thousandth of the ranges.",
        )
        objective = self.task.objectives[0]
        rows = []
        for start in result.starts[:_MOST]:
            feasible = start.is_feasible
            value = self.problem.scoring.shown(objective, start.score) if feasible else None
            outcome = "best" if start is best else "same dimensions" if start in same else "another optimum"
            rows.append(
                [
                    "the file's dimensions" if start.index == 0 else str(start.index + 1),
                    start.evaluations,
                    "" if value is None else self._text(objective.quantity, value),
                    "" if start.violation >= 1e300 else f"{max(start.violation, 0.0):.2g}",
                    outcome if feasible else self._reason(start),
                ]
            )
        headings = ["start", "designs", name_of(objective.quantity), "violation", "result"]
        self.page.table("Violation: the largest of a constraint, dimensionless", headings, rows)
        if len(result.starts) > _MOST:
            self.page.text(f"{len(result.starts) - _MOST} more starts are not listed.")

    def _is_same(self, start: Start, other: Start) -> bool:
        width = self.problem.high - self.problem.low
        return bool((np.abs(np.array(start.x) - other.x) <= _SAME * width).all())

    def _reason(self, start: Start) -> str:
        if not start.error and start.missed > 0.0:
            axes = zip(self.task.reach.axes, start.at, strict=False)
            at = ", ".join(f"{axis} = {shown(x, LENGTH)}" for axis, x in axes)
            return f"failed: {at} is missed by {shown(start.missed, LENGTH, 3)}"
        return f"failed: {start.text}"

    def _text(self, quantity: str, value: float) -> str:
        return value_text(quantity, value, torque=self.result.torque_unit)

    def _check(self) -> None:
        check = self.result.check
        self.page.section("What was checked, and what is not proved")
        limits = f"at {check.within_limits} the joints are within their limits"
        self.page.text(
            f"The robot was loaded from the file with the new dimensions, and evaluated at {check.points} "
            f"{self._unseen}: {check.reached} are reached from home without a change of the assembly mode, "
            f"{limits if self.task.joint_limits else 'limits of joints are ignored'}. Singular values there are "
            f"{check.sigma[0]:.4g} to {value_text('sigma_max', check.sigma[1], 4)}, the condition number is at most "
            f"{value_text('condition', check.condition, 4)}."
        )
        self.page.text(
            "Nothing is proved between the points: values there may be worse, and a constraint may be violated. Nor is "
            "it proved that no other dimensions are better: starts end at local optima."
        )


def _density(reach: Reach, problem: SynthesisProblem) -> int:
    """Return the number of points along each axis with which a region is drawn."""
    if len(reach.given):
        return 1
    wide = np.ptp(problem.targets(3)[:, : len(reach.axes)], axis=0)
    return _GRID.get(int((wide > 0.0).sum()), _VOLUME)
