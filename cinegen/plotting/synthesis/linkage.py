"""The report of a linkage that was designed for precision points: its motion, the points, and defects."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cinegen.arrays import Array
from cinegen.design.synthesis import LinkageSynthesis, PrecisionProblem
from cinegen.design.synthesis.linkages import EXACT
from cinegen.design.synthesis.nearest import closed_motions
from cinegen.model.motion_plane import motion_plane
from cinegen.plotting.sheet import BLUE, FAINT, GREEN, INK, LABEL, ORANGE, SKY, VERMILION, finish, graph, label
from cinegen.plotting.skeleton import Skeleton
from cinegen.plotting.stick import Pen, paint
from cinegen.plotting.synthesis.page import ReportPage
from cinegen.plotting.view import along
from raff2urdf import closure
from raff2urdf.quantities import ANGLE, LENGTH, shown, shown_scale

_WIDE = 7.2  # inches
_TALL = 5.2  # inches, at most
_STEP, _MOST = 0.02, 8_000  # of the motion that is drawn: rad or characteristic lengths of all joints
_BACK = 10  # steps after which it may be back at its beginning
_NEAR = 1.5  # steps: a configuration is on a motion
_COLOURS = (BLUE, ORANGE, SKY, GREEN)  # of circuits
_ROOM = 0.06
_HAND = 0.06  # length of the axes of a pose, parts of the picture


def write_linkage(result: LinkageSynthesis) -> str:
    """Return the report of a linkage as an HTML file."""
    parameters, task, count = result.parameters, result.task, len(result.error)
    name, node = parameters.robot.name, task.node or parameters.mechanism.end
    of = f"{task.joints[1]} by {task.joints[0]}" if task.joints else node
    kind = {0: "pairs of values", 2: "points", 3: "poses"}[0 if task.joints else len(task.rows)]
    page = ReportPage(f"{name}: {of} through {count} {kind}")
    source = Path(parameters.document.source.name).name
    met = int((result.error <= EXACT).sum())
    page.text(f"Dimensions of {name} ({source}) with which it meets {count} {kind} exactly.")
    page.status(f"{met} of {count} {kind} are met; {result.defects}.", good=result.holds)
    page.section("Motion")
    problem = PrecisionProblem(parameters.document, task, name)
    circuits = _circuits(result, problem)
    if task.joints:
        page.picture(_draw_function(result, circuits), "The output by the input along the whole motion, and the pairs")
    else:
        caption = (
            f"The linkage after the synthesis at its first precision point, and the path of {node}: "
            f"{len(circuits)} circuit{'s' * (len(circuits) != 1)} with precision points"
        )
        page.picture(_draw_path(result, circuits, node), caption)
    page.section("Precision points")
    page.table("What is missing is in characteristic lengths and rad", *_points(result))
    page.section("Parameters")
    page.parameters(parameters, result.p, [parameters.tied_name(k) for k in range(len(parameters))], digits=9)
    if task.ties:
        page.terms(("tie", tie) for tie in task.ties)
    page.section("What was checked, and what is not proved")
    page.text(
        f"{result.exact} of {result.starts} starts met all {kind}; {result.evaluations} designs were evaluated. The "
        "motion of the result was followed in small steps; what lies between two of them is not proved. Other linkages "
        f"may meet the same {kind}: starts are random, and the first result without a defect is taken."
    )
    return page.text_of_page()


def _points(result: LinkageSynthesis) -> tuple[list[str], list[list[str]]]:
    """Return the headings and the lines of the table of precision points."""
    task = result.task
    dimensions = [ANGLE, ANGLE] if task.joints else [LENGTH, LENGTH, ANGLE][: len(task.rows)]
    headings = list(task.joints) or ["x", "y", "angle about z"][: len(task.rows)]
    rows = [
        [str(k + 1), *(shown(x, dim, 6) for x, dim in zip(target, dimensions, strict=True)), f"{error:.2g}",
         "met" if error <= EXACT else "missed"]
        for k, (target, error) in enumerate(zip(task.targets.tolist(), result.error, strict=True))
    ]  # fmt: skip
    return ["point", *headings, "missing", ""], rows


def _circuits(result: LinkageSynthesis, problem: PrecisionProblem) -> list[Array]:
    """Return the closed motions (steps, nq) on which the configurations at precision points are."""
    scale, circuits = problem.mechanism.scale, list[Array]()
    for q in result.q:
        if any(_distances(circuit, q, scale).min() < _NEAR * _STEP for circuit in circuits):
            continue
        circuits.append(_motion(problem, result.p, q))
    return circuits


def _motion(problem: PrecisionProblem, p: Array, q: Array) -> Array:
    """Return the closed motion (steps, nq) from a configuration until it is back there."""
    scale = problem.mechanism.scale
    steps, before = [q], np.zeros(len(scale))
    for k in range(_MOST):
        evaluation = problem.design.evaluate(p, steps[-1][None])
        if evaluation.gap[0] > closure.CLOSED:
            return np.array(steps[:-1] or steps)
        steps[-1] = evaluation.q[0]
        tangent = closed_motions(problem.design, evaluation.jacobians)[0, :, 0]
        before = -tangent if tangent @ before < 0.0 else tangent
        if k > _BACK and _distances(steps[-1], steps[0], scale) < 0.75 * _STEP:
            steps[-1] = steps[0]
            break
        steps.append(steps[-1] + _STEP * before * scale)
    return np.array(steps)


def _distances(motion: Array, q: Array, scale: Array) -> Array:
    apart = (motion - q) / scale
    angles = (apart + np.pi) % (2.0 * np.pi) - np.pi
    return np.asarray(np.abs(angles).max(axis=-1))


def _draw_path(result: LinkageSynthesis, circuits: list[Array], node: str) -> Figure:
    mechanism = result.parameters.mechanism_with(result.p)
    paths = [np.array([mechanism.placement(q, node).translation for q in circuit]) for circuit in circuits]
    pose = Skeleton(mechanism, node).at(result.q[0])
    normal = motion_plane(mechanism)
    view = along(np.array([0.0, 0.0, 1.0]) if normal is None else normal)
    height = pose.end[2]
    targets = np.column_stack([result.task.targets[:, :2], np.full(len(result.error), height)])
    flat = view.project(np.vstack([pose.points, targets, *paths]))[0]
    low, high = flat.min(axis=0), flat.max(axis=0)
    room = _ROOM * (high - low).max()
    low, high = low - room, high + room
    wide, tall = high - low
    figure, axes = graph(_WIDE, min(_TALL, _WIDE * tall / wide + 0.6))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    for k, path in enumerate(paths):
        text = f"path of node {node}" if len(paths) == 1 else f"path, circuit {k + 1}"
        axes.plot(*view.project(path)[0].T, color=_COLOURS[k % len(_COLOURS)], linewidth=1.2, label=text, zorder=1.5)
    paint(axes, pose, view, Pen(1.6, 0.9, 3.2))
    _mark(axes, result, view.project(targets)[0])
    if len(result.task.rows) == 3:
        size = _HAND * max(wide, tall)
        for (x, y, _), angle in zip(targets, result.task.targets[:, 2], strict=True):
            tip = np.array([[x, y, height], [x + size * np.cos(angle), y + size * np.sin(angle), height]])
            axes.plot(*view.project(tip)[0].T, color=GREEN, linewidth=1.6, zorder=6.0, clip_on=False)
    scale, unit = shown_scale(LENGTH)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(lambda value, _: f"{scale * value + 0.0:.4g}".replace("-", "−"))
    axes.grid(color=FAINT, alpha=0.25)
    label(axes, f"x ({unit})", f"y ({unit})")
    return finish(figure)


def _draw_function(result: LinkageSynthesis, circuits: list[Array]) -> Figure:

    mechanism, joints = result.parameters.mechanism, result.task.joints
    figure, axes = graph(_WIDE, 4.0)
    columns = [mechanism.q_index(name) for name in joints]
    for k, circuit in enumerate(circuits):
        values = np.degrees(np.unwrap(circuit[:, columns], axis=0))
        shift = 360.0 * np.round((np.degrees(result.task.targets[0]) - values[0]) / 360.0) if k == 0 else 0.0
        text = "motion" if len(circuits) == 1 else f"motion, circuit {k + 1}"
        axes.plot(*(values + shift).T, color=_COLOURS[k % len(_COLOURS)], linewidth=1.2, label=text)
    _mark(axes, result, np.degrees(result.task.targets))
    axes.grid(color=FAINT, alpha=0.25)
    label(axes, f"{joints[0]} (°)", f"{joints[1]} (°)")
    return finish(figure)


def _mark(axes: Axes, result: LinkageSynthesis, at: Array) -> None:
    """Draw the precision points, with their numbers, at (n, 2)."""
    met = result.error <= EXACT
    for chosen, colour, text in ((met, GREEN, "precision point"), (~met, VERMILION, "missed precision point")):
        if chosen.any():
            axes.plot(*at[chosen].T, "o", markerfacecolor="none", markeredgecolor=colour, markeredgewidth=1.6,
                      markersize=8.0, linestyle="none", label=text, zorder=6.0)  # fmt: skip
    for k, point in enumerate(at):
        axes.annotate(str(k + 1), point, (6.0, 5.0), textcoords="offset points", fontsize=LABEL, color=INK, zorder=7.0)
