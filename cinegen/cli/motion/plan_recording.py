"""The path of a plan, recorded or shown in the page."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from cinegen.cli.served_page import PageOptions
from raff2urdf.files import write_all, writing

if TYPE_CHECKING:
    from cinegen.planning import Plan


_LISTED = 4  # attempts over the motion in the page
_SHOWN = 4.0  # s: a shorter motion is shown slower


def record_path(plan: Plan, path: Path) -> str:
    """Record the robot alone, as exports expect, when all of it is known; return a message.

    Raises:
        MissionError: the file can't be written.
        OutputLostError: the reader of standard output has gone.
    """
    from cinegen.mission import MissionError
    from cinegen.mission.results import record_plan
    from cinegen.session import scene_setup

    setup = scene_setup(plan.scene)
    name = next(iter(setup.robots))
    with tempfile.TemporaryDirectory(prefix="cinegen-") as folder:
        complete = Path(folder) / "plan.jsonl"
        motion = record_plan(plan, complete, name, setup.robots[name])
        with writing(MissionError):
            write_all({path: complete.read_bytes()})
    text = f"recorded: {path}, {motion.times[-1]:.1f} s" + ("" if plan else ", up to where the path ends")
    text += "; it stops at each step of the path, to keep the clearance" if motion.follows else ""
    return text + (f"\nassumed: {motion.limits}" if str(motion.limits) else "")


def show_path(plan: Plan, page: PageOptions) -> None:
    """Show the path in the page, among its obstacles."""
    from cinegen.mission.results import record_plan
    from cinegen.session import replay_setup, scene_setup

    setup = scene_setup(plan.scene)
    with tempfile.TemporaryDirectory(prefix="cinegen-") as folder:
        recording = Path(folder) / f"{plan.scene.name}.jsonl"
        ((name, mechanism),) = setup.robots.items()
        motion = record_plan(plan, recording, name, mechanism, setup.obstacles)
        replayed = replay_setup(recording, min(1.0, max(0.01, float(motion.times[-1]) / _SHOWN)))
        page.show(replace(replayed, attached=setup.attached, caption=_caption_of(plan)), plan.scene.name)


def _caption_of(plan: Plan) -> str:
    """Return which attempt the motion is that is shown, and how the others ended."""

    from cinegen.planning import PlanStatus

    lines = []
    for number, attempt in enumerate(plan.attempts, 1):
        stopped = attempt.status is not PlanStatus.REACHED and attempt.blocked_by
        by = f": '{attempt.blocked_by[0][0]}' is at '{attempt.blocked_by[0][1]}'" if stopped else ""
        lines.append(f"attempt {number}, {attempt.strategy}: {attempt.status.value}{by}")
    if len(lines) > _LISTED:
        lines[_LISTED - 2 : -1] = [f"{len(lines) - _LISTED + 1} more attempts did not reach the goal"]
    return "\n".join(lines)
