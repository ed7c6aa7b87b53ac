"""Load files into a `Mechanism`. RAFF goes through the URDF and the constraints that raff2urdf writes, so that a RAFF
file and its conversion are the same mechanism, bit for bit."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pinocchio as pin

import raff2urdf
from cinegen.errors import ClosureError, LoadError, UnknownNameError, warn
from cinegen.loops.clusters import subsystems
from cinegen.model.build import build, degrees_of_freedom
from cinegen.model.group_state import with_home
from cinegen.model.mechanism import Mechanism
from cinegen.model.plausible import doubts
from cinegen.model.urdf import declared_joints, with_fixed_base, with_joints
from raff2urdf import closure, readers
from raff2urdf.coupling import Coupling
from raff2urdf.errors import RaffError, raised_as
from raff2urdf.loops.mobility import loop_kind, loop_kinds
from raff2urdf.loops.slips import Fault
from raff2urdf.placement import rotation
from raff2urdf.raff import closing_edits as raff_edits
from raff2urdf.raff.document import LoopKind
from raff2urdf.readers import closing_edits as urdf_edits
from raff2urdf.readers.json_lines import line_of
from raff2urdf.readers.loops.declaration import IgnoreList
from raff2urdf.readers.loops.sidecar import constraints_of
from raff2urdf.readers.options import ReadOptions
from raff2urdf.readers.srdf import Srdf, read_srdf, srdf_of
from raff2urdf.readers.urdf_file import parse
from raff2urdf.readers.xml_file import read_text
from raff2urdf.shipped import find_robot

if TYPE_CHECKING:  # takes half a second
    from yourdfpy import URDF


def load(
    path: str | Path | URDF | pin.Model,
    robot: str | None = None,
    loops: Mapping[str, str] | Sequence[pin.RigidConstraintModel] | None = None,
    ignore_loops: bool = False,
    ignore: Sequence[str] = (),
    relax: bool | None = None,
    srdf: str | Path | None = None,
    fixed_base: bool = False,
    couplings: Sequence[Coupling] = (),
    actuated: Sequence[str] | None = None,
    packages: Mapping[str, str | Path] | None = None,
    xacro_args: Mapping[str, str] | None = None,
    swap_limits: bool = False,
) -> Mechanism:
    """Load a mechanism and close its loops.

    Args:
        path: a RAFF file, URDF or xacro, SDF or MJCF, or the name of a shipped robot, such as "delta4". Loops and
            couplings of a URDF are read in all dialects of `raff2urdf.readers.loops`, also from files next to it:
            `<stem>.constraints.json`, `robot.yaml`, `loop_closures.yaml`. Or a `yourdfpy.URDF`, which has links, joints
            and `<mimic>`, but no loops: nothing else that its file declares. Errors name lines of its XML. Or the text
            of a RAFF file, URDF, SDF or MJCF: a string that begins with `<` or has several lines; meshes are searched
            from the current folder, and nothing is next to it. A `Path` is never a text. Or a `pinocchio.Model` of
            revolute, prismatic and spherical joints and a free flyer at the root.
        robot: name of one robot of a file that holds several; the first unless given.
        loops: kinds of closure (rigid, prismatic, revolute, ball) that replace those of the file, by the loop's name.
            Of a `pinocchio.Model`, its loops: `pinocchio.RigidConstraintModel` of the types CONTACT_6D (rigid) and
            CONTACT_3D (ball).
        ignore_loops: leave out all loops and couplings, also those that can't be read. Every joint is actuated then,
            and one warning lists what was left out.
        ignore: loops and couplings to be left out, by name or by element, such as "pin" or "loop_joint"; or files next
            to a URDF, such as "robot.yaml".
        relax: what is done with loops that are nearly redundant, because numbers are rounded. None: their geometry is
            healed, by changes as small as rounding (`cinegen.model.healing.heal`); where that fails, they are closed by
            weaker joints. True: weaker joints are tried first; they may add to mobility. One warning reports what was
            done. False: they stay as written; then they can't be closed, or hardly move.
        srdf: an SRDF, which names pairs of links that are not checked against each other, and the home of a URDF
            whose sidecar file states none. By default the one next to a URDF, `<stem>.srdf`, unless `ignore` names it.
        fixed_base: hold a floating base where the file places it: nothing moves it then, and q does not contain its
            pose. Robots without one are loaded as they are.
        couplings: of a `pinocchio.Model`, equations between its joints.
        actuated: names of the actuated joints, in place of those that the file states or that are chosen.
        packages: folders of ROS packages by name, where `package://NAME` and `$(find NAME)` are searched first.
        xacro_args: arguments of a file in xacro, by name.
        swap_limits: exchange lower and upper limits of a URDF where the lower one is above the upper one; one warning
            lists the joints. Otherwise such a URDF is refused.

    Raises:
        raff2urdf.RaffError: the RAFF file, or the constraints, are wrong: where and why. The folder of a package does
            not exist; `packages`, `xacro_args` or `swap_limits` have no effect on the file.
        ClosureError: the loops can't be closed; names them, their gaps, and what would close them.
        LoadError: the URDF, SDF, MJCF or robot.yaml is wrong: where and why. It declares a loop or a coupling that
            can't be read, and that is not ignored. An SRDF is wrong, or names links that the robot does not have.
        UnknownNameError: no such loop, or no such joint.
    """
    arguments: dict[str, Any] = {"robot": robot, "ignore_loops": ignore_loops, "ignore": ignore, "srdf": srdf}
    if isinstance(path, pin.Model):
        reading = {"packages": packages, "xacro_args": xacro_args, "swap_limits": swap_limits}
        for option, value in (arguments | reading).items():
            if value:
                raise LoadError(f"{option} has no effect on a pinocchio.Model: leave it out")
        return _load_model(path, () if loops is None else loops, couplings, actuated, relax, fixed_base)
    options = ReadOptions(packages or {}, xacro_args or {}, swap_limits)
    if couplings or not isinstance(loops, Mapping | None):
        name = readers.TEXT if readers.is_text(path) else path
        raise LoadError(f"{name}: a file declares its loops and couplings: give them with a pinocchio.Model only")
    arguments |= {"loops": loops, "relax": relax, "fixed_base": fixed_base, "actuated": actuated}
    mechanism = load_with(options, path, **arguments)
    options.check(mechanism.source.name)
    return mechanism


@dataclass(frozen=True)
class _Settings:
    """Arguments of `load` that concern a file, and how it is read."""

    reading: ReadOptions
    robot: str | None = None
    loops: Mapping[str, str] | None = None
    ignore_loops: bool = False
    ignore: Sequence[str] = ()
    relax: bool | None = None
    srdf: str | Path | None = None
    fixed_base: bool = False
    actuated: Sequence[str] | None = None


def load_with(options: ReadOptions, path: str | Path | URDF, **arguments: Any) -> Mechanism:
    """Load a mechanism as `load` does with these arguments, without checking that the options of how its file is read
    have an effect: `options.check` does so, for all files that were loaded with them."""
    settings = _Settings(options, **arguments)
    text = path if isinstance(path, str) and readers.is_text(path) else None
    path = path if text is None else Path(readers.TEXT)
    objects = sys.modules.get("yourdfpy")
    if text is None and (objects is None or not isinstance(path, objects.URDF)):
        path = find_robot(path)
    if settings.loops and settings.ignore_loops:
        name = next(iter(settings.loops))
        raise LoadError(f"{path}: a kind is given for loop '{name}', but all are to be ignored: leave one out")
    if not isinstance(path, Path) or (readers.holds_xml(path) if text is None else text.lstrip().startswith("<")):
        return _load_xml(path, text, settings)
    return _load_raff(path, text, settings)


def _load_raff(path: Path, text: str | None, settings: _Settings) -> Mechanism:
    """Load a RAFF file, or its text."""
    from raff2urdf.conversion import describe
    from raff2urdf.raff.reader import parse as parse_raff
    from raff2urdf.raff.reader import read

    document = parse_raff(read(path) if text is None else text, str(path))
    raff2urdf.check(document)
    chosen = document.robot(settings.robot)
    for name in settings.loops or {}:
        if name not in chosen.loop_names:
            raise UnknownNameError("loop", name, chosen.loop_names)
    described = readers.Description(*describe(document, chosen, path.parent, settings.loops))
    ignores_all = settings.ignore_loops and bool(chosen.loops or chosen.couplings)
    ignore = IgnoreList(settings.ignore)
    if ignores_all:
        ignore.takes(*chosen.loop_names, *chosen.coupling_names)
        ignore.check(str(path))
    described = readers.checked(described, path, ignore, ignores_all)
    declared = described.constraints or {}
    kept = {entry["name"] for key in ("loops", "couplings") for entry in declared.get(key, [])}
    named = zip(chosen.loop_names, chosen.loops, strict=True)
    coupled = zip(chosen.coupling_names, chosen.couplings, strict=True)
    chosen = replace(
        chosen,
        loops=tuple(loop for name, loop in named if name in kept),
        couplings=tuple(coupling for name, coupling in coupled if name in kept),
    )
    urdf, constraints, disabled, _ = _prepared(described.urdf, declared, settings, str(path), settings.srdf)
    slips = partial(raff_edits.slips_of, document, chosen, loop_kinds(chosen, settings.loops))
    return _made(partial(build, urdf, constraints, name=str(path), srdf=disabled, relax=settings.relax), slips)


def robots(path: str | Path) -> list[str | None]:
    """Return the names of the robots in a file; `[None]` where it can hold but one, or none has a name.

    Raises:
        raff2urdf.RaffError: the file is wrong.
    """
    path = find_robot(path)
    if readers.holds_xml(path):
        return [None]
    return [robot.name for robot in raff2urdf.load(path).robots] or [None]


def _load_xml(source: Path | URDF, text: str | None, settings: _Settings) -> Mechanism:
    """Load a URDF with its sidecar files, an SDF, an MJCF, a text of one of these, or a `yourdfpy.URDF`."""
    loops, reading = settings.loops or {}, settings.reading
    robot, ignore_loops, ignore = settings.robot, settings.ignore_loops, settings.ignore
    path = source if isinstance(source, Path) else Path(f"yourdfpy.URDF '{source.robot.name}'")
    sidecar = srdf_of(path) if path is source and text is None else None
    if sidecar is not None and (left_out := sidecar.name) in ignore:
        sidecar, ignore = None, [word for word in ignore if word != left_out]
    with raised_as(LoadError, raff2urdf.RaffError):
        folder = path.parent if text is None else Path.cwd()
        if not isinstance(source, Path):
            from raff2urdf.writers.urdf_object import ExactUrdf

            written = ExactUrdf(source.robot, source._filename_handler)
            robot, text, folder = None, written.text(), written.folder
        parsed = readers.read(path, robot, ignore_loops, ignore, reading, text)
    entries = {entry["name"]: entry for entry in parsed.constraints["loops"]} if parsed.constraints else {}
    balls = {name for name, entry in entries.items() if entry["kind"] == "ball"}
    for name, kind in loops.items():
        if name not in entries:
            raise UnknownNameError("loop", name, tuple(entries))
        entries[name]["kind"] = loop_kind(kind).name.lower()
    srdf = sidecar if settings.srdf is None else settings.srdf
    urdf, stated, disabled, remarks = _prepared(parsed.urdf, parsed.constraints, settings, str(path), srdf)
    packages = tuple((name, str(folder)) for name, folder in reading.search.folders.items())
    make = partial(
        build, urdf, stated, str(folder), str(path), parsed.dialects, (*parsed.notes, *remarks), disabled,
        packages=packages, relax=settings.relax, is_driven=parsed.is_driven and settings.actuated is None,
    )  # fmt: skip
    dialect = "".join(parsed.dialects)
    slips = None if stated is None else partial(urdf_edits.slips_of, urdf, stated, str(path), dialect)
    mechanism = _made(make, slips, [note for note in parsed.notes if " has another parent" in note])
    if stated and not loops:
        _check_stated(mechanism, stated, path)
    for name, kind in loops.items():
        if name in balls and loop_kind(kind) is LoopKind.REVOLUTE:
            _check_hinge(mechanism, name, path)
    _warn_of_doubts(mechanism, path)
    return mechanism


def _warn_of_doubts(mechanism: Mechanism, path: Path) -> None:
    """Warn of numbers of a robot that are probably mistakes; those of a RAFF file are checked by raff2urdf."""
    for doubt in doubts(mechanism):
        warn(f"{path}: {doubt}")
    for link, why in list(mechanism.unphysical.items())[:1]:
        more = f" (and {len(mechanism.unphysical) - 1} more links)" if len(mechanism.unphysical) > 1 else ""
        warn(f"{path}: link '{link}' has an inertia that no body can have: {why}; no forces can be computed{more}")


def _made(
    make: Callable[..., Mechanism], slips: Callable[[Fault], str | None] | None, cut: Sequence[str] = ()
) -> Mechanism:
    """Return a mechanism that is made of a file; a warning names the edit with which its loops are closed as written,
    or move.

    Args:
        make: builds it, given `slips`.
        slips: returns the edit that repairs a fault as text, if there is one.
        cut: joints of which the file does not state that they close loops.

    Raises:
        ClosureError: the loops can't be closed.
    """
    try:
        mechanism = make(slips=slips)
    except ClosureError as error:
        edit = None if slips is None else slips(Fault.OPEN)
        if cut and edit is None:
            edit = f"{'; '.join(cut)}: if no loop is meant, remove one of the two joints"
        if edit is None:
            raise
        raise ClosureError(f"{error}\n  {edit}") from None
    if mechanism.loops and mechanism.joints and mechanism.mobility == 0:
        rows, joints = mechanism.structure.system.rows, mechanism.model.nv
        what = f"{rows} equations of loops and couplings, of rank {mechanism.loop_rank}, hold all {joints} joints"
        edit = None if slips is None else slips(Fault.FROZEN)
        message = "; ".join(filter(None, [f"no joint can move: {what}", edit]))
        warn(f"{mechanism.source.name}: robot '{mechanism.name}': {message}")
    return mechanism


def _load_model(
    model: pin.Model, loops: Any, couplings: Sequence[Coupling], actuated: Sequence[str] | None, relax: bool | None,
    fixed_base: bool,
) -> Mechanism:  # fmt: skip
    """Load a model that a program has built."""
    from cinegen.model.pinocchio_model import describe_model

    name = f"pinocchio.Model '{model.name}'"
    urdf, values, notes = describe_model(model, loops, couplings)
    settings = _Settings(ReadOptions(), fixed_base=fixed_base, actuated=actuated)
    urdf, constraints, *_ = _prepared(urdf, values, settings, name, None)
    mechanism = build(urdf, constraints, name=name, notes=notes, relax=relax)
    if list(mechanism.model.names)[1:] != list(model.names)[1:]:
        warn(f"{name}: q has other joints than the model's, or in another order: mechanism.q_index finds each")
    return mechanism


def _prepared(
    urdf: str, constraints: Mapping[str, Any] | None, settings: _Settings, name: str, srdf: str | Path | None
) -> tuple[str, Mapping[str, Any] | None, Srdf | None, list[str]]:
    """Return a URDF and its constraints with the base, home and actuated joints that are asked for, what an SRDF
    disables, and notes.

    Raises:
        LoadError: the SRDF can't be read, or names other links.
        UnknownNameError: there is no such joint.
    """
    if settings.fixed_base:
        urdf, constraints = with_fixed_base(urdf, constraints, name)
    disabled, remarks = None, list[str]()
    if srdf is not None:
        with raised_as(LoadError, RaffError):
            tree = parse(urdf, name)
            links = [str(link.get("name")) for link in tree.iter("link")]
            disabled = read_srdf(Path(srdf), links, f"robot '{tree.get('name', '')}'", settings.reading)
        constraints, remarks = with_home(urdf, constraints, Path(srdf), name, settings.reading)
    if settings.actuated is not None:
        declared = declared_joints(urdf, constraints, name)
        for joint in settings.actuated:
            if joint not in declared:
                raise UnknownNameError("joint", joint, tuple(declared))
        stated = {joint: {"actuated": joint in settings.actuated} for joint in declared}
        constraints = with_joints(constraints, declared, stated)
    return urdf, constraints, disabled, remarks


def _check_stated(mechanism: Mechanism, constraints: Mapping[str, Any], path: Path) -> None:
    """Compare the degrees of freedom that a URDF's constraints state with those of the mechanism.

    Raises:
        LoadError: they differ.
    """
    for key, value in degrees_of_freedom(mechanism.structure.system, mechanism.loop_rank).items():
        if constraints.get(key) not in (None, value):
            file = constraints_of(path)
            where = f"{file}:{line_of(read_text(file), [key])}" if file.is_file() else f"{path}: raff:robot"
            why = f"{constraints[key]} is stated, but the URDF with these loops has {value}"
            raise LoadError(
                f"{where}: at $.{key}: {why}: correct the number, or restore the joints and loops it was counted for"
            )


def _check_hinge(mechanism: Mechanism, name: str, path: Path) -> None:
    """Check the axis of a hinge in the place of a ball joint, whose frames need not have z along it.

    Raises:
        LoadError: as a hinge about z the loop takes DoF that it leaves as a ball joint, and about x or y none.
    """
    for cluster, at in subsystems(mechanism.structure.system):
        index = next((i for i, loop in enumerate(cluster.loops) if loop.name == name), None)
        if index is None:
            continue
        q, kinds = mechanism.q_home[at], list(cluster.kinds)
        kinds[index] = LoopKind.BALL
        free = closure.generic_rank(cluster.with_kinds(kinds), q)[0]
        taken = closure.generic_rank(cluster, q)[0] - free
        for axis, turn in _TURNS.items() if taken > 0 else ():
            other = cluster.with_moved({index: (turn, turn)})
            closing = closure.close(other, q)
            if closing.closed and closure.generic_rank(other, closing.q)[0] == free:
                first, second = cluster.ends[index]
                rpy = "0 1.5707963267948966 0" if axis == "x" else "-1.5707963267948966 0 0"
                raise LoadError(
                    f"{path}: loop '{name}' as a hinge about the z axes of {first} and {second} takes {taken} DoF of "
                    f"the mechanism that it leaves about their {axis} axes, as other joints are: turn both frames by "
                    f'rpy="{rpy}", or leave the ball joint'
                )


_TURNS = {"x": rotation((0.0, 1.0, 0.0), math.pi / 2.0), "y": rotation((1.0, 0.0, 0.0), -math.pi / 2.0)}
"""Rotations that take z to x and to y."""
