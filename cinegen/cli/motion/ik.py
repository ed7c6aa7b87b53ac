"""`cinegen ik`: inverse kinematics, one solution or all."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cinegen.cli.files import print_result
from cinegen.cli.numbers import UNITS, locked_joints, parts, values
from cinegen.cli.options import FILE, JSON, NODE, ShownRobotOptions
from cinegen.cli.progress import Progress
from cinegen.errors import CinegenError, UnknownNameError
from raff2urdf.command.command_line import flag, option
from raff2urdf.errors import counted
from raff2urdf.quantities import ANGLE, LENGTH, shown, shown_scale

if TYPE_CHECKING:
    from cinegen.arrays import Array
    from cinegen.assembly import SelfMotion
    from cinegen.assembly.results import SolutionSet
    from cinegen.ik import FrameTask, IKSolutions
    from cinegen.model import Mechanism

POSE = ("x", "y", "z", "rx", "ry", "rz")
"""Names of the coordinates of a pose."""

TYPED = 1e-4
"""m and rad: poses are typed with some digits only."""

_WIDTH = 98  # columns of text
_JOINED = "\xa0"  # a blank at which no line is broken


def run(
    robots: ShownRobotOptions,
    file: Path = FILE,
    at: str = option(
        "POSE",
        "the node's pose x,y,z[,rx,ry,rz] (roll, pitch, yaw as in URDF; without them any orientation); or some by "
        f"name: x=0.01,rz=15, the others as at home ({UNITS})",
        ...,
    ),
    node: str | None = NODE,
    all_: bool = flag("--all", "list all solutions, and report whether these are all"),
    lock: str | None = option(
        "JOINTS", f"joints that do not move, such as joint3,joint4=0.7: at home, or at a value ({UNITS})"
    ),
    json: bool = JSON,
) -> int:
    """Find configurations that bring a node to a pose.

    Finds the joint values of one solution within joint limits, by a search from home. With --all, lists all
    solutions, those nearest home first, and which limits they exceed. The exit code is 1 if the node can't reach the
    pose, or if no solution was found.
    """
    name, mechanism = robots.load_one(file)
    asked = pose_task(mechanism, at, node or mechanism.end)
    names, at_values = locked_joints(lock, mechanism)
    start = mechanism.close(mechanism.configuration(at_values), names)
    from cinegen.ik import inverse_kinematics

    if all_:
        with Progress() as progress:
            solutions = inverse_kinematics(mechanism, [asked], start, all=True, locked=names, report=progress.text)
    else:
        solutions = inverse_kinematics(mechanism, [asked], start, locked=names).as_solutions()
    print_result(solutions.as_dict(), "\n".join(_lines(name, solutions, all_)), json)
    return 0 if len(solutions) else 1


def pose_task(mechanism: Mechanism, text: str, node: str) -> FrameTask:
    """Return the task of bringing a node to the pose of --at.

    Raises:
        CinegenError: it is not a pose.
        UnknownNameError: there is no such node or coordinate.
    """
    import numpy as np
    import pinocchio as pin

    from cinegen.ik import FrameTask

    home = mechanism.placement(mechanism.q_home, node)
    coordinates = parts(text)
    if not any("=" in part for part in coordinates):
        if len(coordinates) not in (3, 6):
            raise CinegenError(
                f"--at: a pose is x,y,z or x,y,z,rx,ry,rz in m and degrees, not {counted(len(coordinates), 'number')}"
            )
        text = ",".join(f"{name}={value}" for name, value in zip(POSE, coordinates, strict=False))
    by_name = values(text, "--at", "x=0.01,rz=15 (m and degrees)", mechanism)
    pose = dict(zip(POSE, [*home.translation, *pin.rpy.matrixToRpy(home.rotation)], strict=True))
    for coordinate in by_name:
        if coordinate not in POSE:
            raise UnknownNameError("coordinate", coordinate, POSE)
    x, y, z, roll, pitch, yaw = {**pose, **by_name}.values()
    target = pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), np.array([x, y, z]))
    return FrameTask(node, target, rotation=3 if any(name in by_name for name in POSE[3:]) else 0)


def pose_text(task: FrameTask) -> str:
    """Return the pose of a task: `x 0.1, y 0.2, z 0 m`, with the orientation if it is constrained."""
    from cinegen.user_units import pose_numbers

    rounded = [round(value, 9) + 0.0 for value in pose_numbers(task.target)]
    numbers = [f"{name} {value:.6g}" for name, value in zip(POSE, rounded, strict=True)]
    where = f"{', '.join(numbers[:3])} {shown_scale(LENGTH)[1]}"
    return f"{where}, {', '.join(numbers[3:])} deg" if task.rotation else where


def missed_text(task: FrameTask, errors: tuple[float, float]) -> str:
    """Return by how much a pose is missed, from m and rad."""
    missed = shown(errors[0], LENGTH)
    return f"{missed} and {shown(errors[1], ANGLE)}" if task.rotation else missed


def limits_text(mechanism: Mechanism, q: Array) -> str:
    """Return the first joint that is outside its limits, and how many others are; empty if all are inside."""
    from cinegen.user_units import in_user_units, length_digits, rounded

    beyond, unwound = mechanism.limits.outside(q), mechanism.limits.unwound(q)
    if not beyond:
        return ""
    joint, limit = next(iter(beyond.items()))
    value = float(unwound[mechanism.q_index(joint)])
    digits = length_digits() - 2 if mechanism.is_prismatic(joint) else 1
    (number, unit), (end, _) = (in_user_units(mechanism, joint, x) for x in (value, limit))
    text = f"{joint} {rounded(number, digits):g} {'<' if value < limit else '>'} {rounded(end, digits):g} {unit}"
    return text + (f", {len(beyond) - 1} more" if len(beyond) > 1 else "")


def self_motion_lines(
    mechanism: Mechanism, motions: Sequence[SelfMotion], heading: str, joints: Sequence[str]
) -> list[str]:
    """Return a heading and lines for each self-motion: the joints that move, and joint values of a configuration; none
    if there is none."""
    from cinegen.user_units import value_text

    lines = list[str]()
    for motion in motions:
        at = [float(motion.configuration[mechanism.q_index(joint)]) for joint in joints]
        values = [f"{joint} {value_text(mechanism, joint, value)}" for joint, value in zip(joints, at, strict=True)]
        text = f"{motion.description}, such as {', '.join(value.replace(' ', _JOINED) for value in values)}"
        lines += textwrap.wrap(text, _WIDTH, initial_indent="  ", subsequent_indent="    ")
    return [heading, *(line.replace(_JOINED, " ") for line in lines), ""] if lines else []


def claim_text(solutions: SolutionSet) -> str:
    """Return sentences: whether these are all solutions, and why, or what is not excluded."""
    if solutions.complete:
        claim = (
            "These are all" if len(solutions) else "There is none"
        ) + ", with probability one" * solutions.almost_surely
    else:
        claim = "There may be more" if len(solutions) else "None was found"
    method = solutions.method.removesuffix(".")
    return f"{claim}. {method[:1].upper()}{method[1:]}."


def _lines(name: str, solutions: IKSolutions, every: bool) -> list[str]:
    mechanism, number = (
        solutions.mechanism,
        counted(len(solutions), "inverse solution") if len(solutions) else "no inverse solution",
    )
    within = f", {len(solutions.within_limits)} within the limits" if every and len(solutions) else ""
    lines = [f"{name}: robot '{mechanism.name}', {number}{within}"]
    lines += [f"  {solutions.task.node} at {pose_text(solutions.task)}", ""]
    if len(solutions):
        lines += [*_table(solutions), *_bases(solutions), ""]
    elif solutions.closest is not None:
        missed = missed_text(solutions.task, solutions.task.distances(mechanism, solutions.closest))
        lines.append(f"The closest configuration that was found misses it by {missed}.")
    heading = f"With {solutions.task.node} there it also moves, in infinitely many configurations (self-motions):"
    lines += self_motion_lines(mechanism, solutions.self_motions, heading, mechanism.joints)
    if not every:
        others = "There may be others: --all lists all." if len(solutions) else "None was found within the limits."
        return [*lines, others]
    lines += textwrap.wrap(claim_text(solutions), _WIDTH)
    return lines + textwrap.wrap(solutions.certification, _WIDTH)


def _bases(solutions: IKSolutions) -> list[str]:
    """Return a line for each solution in which a floating base is not at home: its pose in the world."""
    import pinocchio as pin

    from cinegen.ik import FrameTask

    model, home = solutions.mechanism.model, solutions.mechanism.q_home
    if not solutions.mechanism.floating:
        return []
    poses = [model.jointPlacements[1] * pin.XYZQUATToSE3(q[:7]) for q in solutions]
    texts = [pose_text(FrameTask(model.names[1], pose)) for pose in poses]
    moved = [(q[:7] != home[:7]).any() for q in solutions]
    lines = [
        f"  {k:>8}  the base moves to {text}" for k, (text, is_) in enumerate(zip(texts, moved, strict=True), 1) if is_
    ]
    return ["", *lines, "  --fixed-base holds it."] if lines else []


def _table(solutions: IKSolutions) -> list[str]:
    """Return a heading and a line for each solution, with the values of the actuated joints, and of those passive ones
    in which solutions differ whose actuated joints are alike."""
    from cinegen.ik.solutions import distinguishing
    from cinegen.user_units import in_user_units, length_digits, rounded

    mechanism, cells = solutions.mechanism, dict[str, list[str]]()
    for joint in mechanism.joints:
        digits = length_digits() if mechanism.is_prismatic(joint) else 2
        numbers = [in_user_units(mechanism, joint, float(q[mechanism.q_index(joint)])) for q in solutions]
        cells[joint] = [f"{rounded(number, digits):.{digits}f}" for number, _ in numbers]
    columns = []
    for joint in distinguishing(cells, mechanism.actuated):
        column = [joint, in_user_units(mechanism, joint, 0.0)[1], *cells[joint]]
        width = max(map(len, column)) + 2
        columns.append([cell.rjust(width) for cell in column])
    notes = [limits_text(mechanism, q) for q in solutions]
    heads = ["  solution", "          ", *(f"  {k:>8}" for k in range(1, len(solutions) + 1))]
    ends = ["outside limits" if any(notes) else "", ""]
    for number, note in zip(solutions.coincident, notes, strict=True):
        ends.append("; ".join(filter(None, [f"{number} solutions coincide" if number > 1 else "", note])))
    rows = zip(heads, *columns, ends, strict=True)
    return [f"{''.join(row[:-1])}   {row[-1]}".rstrip() for row in rows]
