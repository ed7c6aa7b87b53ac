"""`cinegen modes`: all assembly modes of a closed mechanism with its actuated joints at given values."""

from __future__ import annotations

import tempfile
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cinegen.cli.files import check_outputs, print_result, write_figure
from cinegen.cli.motion.ik import TYPED, claim_text, limits_text, missed_text, pose_task, pose_text, self_motion_lines
from cinegen.cli.numbers import UNITS, parts, values
from cinegen.cli.options import FILE, JSON, NODE, PLOT, VIEW, ShownRobotOptions, exclude
from cinegen.cli.progress import Progress
from cinegen.cli.served_page import PageOptions
from cinegen.errors import CinegenError, UnknownNameError
from raff2urdf.command.command_line import option
from raff2urdf.errors import counted
from raff2urdf.quantities import LENGTH, shown_scale

if TYPE_CHECKING:
    import pinocchio as pin

    from cinegen.arrays import Array
    from cinegen.assembly import AssemblyModes
    from cinegen.ik import FrameTask
    from cinegen.model import Mechanism

_WIDTH = 100  # columns
_JOINED = "\xa0"  # a blank at which no line is broken
_SPEED = 0.5  # modes per second


def run(
    robots: ShownRobotOptions,
    page: PageOptions,
    file: Path = FILE,
    lengths: str | None = option(
        "VALUES",
        "values of the actuated joints in the order of the file, such as 21.7mm,21.7mm,23.8mm; or of some by name: "
        f"joint3=21.7mm, the others as at home ({UNITS})",
        None,
        "--values",
    ),
    at: str | None = option(
        "POSE",
        "solve for the actuated joints with the node at x,y,z[,rx,ry,rz] (roll, pitch, yaw as in URDF; without them "
        "any orientation); or some by name: x=0.01,rz=15, the others as at home. If several solutions exist, the first "
        f"that a search from home finds is used ({UNITS})",
    ),
    node: str | None = NODE,
    method: Literal["auto", "monodromy"] = option(
        None, "monodromy ignores what is known of the robot's family: for comparison, and slower", "auto"
    ),
    plot: Path | None = PLOT,
    json: bool = JSON,
    view: bool = VIEW,
) -> int:
    """List the assembly modes of a closed mechanism.

    Lists all configurations for given values of the actuated joints, home unless --values or --at gives others (the
    direct kinematics of a parallel robot), and reports whether these are all, and whether that is proved. The exit
    code is 1 if there is none.
    """
    exclude(values=lengths, at=at)
    exclude(json=json, view=view)
    check_outputs(plot, force=page.force, json=json)
    single = lengths or at or plot or view
    loaded = dict([robots.load_one(file)]) if single else {key: pair[0] for key, pair in robots.load([file]).items()}
    from cinegen.assembly import assembly_modes

    reports: list[dict[str, Any]] = []
    every = True
    for name, mechanism in loaded.items():
        mechanism.frame_id(node or mechanism.end)  # refuses an unknown node before anything takes time
        asked = None if at is None else pose_task(mechanism, at, node or mechanism.end)
        actuated = _solved(mechanism, asked) if asked else None if lengths is None else _values(mechanism, lengths)
        with Progress() as progress:
            modes = assembly_modes(mechanism, actuated, method, report=progress.text)
        text = ("\n" if reports else "") + "\n".join(_lines(name, modes, node, asked))
        reports.append(modes.as_dict())
        every = every and len(modes) > 0
        if not json:
            print(text)
        if plot:
            from cinegen.plotting import draw_modes

            write_figure(plot, draw_modes(modes, node, name), quiet=json)
        if view and len(modes):
            return _show(name, modes, page)
    if json:
        print_result(reports, None, json)
    return 0 if every else 1


# --- the actuated joints -----------------------------------------------------------------------------------------


def _values(mechanism: Mechanism, text: str) -> Array:
    """Return the values (n,) of the actuated joints, rad and m, from --values.

    Raises:
        CinegenError: too many, too few or no numbers.
        UnknownNameError: there is no such actuated joint.
    """
    import numpy as np

    from cinegen.user_units import value_text

    joints = mechanism.actuated
    home = {joint: float(mechanism.q_home[mechanism.q_index(joint)]) for joint in joints}
    numbers = parts(text)
    if not any("=" in part for part in numbers):
        if len(numbers) != len(joints):
            listed = ", ".join(f"{joint} ({value_text(mechanism, joint, home[joint])} at home)" for joint in joints)
            number = f"{counted(len(numbers), 'value')} for the {counted(len(joints), 'actuated joint')}"
            raise CinegenError(f"--values: {number} of {mechanism.name}: {listed}")
        text = ",".join(f"{joint}={value}" for joint, value in zip(joints, numbers, strict=True))
    for joint, value in values(text, "--values", f"{next(iter(joints), 'joint1')}=0.1", mechanism).items():
        if joint not in home:
            raise UnknownNameError("actuated joint", joint, tuple(joints))
        home[joint] = value
    return np.array([home[joint] for joint in joints])


