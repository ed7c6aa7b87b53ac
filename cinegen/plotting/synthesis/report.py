"""`synthesis_report`: a synthesis as one HTML file for reading and printing."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from cinegen.design.synthesis import LinkageSynthesis, Synthesis
from cinegen.errors import CinegenError
from cinegen.plotting.synthesis.levels import RegionField, draw_field
from cinegen.plotting.synthesis.linkage import linkage_pictures
from cinegen.plotting.synthesis.page import drawing, page_of
from cinegen.plotting.synthesis.robots import draw_designs
from cinegen.plotting.synthesis.starts import draw_front, draw_parameters, heading_of

_GRID = {0: 1, 1: 101, 2: 31}  # points along each axis of a region, by the axes along which it is wide
_VOLUME = 9
_LINKAGE = (
    "The motion was followed in small steps; what lies between two of them is not proved. Other linkages may do the "
    "same: starts are random, and the first result without a defect is taken."
)
_POINTS = (
    "Nothing is proved between the points: values there may be worse, and a constraint may be violated. Nor is it "
    "proved that no other dimensions are better: starts end at local optima."
)


def synthesis_report(result: Synthesis | LinkageSynthesis) -> str:
    """Return a report of a synthesis: one HTML file, with pictures inside and nothing to load.

    It has the result's text, the robot before and after, where the starts ended, the objectives over the region, Pareto
    fronts, and the task; of a linkage its motion.
    """
    robot = result.parameters.robot.name
    with drawing():
        if isinstance(result, LinkageSynthesis):
            title = f"{robot}: {len(result.error)} precision points"
            return page_of(title, result.text, linkage_pictures(result), _LINKAGE, good=result.holds)
        title = f"{robot}: {' and '.join(objective.text for objective in result.task.objectives)}"
        encode = json.JSONEncoder(default=str, ensure_ascii=False).encode
        task = "\n".join(f"{key} = {encode(value)}" for key, value in result.task.written.items())
        return page_of(title, result.text, _pictures(result), _POINTS, task, good=result.holds)


def _pictures(result: Synthesis) -> Iterator[tuple[Figure, str]]:
    """Yield the pictures with their captions."""
    parameters, reach, designs, missing = result.parameters, result.task.reach, {}, ""
    for title, p in (("before", parameters.values), ("after", result.p)):
        try:
            designs[title] = parameters.mechanism_with(p)
        except CinegenError as error:
            missing += f" The robot {title} can't be drawn: {error}."
    node = result.task.node or parameters.mechanism.end
    where = "the point nearest to the middle" if len(reach.given) else "the middle of the region"
    wide = np.ptp(result.problem.targets(3)[:, : len(reach.axes)], axis=0)
    targets = result.problem.targets(_GRID.get(int((wide > 0.0).sum()), _VOLUME))
    if designs:
        text = f"Node {node} in {where}; both robots in one scale.{missing}"
        yield draw_designs(designs, reach, node, targets), text
    if len(result.p):
        yield draw_parameters(result), "Parameters within their ranges"
    yield from _fields(result, targets)
    if result.front:
        for k, j in itertools.combinations(range(len(result.task.objectives)), 2):
            yield draw_front(result, k, j), f"Pareto front: {len(result.front)} robots, objectives {k + 1} and {j + 1}"


def _fields(result: Synthesis, targets: np.ndarray) -> Iterator[tuple[Figure, str]]:
    """Yield pictures of the objectives that have a value at each point; without any, of the singular values."""
    problem, reach, objectives = result.problem, result.task.reach, result.task.objectives
    sides = [problem.quantities_at(p, targets, result.scale) for p in (result.parameters.values, result.p)]
    wanted = {each.quantity: each.is_maximised for each in objectives if each.quantity in sides[1]}
    axes = len(reach.axes)
    best = max((each for each in result.starts if each.is_feasible), key=lambda each: each.score)
    grown, looked = (reach.scaled(np.array(each), result.scale)[:, :axes] for each in (targets, best.targets))
    for name, is_maximised in (wanted or {"sigma_1": True, "sigma_max": False}).items():
        scale, heading = heading_of(result, name)
        values = scale * np.array([side[name] for side in sides])
        field = RegionField(heading, reach.axes, grown, values, is_maximised, looked)
        before, after = np.isfinite(values).sum(axis=1)
        better = "Larger" if is_maximised else "Smaller"
        title = heading[:1].upper() + heading[1:]
        text = f"{title} at {len(targets)} points; {before} are reached before, {after} after. {better} is better."
        yield draw_field(field, not len(reach.given)), text
