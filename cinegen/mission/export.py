"""Export of a recording to a file for a robot controller: resampled, checked, and only then written."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from cinegen.mission.check import FindingKind, Findings, check
from cinegen.mission.file_format import MissionError
from cinegen.mission.formats import format_of
from cinegen.mission.recording import Recording
from cinegen.mission.trajectory import Trajectory, resampled
from cinegen.model import Mechanism
from cinegen.planning.torque_limits import TorqueLimits
from raff2urdf.errors import counted
from raff2urdf.files import write_all

_LISTED = 3  # findings in an error


@dataclass(frozen=True, eq=False)
class ExportReport:
    """Report of an export.

    Attributes:
        path: path of the file.
        to: name of the format.
        joints: exported joints.
        trajectory: exported trajectory.
        findings: findings of its check.
        recorded: duration in the recording divided by the requested speed, s; 0 if the fastest motion is requested.
        notes: notes about the file.
    """

    path: Path
    to: str
    joints: tuple[str, ...]
    trajectory: Trajectory
    findings: Findings
    recorded: float
    notes: tuple[str, ...]


def export(
    recording_path: str | Path,
    to: str,
    output: str | Path | None = None,
    robot: str | None = None,
    rate: float = 125.0,
    speed: float = 1.0,
    all_joints: bool = False,
    unsafe: bool = False,
    acceleration: float | Mapping[str, float] | None = None,
    jerk: float | Mapping[str, float] | None = None,
    torques: Callable[[Mechanism], TorqueLimits] | None = None,
) -> ExportReport:
    """Write a robot's recorded motion to a file, completely or not at all. An existing file is replaced.

    Args:
        recording_path: path of the recording.
        to: format, one of `FORMATS`.
        output: path of the file; that of the recording with the format's suffix unless given.
        robot: name of the robot in the recording; the only one unless given.
        rate: samples per second.
        speed: speed relative to the recording, as far as limits allow; infinite for the fastest motion.
        all_joints: write passive joints, too.
        unsafe: write the motion even if its check has serious findings.
        acceleration: limits of acceleration, rad/s^2 and m/s^2: one number, or by joint name; defaults unless given.
        jerk: limits of jerk, rad/s^3 and m/s^3, likewise; unlimited unless given.
        torques: returns the limits of torques and forces of the robot, such as `TorqueLimits`; unlimited unless given.

    Raises:
        MissionError: the recording can't be read or exported; its motion leaves loops open, violates limits or passes a
            type 2 singularity (with the time); the format can't express it; or the file can't be written.
        UnknownNameError: no such format, robot or joint.
        CinegenError: a limit is not positive.
        MissingExtraError: toppra is not installed.
    """
    source, form = Path(recording_path), format_of(to)
    path = source.with_suffix(form.suffix) if output is None else Path(output)
    recording = Recording.load(source)
    if os.path.realpath(path) == os.path.realpath(source):
        raise MissionError(f"{path}: is the recording itself; name another file (-o FILE)")
    trajectory = resampled(recording, robot, rate, speed, acceleration, jerk, torques)
    joints = trajectory.mechanism.joints if all_joints else trajectory.mechanism.actuated
    content = form.write(trajectory, joints)
    findings = check(trajectory)
    if findings.serious and not unsafe:
        raise MissionError(_refused(source, trajectory, findings))
    try:
        write_all({path: content})
    except OSError as error:
        raise MissionError(f"{path}: can't be written: {(error.strerror or str(error)).lower()}") from None
    recorded = float(trajectory.passes[-1, 1] - trajectory.passes[0, 1]) / speed
    notes = tuple(filter(None, [form.note(content)]))
    return ExportReport(path, to, joints, trajectory, findings, recorded, notes)


def _refused(source: Path, trajectory: Trajectory, findings: Findings) -> str:
    serious = findings.serious
    listed = [f"  {finding}" for finding in serious[:_LISTED]]
    if len(serious) > _LISTED:
        listed.append(f"  and {len(serious) - _LISTED} more")
    return "\n".join(
        [
            f"{source}: the motion of {trajectory.name} must not be sent to a robot:",
            *listed,
            "record another motion, or write this one with --unsafe",
        ]
    )


def report_text(report: ExportReport) -> str:
    """Return a report for users."""
    trajectory, findings = report.trajectory, report.findings
    count, seconds = len(report.joints), trajectory.seconds
    lines = [
        f"{report.path}: {counted(count, 'joint')} of {trajectory.name}, {counted(len(trajectory.times), 'sample')} in "
        f"{seconds:.3f} s, {trajectory.rate:g} a second"
    ]
    slower = float(trajectory.passes[-1, 0]) - report.recorded
    if slower > 1e-3 and report.recorded:
        kinds = "velocity and acceleration" if trajectory.torques is None else "velocity, acceleration and torque"
        lines.append(f"slowed down by {slower:.3f} s, for limits of {kinds}")
    if trajectory.torques is not None and trajectory.used is not None:
        lines.append(f"torques: {trajectory.torques.text(trajectory.used)}")
        lines += [f"note: {note}" for note in trajectory.torques.notes]
    if assumed := str(trajectory.limits):
        lines.append(f"assumed: {assumed}")
    if not findings.serious:
        closed = passed = ""
        if trajectory.mechanism.is_constrained:
            closed = f"loops closed to {findings.closure:.1g}, "
            if not any(finding.kind is FindingKind.CROSSED for finding in findings):
                passed = ", no type 2 singularity passed"
        lines.append(f"checked: {closed}joints within their limits{passed}")
    for finding in findings:
        lines.append(f"{'DO NOT SEND THIS TO A ROBOT' if finding.kind.serious else 'note'}: {finding}")
    return "\n".join([*lines, *(f"note: {note}" for note in report.notes)])
