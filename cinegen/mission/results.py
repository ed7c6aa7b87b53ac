"""Results as recordings: planned paths and assembly modes, to be replayed in the page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pinocchio as pin

from cinegen.assembly import AssemblyModes
from cinegen.mission.drawn_obstacle import DrawnObstacle
from cinegen.mission.file_format import MissionError, RecordedTask, RobotSample
from cinegen.mission.recorder import MissionRecorder
from cinegen.model import Mechanism
from cinegen.planning import Plan
from cinegen.planning.timed_path import TimedPath, timed_path

_INSTANT = 1e-6  # s: shortest time between two moments


def record_plan(
    plan: Plan,
    path: str | Path,
    name: str | None = None,
    mechanism: Mechanism | None = None,
    obstacles: Mapping[str, DrawnObstacle] | None = None,
) -> TimedPath:
    """Record a motion along the path of a plan within the limits of its robot: see `timed_path`.

    A recording is interpolated between its moments as the clearance of the motion is bounded, so it keeps it. The goal
    of the node is recorded as its task.

    Args:
        plan: plan whose path has two configurations at least.
        path: path of the file, see `MissionRecorder`.
        name: name of the robot in the recording; its own unless given.
        mechanism: the plan's robot as it is drawn, if that differs.
        obstacles: obstacles of the recording by name; none unless given.

    Returns:
        The motion.

    Raises:
        MissionError: the path has no length, or the file can't be written.
        MissingExtraError: toppra is not installed.
        TimingError: there is no such motion.
    """
    scene = plan.scene
    name = name or scene.mechanism.name
    if (plan.path == plan.path[0]).all():
        raise MissionError(f"{scene.name}: there is no path to record: {plan}")
    motion = timed_path(plan)
    task = RecordedTask(scene.node, "plan", pin.SE3.Identity(), scene.goal, scene.translation, scene.rotation)
    with MissionRecorder(path, {name: mechanism or scene.mechanism}, obstacles=obstacles) as recorder:
        for time, q in zip(motion.times.tolist(), motion.q, strict=True):
            recorder.write(time, {name: RobotSample(q, "FOLLOWING", (task,))})
    _check_written(recorder)
    return motion


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
