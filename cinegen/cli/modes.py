"""`cinegen modes`: all ways in which a closed mechanism can be assembled with its motors where they are."""

from __future__ import annotations

import argparse
import json
import math
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cinegen.cli.drive import of_page, show
from cinegen.cli.files import mechanisms, of_files, progress, write_figure
from cinegen.cli.values import meant, named, number, parts

if TYPE_CHECKING:
    import numpy as np
    import pinocchio as pin
    from numpy.typing import NDArray

    from cinegen.assembly import AssemblyModes
    from cinegen.ik import FrameTask
    from cinegen.model import Mechanism

_POSE = ("x", "y", "z", "rx", "ry", "rz")
_TYPED = 1e-4  # m and rad: poses are typed with some digits only
_BROAD = 100  # columns
_JOINED = "\xa0"  # a blank that no line breaks at
_TEMPO = 0.5  # modes a second


def add(commands: Any) -> None:
    """Adds the command."""
    modes = commands.add_parser(
        "modes", help="assembly modes: the ways to assemble a closed mechanism, its motors held",
        description="Lists the configurations of a closed mechanism for given values of its motors (the direct "
        "kinematics of a parallel robot), and says whether it is proved that these are all. Motors are at home, unless "
        "--lengths or --at says where. Lengths in mm, angles in degrees; as JSON, m and rad. Exit code 1 where none is "
        "found.",
    )  # fmt: skip
    # argparse takes "-10" for a value; so it does "-10,5,800" then.
    modes._negative_number_matcher = re.compile(r"-\.?\d")
    of_files(modes, count=1)
    where = modes.add_mutually_exclusive_group()
    where.add_argument(
        "--lengths", "--values", nargs="+", metavar="V",
        help="values of the motors, mm and degrees, in the file's order, such as 21.7 21.7 23.8 (or with commas); or "
        "of some by name, such as joint3=21.7, the others at home",
    )  # fmt: skip
    where.add_argument(
        "--at", nargs="+", metavar="POSE",
        help="the motors are where they bring the end to this pose: x,y,z[,rx,ry,rz] in mm and degrees, rx, ry, rz "
        "being roll, pitch and yaw as URDF has them (without them the orientation is left open); or some by name, such "
        "as x=10,rz=15, the others as at home. Of several ways there, one near home is taken",
    )  # fmt: skip
    modes.add_argument("--node", metavar="NAME", help="whose pose is meant and told (the robot's end)")
    modes.add_argument(
        "--method", default="auto", choices=["auto", "monodromy"],
        help="monodromy: as if nothing were known of the robot's family, to compare; it takes longer (%(default)s)",
    )  # fmt: skip
    modes.add_argument("--plot", metavar="FILE", help="draw all modes side by side: .png, .svg or .pdf")
    shown = modes.add_mutually_exclusive_group()
    shown.add_argument("--json", action="store_true", help="as JSON; a list where the file holds several robots")
    shown.add_argument("--view", action="store_true", help="walk through the modes in the page")
    of_page(modes.add_argument_group("with --view"))
    modes.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Prints them; draws and shows them."""
    found = mechanisms(options)
    if len(found) > 1 and (options.lengths or options.at or options.plot or options.view):
        from cinegen.errors import CinegenError

        names = ", ".join(mechanism.name for mechanism in found.values())
        raise CinegenError(f"{options.files[0]} holds several robots: name one by --robot ({names})")
    from cinegen.assembly import assembly_modes

    reports, every = [], True
    for name, mechanism in found.items():
        mechanism.frame_id(options.node or mechanism.end)  # refuses what there is not before it takes time
        values, asked = _motors(mechanism, options)
        with progress() as say:
            modes = assembly_modes(mechanism, values, options.method, say=say)
        if options.json:
            reports.append(modes.as_dict())
        else:
            print(("\n" if reports else "") + "\n".join(_told(name, modes, options.node, asked)))
            reports.append({})
        every = every and len(modes) > 0
        if options.plot:
            _draw(name, modes, options)
        if options.view and len(modes):
            return _walk(name, modes, options)
    if options.json:
        print(json.dumps(reports if len(reports) > 1 else reports[0], indent=1, ensure_ascii=False))
    return 0 if every else 1


# --- where the motors are ----------------------------------------------------------------------------------------


def _motors(mechanism: Mechanism, options: argparse.Namespace) -> tuple[NDArray[np.float64] | None, FrameTask | None]:
    """Values of the motors, rad and m, None for those of home; and the pose that --at asked for."""
    import numpy as np

    if options.lengths:
        return _values(mechanism, parts(options.lengths)), None
    if options.at:
        asked = _asked(mechanism, parts(options.at), options.node or mechanism.end)
        q = _reached(mechanism, asked)
        return np.array([q[mechanism.q_index(joint)] for joint in mechanism.actuated]), asked
    return None, None


def _values(mechanism: Mechanism, given: Sequence[str]) -> NDArray[np.float64]:
    """(motors,) rad and m, from --lengths.

    Raises:
        CinegenError: too many, too few or no numbers.
        UnknownNameError: no motor has that name.
    """
    import numpy as np

    from cinegen.errors import CinegenError, UnknownNameError
    from cinegen.plotting.words import said

    motors = mechanism.actuated
    home = {joint: float(mechanism.q_home[mechanism.q_index(joint)]) for joint in motors}
    by_name = named(given, "--lengths", f"{motors[0] if motors else 'joint1'}=100")
    if by_name is None:
        if len(given) != len(motors):
            listed = ", ".join(f"{joint} ({said(mechanism, joint, home[joint])} at home)" for joint in motors)
            values = f"{len(given)} value{'s' * (len(given) != 1)}"
            raise CinegenError(f"--lengths: {values} for the {len(motors)} motors of {mechanism.name}: {listed}")
        by_name = dict(zip(motors, (number(part, "--lengths") for part in given), strict=True))
    for joint, value in by_name.items():
        if joint not in home:
            raise UnknownNameError("motor", joint, tuple(motors))
        home[joint] = meant(mechanism, joint, value)
    return np.array([home[joint] for joint in motors])


def _asked(mechanism: Mechanism, given: Sequence[str], node: str) -> FrameTask:
    """What of a node --at wants to be where.

    Raises:
        CinegenError: it is no pose.
    """
    import numpy as np
    import pinocchio as pin

    from cinegen.errors import CinegenError, UnknownNameError
    from cinegen.ik import FrameTask
    from cinegen.plotting.words import place

    by_name = named(given, "--at", "x=10,rz=15")
    if by_name is None:
        if len(given) not in (3, 6):
            raise CinegenError(f"--at: a pose is x,y,z or x,y,z,rx,ry,rz in mm and degrees, not {len(given)} numbers")
        by_name = dict(zip(_POSE, (number(part, "--at") for part in given), strict=False))
    pose = place(mechanism.placement(mechanism.q_home, node))
    for coordinate, value in by_name.items():
        if coordinate not in _POSE:
            raise UnknownNameError("coordinate", coordinate, _POSE)
        pose[_POSE.index(coordinate)] = value
    turned = any(coordinate in by_name for coordinate in _POSE[3:])
    target = pin.SE3(pin.rpy.rpyToMatrix(np.radians(pose[3:])), pose[:3] / 1e3)
    return FrameTask(node, target, rotation=3 if turned else 0)


def _reached(mechanism: Mechanism, asked: FrameTask) -> NDArray[np.float64]:
    """(nq,) with a node where it should be, within limits if that can be had, and near home.

    Raises:
        CinegenError: it can't be reached; says by how much it is missed.
    """
    from cinegen.errors import CinegenError
    from cinegen.ik import inverse_kinematics
    from cinegen.plotting.words import place

    for limits in (True, False):  # a mode that limits forbid is a mode all the same, and said to be outside
        found = inverse_kinematics(mechanism, [asked], mechanism.q_home, tolerance=_TYPED, limits=limits)
        if found:
            return found.q
    numbers = [f"{name} {value:g}" for name, value in zip(_POSE, place(asked.target), strict=True)]
    where, missed = f"{', '.join(numbers[:3])} mm", f"{1e3 * found.errors[0][0]:.4g} mm"
    if asked.rotation:
        where += f", {', '.join(numbers[3:])} degrees"
        missed += f" and {math.degrees(found.errors[0][1]):.4g} degrees"
    raise CinegenError(
        f"{mechanism.name}: {asked.node} can't be brought to {where}, limits or not: the nearest that was found misses "
        f"it by {missed}"
    )


# --- what is told ------------------------------------------------------------------------------------------------


def _told(name: str, modes: AssemblyModes, node: str | None, asked: FrameTask | None) -> list[str]:
    """Lines: what was asked, a table, and what it is worth."""
    import textwrap

    from cinegen.plotting.words import said

    mechanism, count = modes.mechanism, len(modes)
    node = node or mechanism.end
    many = "no assembly mode" if not count else f"{count} assembly mode{'s' * (count != 1)}"
    motors = zip(mechanism.actuated, modes.actuated, strict=True)
    values = [f"{joint} {said(mechanism, joint, float(value))}".replace(" ", _JOINED) for joint, value in motors]
    lines = [f"{name}: robot '{mechanism.name}', {many}" + (f"; where {node} is, mm and degrees:" if count else "")]
    wrapped = textwrap.wrap(f"motors: {', '.join(values)}", _BROAD, initial_indent="  ", subsequent_indent="    ")
    lines += [line.replace(_JOINED, " ") for line in wrapped]
    lines += ["", *_table(modes, node, asked), ""] if count else [""]
    if modes.closest is not None:
        lines += textwrap.wrap(f"The nearest to one: {modes.closest.words}.", _BROAD - 2)
    worth = {
        (True, True): "These are all.", (True, False): "There is none.",
        (False, True): "There may be more.", (False, False): "None was found.",
    }[modes.complete, count > 0]  # fmt: skip
    lines += textwrap.wrap(f"{worth} {_sentence(modes.method)}", _BROAD - 2)
    return lines


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:] + ("" if words.endswith(".") else ".")


def _table(modes: AssemblyModes, node: str, asked: FrameTask | None) -> list[str]:
    """A line for each mode, below a heading."""
    import numpy as np

    from cinegen.plotting.skeleton import Skeleton
    from cinegen.plotting.words import place, quiet

    mechanism = modes.mechanism
    places = np.array([place(placement) for placement in modes.placements(node)])
    heads = ["x", "y", "z", "roll", "pitch", "yaw"]
    columns = list(range(6))
    plane = Skeleton(mechanism, node).plane
    if plane is not None and abs(plane[2]) > 1.0 - 1e-9 and np.abs(places[:, 3:5]).max() < 1e-6:
        columns = [0, 1, 5]  # all that moves in a plane x, y
    marks = [asked is not None and _is_at(asked, placement) for placement in modes.placements(node)]
    notes = [_limits(mechanism, q) for q in modes]
    head = "".join(f"{heads[c]:>11}" if c < 3 else f"{heads[c]:>9}" for c in columns)
    lines = [f"  mode {head}   {'outside limits' if any(notes) else ''}".rstrip()]
    for k, (row, count) in enumerate(zip(places, modes.coincident, strict=True)):
        cells = "".join(f"{quiet(row[c], 3):11.3f}" if c < 3 else f"{quiet(row[c], 2):9.2f}" for c in columns)
        said = [f"{count} solutions meet"] * (count > 1) + [notes[k]] * bool(notes[k])
        lines.append(f"  {k + 1:>4}{'*' if marks[k] else ' '}{cells}   {'; '.join(said)}".rstrip())
    return [*lines, "", "  * as asked"] if any(marks) else lines


def _is_at(asked: FrameTask, placement: pin.SE3) -> bool:
    """Whether a node is where it should be, as exactly as that was typed."""
    import numpy as np

    straight, turn = asked.errors(placement, asked.target.rotation)
    return bool(np.linalg.norm(straight) <= 2.0 * _TYPED and np.linalg.norm(turn) <= 2.0 * _TYPED)


def _limits(mechanism: Mechanism, q: NDArray[np.float64]) -> str:
    """The first joint that is outside its limits, and how many others are; nothing where all are inside."""
    from cinegen.plotting.words import quiet, shown

    beyond, there = mechanism.limits.outside(q), mechanism.limits.unwound(q)
    if not beyond:
        return ""
    joint, limit = next(iter(beyond.items()))
    value = float(there[mechanism.q_index(joint)])
    numbers = (f"{quiet(shown(mechanism, joint, one)[0], 1):g}" for one in (value, limit))
    words = f"{joint} {(' < ' if value < limit else ' > ').join(numbers)}"
    return words + (f", {len(beyond) - 1} more" if len(beyond) > 1 else "")


# --- pictures ----------------------------------------------------------------------------------------------------


def _draw(name: str, modes: AssemblyModes, options: argparse.Namespace) -> None:
    from cinegen.plotting import draw_modes

    path = Path(options.plot)
    write_figure(path, draw_modes(modes, options.node, name))
    if not options.json:
        print(f"picture: {path.resolve()}")


def _walk(name: str, modes: AssemblyModes, options: argparse.Namespace) -> int:
    """Shows the modes in the page, one after the other."""
    from cinegen.mission.results import record_modes
    from cinegen.session import replayed

    with tempfile.TemporaryDirectory(prefix="cinegen-") as folder:
        recording = Path(folder) / f"{name}-modes.jsonl"
        record_modes(modes, recording, name)
        stops = [(float(k + 1), f"mode {k + 1} of {len(modes)}") for k in range(len(modes))]
        stops[0] = (0.0, stops[0][1])
        return show(replayed(recording, _TEMPO, stops), options, f"{name}-modes")
