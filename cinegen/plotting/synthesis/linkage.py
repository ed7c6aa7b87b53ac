"""The picture of a linkage that was designed for precision points: its motion, and the points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cinegen.arrays import Array
from cinegen.design.synthesis import LinkageSynthesis, PrecisionProblem
from cinegen.design.synthesis.linkage_result import EXACT
from cinegen.model.motion_plane import motion_plane
from cinegen.plotting.sheet import BLUE, FAINT, GREEN, INK, LABEL, ORANGE, SKY, VERMILION, finish, graph, label
from cinegen.plotting.skeleton import Skeleton
from cinegen.plotting.stick import Pen, paint
from cinegen.plotting.view import along
from raff2urdf.quantities import LENGTH, shown_scale

_WIDE = 7.2  # inches
_TALL = 5.2  # inches, at most
_NEAR = 0.03  # rad or characteristic lengths: a configuration is on a motion
_COLOURS = (BLUE, ORANGE, SKY, GREEN)  # of circuits
_ROOM = 0.06
_HAND = 0.06  # length of the axes of a pose, parts of the picture


def linkage_pictures(result: LinkageSynthesis) -> Iterator[tuple[Figure, str]]:
    """Yield the picture of a linkage's motion, with its caption."""
    task, node = result.task, result.task.node or result.parameters.mechanism.end
    problem = PrecisionProblem(result.parameters.document, task, result.parameters.robot.name)
    circuits = list[Array]()
    for q in result.q:
        if not any(problem.apart(circuit, q).min() < _NEAR for circuit in circuits):
            circuits.append(problem.circuit(result.p, q)[0][::2])
    if task.joints:
        yield _draw_function(result, circuits), "The output by the input along the whole motion, and the pairs"
        return
    text = f"The linkage at its first precision point, and the path of {node}: {len(circuits)}"
    yield _draw_path(result, circuits, node), f"{text} circuit{'s' * (len(circuits) != 1)} with precision points"


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
