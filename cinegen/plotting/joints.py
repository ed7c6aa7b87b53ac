"""`draw_joints`: the joints of a path over time."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from cinegen.planning.planner import Plan
from cinegen.planning.timed_path import TimedPath, timed_path
from cinegen.plotting.modes import DrawingError
from cinegen.plotting.plan import robot_name
from cinegen.plotting.sheet import BLUE, FAINT, GREEN, INK, ORANGE, SKY, VERMILION, finish, label, sheet
from raff2urdf.quantities import ANGLE, LENGTH, shown_scale

_COLOURS = BLUE, VERMILION, GREEN, ORANGE, SKY, INK
_STYLES = "-", "--", ":", "-."  # of the first six joints, the next six ...
_MOVES = 1e-6  # rad or characteristic lengths: less is no motion
_WIDE, _TALL = 7.0, 2.2  # inches: width, and height of each row
_RATE = 100.0  # samples per second


def draw_joints(plan: Plan, motion: TimedPath | None = None) -> Figure:
    """Draw the values of the joints that move over time: angles, lengths, and below them the velocities, relative to
    their limits.

    Args:
        plan: with a path of two configurations at least.
        motion: motion along it; by default the fastest within limits, see `timed_path`.

    Returns:
        a matplotlib figure: `draw_joints(plan).savefig("joints.png")`.

    Raises:
        DrawingError: no joint moves.
        TimingError: there is no such motion.
    """
    mechanism = plan.scene.mechanism
    travel = np.ptp(plan.path, axis=0)
    moving = [
        name
        for name in mechanism.joints
        if travel[mechanism.q_index(name)] > _MOVES * mechanism.scale[mechanism.v_index(name)]
    ]
    if not moving:
        raise DrawingError("no joint moves on this path: there is nothing to draw")
    motion = timed_path(plan, _RATE) if motion is None else motion
    left_out = [f"at rest: {', '.join(name for name in mechanism.joints if name not in moving)}"]
    left_out += [f"not drawn: {', '.join(mechanism.balls)}"] if mechanism.balls else []
    left_out += ["not drawn: the floating base"] if mechanism.floating else []
    text = "; ".join([robot_name(plan.scene), *(part for part in left_out if not part.endswith(": "))])
    kinds = [
        (names, *shown_scale(dimension), quantity)
        for names, dimension, quantity in (
            ([name for name in moving if not mechanism.is_prismatic(name)], ANGLE, "angle"),
            ([name for name in moving if mechanism.is_prismatic(name)], LENGTH, "position"),
        )
        if names
    ]
    rows = len(kinds) + 1
    title = f"{plan.scene.name}: {plan.status.value}, {motion.times[-1]:.2f} s"
    figure, body = sheet(_WIDE, _TALL * rows + 0.5, title, text)
    panels = body.subplots(rows, 1, sharex=True)
    lines = {name: _line(number) for number, name in enumerate(moving)}
    for axes, (names, scale, unit, quantity) in zip(panels, kinds, strict=False):
        for name in names:
            axes.plot(motion.times, scale * motion.q[:, mechanism.q_index(name)], label=name, **lines[name])
        label(axes, y=f"{quantity} ({unit})")
    for name in moving:
        k, rate = mechanism.v_index(name), np.diff(motion.q[:, mechanism.q_index(name)]) * (1.0 / motion.times[1])
        if np.isfinite(motion.limits.velocity[k]):
            middles = (motion.times[:-1] + motion.times[1:]) / 2.0
            panels[-1].plot(middles, rate / motion.limits.velocity[k], **lines[name])
    for limit in (-1.0, 1.0):
        panels[-1].axhline(limit, color=FAINT, linewidth=1.0, linestyle=(0, (4, 3)))
    label(panels[-1], "time (s)", "velocity / limit")
    for axes in panels:
        axes.grid(color=FAINT, alpha=0.25)
    return finish(figure)


def _line(number: int) -> dict[str, Any]:
    """Return how the line of a joint is drawn."""
    return {
        "color": _COLOURS[number % len(_COLOURS)],
        "linestyle": _STYLES[number // len(_COLOURS) % len(_STYLES)],
        "linewidth": 1.4,
    }