def _solved(mechanism: Mechanism, asked: FrameTask) -> Array:
    """Return the values (n,) of the actuated joints with a node at its target, within limits if possible, near home.

    Raises:
        CinegenError: the target can't be reached; the message has the remaining distance.
    """
    import numpy as np

    from cinegen.ik import inverse_kinematics

    for limits in (True, False):  # a mode beyond limits is a mode, and listed as such
        solution = inverse_kinematics(mechanism, [asked], mechanism.q_home, tolerance=TYPED, limits=limits)
        if solution:
            return np.array([solution.q[mechanism.q_index(joint)] for joint in mechanism.actuated])
    raise CinegenError(
        f"{mechanism.name}: {asked.node} can't reach {pose_text(asked)}, even beyond joint limits: the closest pose "
        f"found misses it by {missed_text(asked, solution.errors[0])}"
    )


# --- the result --------------------------------------------------------------------------------------------------


def _lines(name: str, modes: AssemblyModes, node: str | None, asked: FrameTask | None) -> list[str]:
    from cinegen.user_units import value_text

    mechanism, node = modes.mechanism, node or modes.mechanism.end
    number = counted(len(modes), "assembly mode") if len(modes) else "no assembly mode"
    joints = zip(mechanism.actuated, modes.actuated, strict=True)
    texts = [f"{joint} {value_text(mechanism, joint, float(value))}".replace(" ", _JOINED) for joint, value in joints]
    heading = f"{name}: robot '{mechanism.name}', {number}" + (
        f"; pose of {node}, {shown_scale(LENGTH)[1]} and degrees:" * bool(len(modes))
    )
    wrapped = textwrap.wrap(f"actuated: {', '.join(texts)}", _WIDTH, initial_indent="  ", subsequent_indent="    ")
    lines = [heading, *(line.replace(_JOINED, " ") for line in wrapped), ""]
    lines += [*_table(modes, node, asked), ""] if len(modes) else []
    passive = [joint for joint in mechanism.joints if joint not in mechanism.actuated]
    more = "With its actuated joints locked it also moves, in infinitely many configurations (self-motions):"
    lines += self_motion_lines(mechanism, modes.self_motions, more, passive)
    if modes.closest is not None:
        lines += textwrap.wrap(f"The closest configuration: {modes.closest.message}.", _WIDTH - 2)
    lines += textwrap.wrap(claim_text(modes), _WIDTH - 2)
    return lines + textwrap.wrap(modes.certification, _WIDTH - 2)


def _table(modes: AssemblyModes, node: str, asked: FrameTask | None) -> list[str]:
    """Return a heading and a line for each mode."""
    import numpy as np

    from cinegen.model.motion_plane import motion_plane
    from cinegen.user_units import length_digits, pose_numbers, rounded

    placements = modes.placements(node)
    poses = np.array([pose_numbers(placement) for placement in placements])
    heads = ["x", "y", "z", "roll", "pitch", "yaw"]
    columns = list(range(6))
    plane = motion_plane(modes.mechanism)
    if plane is not None and abs(plane[2]) > 1.0 - 1e-9 and np.abs(poses[:, 3:5]).max() < 1e-6:
        columns = [0, 1, 5]  # the coordinates of a planar motion in x, y
    marks = [asked is not None and _is_at(asked, placement) for placement in placements]
    notes, digits = [limits_text(modes.mechanism, q) for q in modes], length_digits()
    head = "".join(f"{heads[c]:>11}" if c < 3 else f"{heads[c]:>9}" for c in columns)
    lines = [f"  mode {head}   {'outside limits' if any(notes) else ''}".rstrip()]
    for k, (row, number) in enumerate(zip(poses, modes.coincident, strict=True)):
        cells = "".join(
            f"{rounded(row[c], digits):11.{digits}f}" if c < 3 else f"{rounded(row[c], 2):9.2f}" for c in columns
        )
        coincide = f"{number} solutions coincide" if number > 1 else ""
        note = "; ".join(filter(None, [coincide, "" if modes.isolated[k] else "on a self-motion", notes[k]]))
        lines.append(f"  {k + 1:>4}{'*' if marks[k] else ' '}{cells}   {note}".rstrip())
    return [*lines, "", "  * the pose of --at"] if any(marks) else lines


def _is_at(asked: FrameTask, placement: pin.SE3) -> bool:
    """Return whether a node is at its target, as exactly as that was typed."""
    import numpy as np

    return all(float(np.linalg.norm(error)) <= 2.0 * TYPED for error in asked.errors(placement, asked.target.rotation))


def _show(name: str, modes: AssemblyModes, page: PageOptions) -> int:
    """Show the modes in the page, one after the other."""
    from cinegen.mission.results import record_modes
    from cinegen.session import replay_setup

    with tempfile.TemporaryDirectory(prefix="cinegen-") as folder:
        recording = Path(folder) / f"{name}-modes.jsonl"
        record_modes(modes, recording, name)
        stops = [(float(k + 1) if k else 0.0, f"mode {k + 1} of {len(modes)}") for k in range(len(modes))]
        return page.show(replay_setup(recording, _SPEED, stops), f"{name}-modes")
