"""Results as recordings: planned paths and assembly modes, to be replayed in the page."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.assembly import AssemblyModes
from cinegen.joints import step_scale
from cinegen.mission.drawn_obstacle import DrawnObstacle
from cinegen.mission.file_format import MissionError, RecordedTask, RobotSample
from cinegen.mission.recorder import MissionRecorder
from cinegen.model import Mechanism
from cinegen.planning import Plan

Array = NDArray[np.float64]

ANGULAR_SPEED, LINEAR_SPEED = 1.0, 0.25
"""rad/s and m/s: of joints without a velocity limit, and of a floating base."""

_INSTANT = 1e-6  # s: shortest time between two moments


def record_plan(
    plan: Plan,
    path: str | Path,
    name: str | None = None,
    mechanism: Mechanism | None = None,
    obstacles: Mapping[str, DrawnObstacle] | None = None,
) -> Array:
    """Record the path of a plan, timed so that at any time one joint moves at its velocity limit.

    A recording is interpolated between its moments as the path is, so it keeps the same clearance. The goal of the node
    is recorded as its task.

    Args:
        plan: plan whose path has two configurations at least.
        path: path of the file, see `MissionRecorder`.
        name: name of the robot in the recording; its own unless given.
        mechanism: the plan's robot as it is drawn, if that differs.
        obstacles: obstacles of the recording by name; none unless given.

    Returns:
        (steps + 1,) time of each configuration, s.

    Raises:
        MissionError: the path has no length, or the file can't be written.
    """
    scene = plan.scene
    name = name or scene.mechanism.name
    times = passes(scene.mechanism, plan.path)
    if times[-1] < _INSTANT:
        raise MissionError(f"{scene.name}: there is no path to record: {plan}")
    task = RecordedTask(scene.node, "plan", pin.SE3.Identity(), scene.goal, scene.translation, scene.rotation)
    with MissionRecorder(path, {name: mechanism or scene.mechanism}, obstacles=obstacles) as recorder:
        last = -np.inf
        for time, q in zip(times.tolist(), plan.path, strict=True):
            if time - last >= _INSTANT:
                recorder.write(time, {name: RobotSample(q, "FOLLOWING", (task,))})
                last = time
    _check_written(recorder)
    return times


def passes(mechanism: Mechanism, path: Array) -> Array:
    """Return the time of each configuration of a path (n, nq), s (n,), if at any time one joint moves at its velocity
    limit. Passive joints count only if they have a limit of their own."""
    limits = _velocity_limits(mechanism)
    steps = (np.abs(mechanism.difference(a, b)) / limits for a, b in pairwise(path))
    return np.concatenate([[0.0], np.cumsum([step.max(initial=0.0) for step in steps])])


def _velocity_limits(mechanism: Mechanism) -> Array:
    """Return the velocity limits (nv,), rad/s and m/s."""
    default = ANGULAR_SPEED * step_scale(mechanism.model, LINEAR_SPEED / ANGULAR_SPEED)
    if mechanism.is_constrained:
        default[mechanism.passive_columns] = np.inf
    return np.where(np.isfinite(mechanism.limits.velocity), mechanism.limits.velocity, default)


def record_modes(modes: AssemblyModes, path: str | Path, name: str | None = None) -> None:
    """Record assembly modes: mode 1 until second 2, then mode 2 until second 3, and so on. At second k it shows mode k.

    There is no motion between two modes: with its actuated joints locked, a mechanism can't move from one to another.

    Args:
        modes: at least one mode.
        path: path of the file, see `MissionRecorder`.
        name: name of the robot in the recording; its own unless given.

    Raises:
        MissionError: there is no mode, or the file can't be written.
    """
    if not len(modes):
        raise MissionError(f"{modes.mechanism.name} has no assembly mode there: nothing can be recorded")
    robot = name or modes.mechanism.name
    with MissionRecorder(path, {robot: modes.mechanism}) as recorder:
        recorder.write(0.0, {robot: RobotSample(modes[0], "IDLE")})
        for second in range(2, len(modes) + 1):
            recorder.write(second - _INSTANT, {robot: RobotSample(modes[second - 2], "IDLE")})
            recorder.write(float(second), {robot: RobotSample(modes[second - 1], "IDLE")})
    _check_written(recorder)


def _check_written(recorder: MissionRecorder) -> None:
    if recorder.error != "closed" or recorder.lost:
        raise MissionError(f"{recorder.path}: can't be written: {recorder.error}")
