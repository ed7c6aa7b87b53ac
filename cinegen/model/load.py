"""Files -> `Mechanism`. RAFF goes through the URDF and the constraints that raff2urdf writes, so that a RAFF file and
its conversion are the same mechanism, bit for bit."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import raff2urdf
from cinegen.errors import CinegenWarning, ClosureError, LoadError, UnknownNameError
from cinegen.loops.closed_loops import Loop
from cinegen.model.mechanism import Mechanism, Source
from cinegen.model.urdf import completed, kinematics, simple
from raff2urdf import constraints as beside
from raff2urdf import readers
from raff2urdf.analysis import loop_kind
from raff2urdf.closure import Closing, close, close_from_afar, generic_rank, passive, why_open
from raff2urdf.json_lines import line_of
from raff2urdf.readers.sidecar import constraints_of
from raff2urdf.readers.urdf import UNLIMITED, joints, parse
from raff2urdf.readers.xml_file import read_text
from raff2urdf.tree import characteristic_length

Array = NDArray[np.float64]

_MOST = 400
"""Joints that may move: for so many, Pinocchio wants 3.5 GB of memory."""


def load(
    path: str | Path,
    robot: str | None = None,
    loops: Mapping[str, str] | None = None,
    ignore_loops: bool = False,
) -> Mechanism:
    """Loads a mechanism and closes its loops.

    Args:
        path: a RAFF file, URDF, SDF or MJCF. What a URDF can't say is read from a file beside it:
            `<stem>.constraints.json` as raff2urdf writes it, or `robot.yaml` as Gepetto's example-parallel-robots has
            it.
        robot: which robot of a file that holds several; the first unless said.
        loops: other kinds of closure (rigid, prismatic, revolute, ball) for some loops, by name.
        ignore_loops: leave all loops open, those too that a URDF declares in elements that are not read. Every joint is
            actuated then, and one warning lists what was left out.

    Raises:
        raff2urdf.RaffError: the RAFF file, or the constraints, are wrong: where and why.
        ClosureError: the loops can't be closed; says which stay open, by how much, and what would close them.
        LoadError: the URDF, SDF, MJCF or robot.yaml is wrong: where and why. A URDF declares loops or couplings that
            are not read, and `ignore_loops` is false.
        UnknownNameError: no such loop.
    """
    path = Path(path)
    if loops and ignore_loops:
        raise LoadError(
            f"{path}: a kind is asked for loop '{next(iter(loops))}', but all are to be ignored: leave one out"
        )
    if path.suffix.lower() in readers.ENDINGS:
        return _load_xml(path, robot, loops, ignore_loops)
    from raff2urdf.conversion import translate
    from raff2urdf.reader import parse as parse_raff
    from raff2urdf.reader import read

    document = parse_raff(read(path), str(path))
    raff2urdf.check(document)
    chosen = document.robot(robot)
    for name in loops or {}:
        if name not in chosen.loop_names:
            raise UnknownNameError("loop", name, chosen.loop_names)
    if ignore_loops and chosen.loops:
        listed = ", ".join(f"loop '{name}'" for name in chosen.loop_names)
        message = f"{path}: left out, as asked; every joint moves on its own: {listed}"
        warnings.warn(message, CinegenWarning, stacklevel=2)
        made = translate(document, replace(chosen, loops=()), path.parent)
        return build(made.urdf, beside.opened(made.constraints))
    try:
        made = translate(document, chosen, path.parent, loops=loops)
    except raff2urdf.RaffClosureError as error:
        raise ClosureError(error.problems) from None
    return build(made.urdf, made.constraints)


def robots(path: str | Path) -> list[str | None]:
    """Names of the robots that a file holds; `[None]` where it can hold but one, or none has a name.

    Raises:
        raff2urdf.RaffError: the file is wrong.
    """
    if Path(path).suffix.lower() in readers.ENDINGS:
        return [None]
    return [robot.name for robot in raff2urdf.load(path).robots] or [None]


def _load_xml(path: Path, robot: str | None, loops: Mapping[str, str] | None, ignore_loops: bool) -> Mechanism:
    """What others have described: a URDF with what stands beside it, an SDF or an MJCF."""
    try:
        urdf, constraints = readers.read(path, robot, ignore_loops)
    except raff2urdf.RaffError as error:
        raise LoadError(str(error)) from None
    entries = {entry["name"]: entry for entry in constraints["loops"]} if constraints else {}
    for name, closure in (loops or {}).items():
        if name not in entries:
            raise UnknownNameError("loop", name, tuple(entries))
        entries[name]["kind"] = loop_kind(closure).name.lower()
    mechanism = build(urdf, constraints, str(path.parent), str(path))
    if constraints and not loops:
        _check_stated(mechanism, constraints, constraints_of(path))
    return mechanism


def _check_stated(mechanism: Mechanism, constraints: beside.Constraints, file: Path) -> None:
    """Compare the degrees of freedom that a constraints file states with those of the mechanism.

    Raises:
        LoadError: they differ.
    """
    computed = {
        "loop_rows": sum(loop.rows for loop in mechanism.loops),
        "loop_rank": mechanism.loop_rank,
        "mobility": mechanism.mobility,
    }
    for key, value in computed.items():
        if constraints.get(key, value) != value:
            where = f"{file}:{line_of(read_text(file), [key])}: at $.{key}"
            why = f"{constraints[key]} is stated, but the URDF with these loops has {value}"
            raise LoadError(f"{where}: {why}: correct the number, or restore the joints and loops it was counted for")


def build(
    urdf: str, constraints: beside.Constraints | None, folder: str | None = None, name: str = "URDF"
) -> Mechanism:
    """A mechanism from a URDF's text and what it can't say.

    Args:
        urdf: its text.
        constraints: as `raff2urdf.constraints` describes; without them the URDF is a tree whose joints all have motors.
            Where it has loops, and nothing says which joints have motors, they are chosen as for a RAFF file.
        folder: where the URDF's meshes are looked for; None where it names them absolutely.
        name: what errors call the URDF.

    Raises:
        LoadError: no URDF, or it lacks what the constraints name.
        ClosureError: the loops can't be closed.
    """
    try:
        tree = parse(urdf, name)
        constraints = completed(simple(tree, name), constraints, name)
    except raff2urdf.RaffError as error:
        raise LoadError(str(error)) from None
    _check_size(tree, name)
    try:
        model = pin.buildModelFromXML(kinematics(tree))
    except (ValueError, RuntimeError) as error:
        raise LoadError(f"{name}: Pinocchio can't read it: {error}") from None
    _set_limits(model, constraints)
    written = _written(model, constraints)
    bodies = {frame.name: frame for frame in model.frames if frame.type == pin.FrameType.BODY}
    mechanism = Mechanism(
        name=constraints["robot"],
        model=model,
        nodes=constraints["nodes"],
        joints=[joint["name"] for joint in constraints["joints"]],
        actuated=[joint["name"] for joint in constraints["joints"] if joint.get("actuated", True)],
        loops=[_loop(entry) for entry in constraints["loops"]],
        length=_length(model, [bodies[node] for node in constraints["nodes"]], written),
        floating=constraints.get("floating") is not None,
        source=Source(build, urdf, constraints, folder, name),
    )
    mechanism.sensors = {sensor["number"]: sensor for sensor in constraints.get("sensors", [])}
    mechanism.sensor_constraints = tuple(
        (entry["node"], tuple(entry["sensors"])) for entry in constraints.get("sensor_constraints", [])
    )
    mechanism.q_home = written
    if mechanism.loops:
        mechanism.gap_as_written = mechanism.closure(written)
        mechanism.q_home = _home(mechanism, written)
        mechanism.loop_rank, generic = generic_rank(mechanism.system, mechanism.q_home)
        if not any("actuated" in joint for joint in constraints["joints"]):
            mechanism.actuated = _motors(mechanism, generic)
    mechanism.q_home.flags.writeable = False
    return mechanism


def _check_size(tree: Any, name: str) -> None:
    """Pinocchio keeps second derivatives for every model, whose memory grows with the cube of its size."""
    moving = sum(joint.get("type") != "fixed" for joint in joints(tree))
    if moving > _MOST:
        size = 54 * moving**3 / 1e9
        raise LoadError(f"{name}: {moving} joints move, {_MOST} may: Pinocchio would want {size:.0f} GB of memory")


def _motors(mechanism: Mechanism, q: Array) -> tuple[str, ...]:
    """The joints nearest the base that suffice to determine the mechanism; q (nq,) is closed and of generic rank."""
    model, column = mechanism.model, mechanism.v_index
    depth = {name: len(model.supports[model.getJointId(name)]) for name in mechanism.joints}
    outermost = sorted(range(len(depth)), key=lambda i: (-depth[mechanism.joints[i]], -i))
    jacobian = mechanism.system.evaluate(q)[1]
    determined = set(passive(jacobian, [column(mechanism.joints[i]) for i in outermost]))
    return tuple(joint for joint in mechanism.joints if column(joint) not in determined)


def _set_limits(model: pin.Model, constraints: beside.Constraints) -> None:
    """Set the limits of a model: infinite where there are none."""
    lower, upper = np.full(model.nq, -np.inf), np.full(model.nq, np.inf)
    fastest = np.full(model.nv, np.inf)
    for entry in constraints["joints"]:
        joint = model.joints[model.getJointId(entry["name"])]
        lower[joint.idx_q], upper[joint.idx_q] = entry["limits"] or (-np.inf, np.inf)
        fastest[joint.idx_v] = entry["velocity"] or np.inf
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    model.upperVelocityLimit, model.lowerVelocityLimit = fastest, -fastest
    effort = np.array(model.upperEffortLimit)
    effort[~((effort > 0.0) & (effort < UNLIMITED))] = np.inf
    model.upperEffortLimit, model.lowerEffortLimit = effort, -effort


def _written(model: pin.Model, constraints: beside.Constraints) -> Array:
    """The configuration that the file gives, loops not yet closed."""
    q = np.array(pin.neutral(model))
    for entry in constraints["joints"]:
        q[model.joints[model.getJointId(entry["name"])].idx_q] = entry["home"]
    return q


def _length(model: pin.Model, frames: Sequence[Any], q: Array) -> float:
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return characteristic_length(np.array([(data.oMi[f.parentJoint] * f.placement).translation for f in frames]))


def _loop(entry: Mapping[str, Any]) -> Loop:
    first, second = entry["first"], entry["second"]
    return Loop(
        name=entry["name"],
        kind=beside.loop_kind(dict(entry)),
        first=first["node"],
        second=second["node"],
        first_placement=pin.SE3(np.array(first["placement"])),
        second_placement=pin.SE3(np.array(second["placement"])),
    )


def _home(mechanism: Mechanism, written: Array) -> Array:
    """The closed configuration nearest to the written one; inside the joint limits if that can be had."""
    system = mechanism.system
    closing = close_from_afar(system, written)
    if not closing.closed:
        raise ClosureError(_diagnosis(mechanism, written, closing))
    inside, free = closing, np.ones(mechanism.model.nv, dtype=bool)
    for _ in range(3):
        outside = mechanism.limits.exceeded(inside.q)
        if not outside:
            return inside.q
        q = inside.q.copy()
        for joint, bound in outside.items():
            q[mechanism.q_index(joint)] = bound
            free[mechanism.v_index(joint)] = False
        inside = close(system, q, free)
        if not inside.closed:
            break
    names = ", ".join(mechanism.limits.exceeded(closing.q))
    warnings.warn(f"{mechanism.name}: closed, home is outside the limits of {names}", CinegenWarning, stacklevel=4)
    return closing.q


def _diagnosis(mechanism: Mechanism, written: Array, best: Closing) -> str:
    system = mechanism.system
    names = [loop.name for loop in mechanism.loops]
    kinds = [loop.kind for loop in mechanism.loops]
    return f"{mechanism.name}: {why_open(names, kinds, system.gaps, system.with_kinds, written, best)}"
