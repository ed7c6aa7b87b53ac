"""`record_plan`: a planned way as a recording, as fast as the robot may go."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.joints import translations
from cinegen.mission.line import MissionError, Motion, Place, RecordedTask
from cinegen.mission.recorder import Recorder
from cinegen.model import Mechanism
from cinegen.planning.planner import Plan

Array = NDArray[np.float64]

TURNING, SLIDING = 1.0, 0.25
"""rad/s and m/s: of joints that have no limit of speed, and of a base that can move."""

_AT_ONCE = 1e-6  # s: what follows sooner than that is the same moment


def record_plan(
    plan: Plan,
    path: str | Path,
    name: str | None = None,
    robots: Mapping[str, Mechanism] | None = None,
    places: Mapping[str, Place] | None = None,
) -> Array:
    """Writes the path of a plan, so that some joint always is as fast as it may be; the node's goal is recorded as what
    tasks it. A recording goes straight between its moments, as the path does: what keeps clear there keeps clear here.

    Args:
        plan: whose path has two configurations at least.
        path: of the file, see `Recorder`.
        name: of the robot in the recording; its own unless given.
        robots: all that the recording holds, by name, the plan's robot too; those beside it stand at home. That alone
            unless given.
        places: where these stand, by name.

    Returns:
        (steps + 1,) when each configuration is passed, s.

    Raises:
        MissionError: there is no way to be recorded, or the file can't be written.
    """
    mechanism = plan.scene.mechanism
    name = name or mechanism.name
    times = passes(mechanism, plan.path)
    if times[-1] < _AT_ONCE:
        raise MissionError(f"{plan.scene.name}: there is no way that could be recorded: {plan}")
    scene = plan.scene
    task = RecordedTask(scene.node, "plan", pin.SE3.Identity(), scene.goal, scene.translation, scene.rotation)
    with Recorder(path, {name: mechanism} if robots is None else robots, places) as recorder:
        last = -np.inf
        for time, q in zip(times.tolist(), plan.path, strict=True):
            if time - last >= _AT_ONCE:
                recorder.write(time, {name: Motion(q, (task,), "FOLLOWING")})
                last = time
    if recorder.error != "closed" or recorder.lost:
        raise MissionError(f"{path}: can't be written: {recorder.error}")
    return times


def passes(mechanism: Mechanism, path: Array) -> Array:
    """(n,) when each configuration of a path (n, nq) is passed, s, if on the way from each to the next some joint is as
    fast as it may be. What follows the motors through loops counts only where it has a limit of its own."""
    limits = _limits(mechanism)
    steps = (np.abs(mechanism.difference(a, b)) / limits for a, b in pairwise(path))
    return np.concatenate([[0.0], np.cumsum([step.max(initial=0.0) for step in steps])])


def _limits(mechanism: Mechanism) -> Array:
    """(nv,) rad/s and m/s."""
    model = mechanism.model
    found = np.full(model.nv, TURNING)
    for joint in model.joints:
        found[joint.idx_v : joint.idx_v + translations(joint)] = SLIDING
    if mechanism.loops:
        found[mechanism.passive_columns] = np.inf
    return np.where(np.isfinite(mechanism.limits.velocity), mechanism.limits.velocity, found)
