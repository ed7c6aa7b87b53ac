"""Build a `Mechanism` from the text of a URDF and its constraints: close the loops, choose the actuated joints."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

import raff2urdf
from cinegen.arrays import Array
from cinegen.errors import LoadError, warn
from cinegen.joints import supporting_columns
from cinegen.loops.closed_loops import ClosedLoops, LoopConstraint
from cinegen.model.frozen import blocking, locked
from cinegen.model.healing.near_redundant import in_plane, made_exact
from cinegen.model.home import find_home, follow, near_successive
from cinegen.model.limits import Limits
from cinegen.model.mechanism import Mechanism
from cinegen.model.mechanism_model import MechanismSource
from cinegen.model.spherical import SphericalJoints
from cinegen.model.urdf import completed, kinematics, simple
from cinegen.tolerances import AT_LIMIT
from raff2urdf import closure
from raff2urdf.axes import UNCHANGED
from raff2urdf.bounds import UNLIMITED
from raff2urdf.coupling import coupling_of
from raff2urdf.errors import raised_as
from raff2urdf.loops.length import characteristic_length, cut_screws
from raff2urdf.loops.mobility import loop_kind
from raff2urdf.loops.slips import DRAWN_OPEN, Fault
from raff2urdf.raff.document import LoopKind
from raff2urdf.readers.actuation import advice, replaced, syntax_of
from raff2urdf.readers.srdf import Srdf
from raff2urdf.readers.urdf_file import parse


class WrittenRobot(NamedTuple):
    """A robot as it is written: loops may be open.

    Attributes:
        system: its loops and couplings.
        q: (nq,) the configuration as written.
        declared: everything that its files declare.
        joints: the entries of its joints, without those that ball joints replace.
        spherical: its ball joints; None without any.
        near: (nq,) what `cinegen.model.home.near_successive` returns; None without ball joints, or if it fails.
    """

    system: ClosedLoops
    q: Array
    declared: Mapping[str, Any]
    joints: Sequence[Mapping[str, Any]]
    spherical: SphericalJoints | None
    near: Array | None


def written_loops(urdf: str, constraints: Mapping[str, Any] | None, name: str) -> WrittenRobot:
    """Return a robot whose loops are not yet closed.

    Args:
        urdf: its text.
        constraints: see `build`.
        name: the file's, for errors.

    Raises:
        LoadError: no URDF, or it lacks what the constraints name.
    """
    with raised_as(LoadError, raff2urdf.RaffError):
        tree = parse(urdf, name)
        declared = completed(simple(tree, name), constraints, name)
    with raised_as(LoadError, (ValueError, RuntimeError), f"{name}: Pinocchio can't read it: "):
        model = pin.buildModelFromXML(kinematics(tree))
    q = _written(model, declared)
    loops = tuple(_loop(entry) for entry in declared["loops"])
    balls = _balls(declared)
    length = _length(ClosedLoops(model, loops, 1.0), q, declared["nodes"], balls.values())
    couplings = tuple(map(coupling_of, declared.get("couplings", [])))
    spherical, entries, near = None, declared["joints"], None
    _set_limits(model, entries)
    if balls:
        near = near_successive(ClosedLoops(model, loops, length, couplings), q)
        spherical, successive = SphericalJoints(model, balls), {joint for joints in balls.values() for joint in joints}
        model, q = spherical.model, spherical.from_successive(q)
        near = None if near is None else spherical.from_successive(near)
        entries = [entry for entry in entries if entry["name"] not in successive]
        _set_limits(model, entries)
    if "gravity" in declared:
        model.gravity = pin.Motion(np.array(declared["gravity"]), np.zeros(3))
    system = ClosedLoops(model, loops, length, couplings)
    return WrittenRobot(system, q, declared, entries, spherical, near)


def build(
    urdf: str,
    constraints: Mapping[str, Any] | None,
    folder: str | None = None,
    name: str = "URDF",
    dialects: tuple[str, ...] = (),
    notes: tuple[str, ...] = (),
    srdf: Srdf | None = None,
    owner: str | None = None,
    packages: tuple[tuple[str, str], ...] = (),
    relax: bool | None = False,
    is_driven: bool = False,
    slips: Callable[[Fault], str | None] | None = None,
) -> Mechanism:
    """Build a mechanism from a URDF's text and everything that a URDF cannot express.

    Args:
        urdf, folder, name, dialects, notes, srdf, owner, packages: see `MechanismSource`.
        constraints: as `raff2urdf.constraints` describes; without them the URDF is a tree whose joints are all
            actuated. Where it has loops and does not state which joints are actuated (`actuated` is left out
            everywhere, or None), they are chosen as for a RAFF file.
        relax: see `load`.
        is_driven: whether the joints that the constraints state as actuated are those that transmissions and the like
            name (`raff2urdf.readers.drives`). Where these do not determine the mechanism, others are added or left out.
        slips: returns the edit that repairs a fault as text, if there is one.

    Raises:
        LoadError: no URDF, or it lacks what the constraints name.
        ClosureError: the loops can't be closed.
    """
    source = MechanismSource(urdf, constraints, folder, name, dialects, notes, srdf, owner, packages)
    written = written_loops(urdf, constraints, name)
    system, q, gap = written.system, written.q, 0.0
    if system.loops or system.couplings:
        gap, q = max(closure.gaps(system, q)), follow(system, q)
        if constraints and relax is not False:
            plane = in_plane(constraints, system, q, name)
            if plane is not None:
                return build(*source._replace(constraints=plane), relax, is_driven)
            exact = made_exact(urdf, constraints, system, q, relax is True, name)
            if exact is not None:
                return build(*source._replace(urdf=exact[0], constraints=exact[1]), is_driven=is_driven)
        written = written._replace(q=q if written.near is None else written.near)
    edit = slips(Fault.ELSEWHERE) if slips is not None and gap > AT_LIMIT else None
    remark = None if edit is None else DRAWN_OPEN + edit
    return _at_home(source, written, gap, remark, is_driven)


def _at_home(
    source: MechanismSource, written: WrittenRobot, gap: float, remark: str | None, is_driven: bool
) -> Mechanism:
    """Return the mechanism with its loops closed and its actuated joints chosen.

    Args:
        source: the texts.
        written: the robot, near home.
        gap: see `Mechanism.gap_as_written`.
        remark: a warning about loops that are open as written.
        is_driven: see `build`.
    """
    declared, system, constraints = written.declared, written.system, source.constraints
    name, robot = source.name, f"robot '{declared['robot']}'"
    is_stated = any("actuated" in joint for joint in declared["joints"])
    actuated = {joint["name"]: joint.get("actuated", True if is_stated else None) for joint in written.joints}
    is_drawing = not any("home" in joint for joint in (constraints or {}).get("joints", []))
    limits = Limits(system.model, tuple(actuated))
    home = find_home(system, written.q, limits, actuated, is_drawing, name, robot, remark)
    if home.is_drawn and (system.loops or system.couplings):  # else home is a random one
        length = _length(system, home.q, declared["nodes"])
        system = ClosedLoops(system.model, system.loops, length, system.couplings)
    where = f"{name}: {robot}"
    notes = source.notes + home.notes + _immobile(system, home.q, limits, where)
    chosen = tuple(
        joint for joint, stated in actuated.items() if stated or (stated is None and joint not in home.determined)
    )
    uncontrolled = tuple(joint for joint in actuated if joint not in chosen and joint not in home.determined)
    dependent = tuple(joint for joint in chosen if joint in home.determined)
    if constraints and is_driven and (uncontrolled or dependent):
        notes += _noted(replaced(uncontrolled, dependent), where, bool(system.loops))
        chosen = tuple(joint for joint in actuated if joint not in home.determined)
        uncontrolled = dependent = ()
        constraints = {**constraints, "joints": [{**joint, "actuated": None} for joint in constraints["joints"]]}
    constraints = _stated(constraints, degrees_of_freedom(system, sum(home.ranks)), chosen)
    default = {"translation": 3, "rotation": 3, "axes": UNCHANGED}
    mechanism = Mechanism(
        name=declared["robot"],
        model=system.model,
        nodes=tuple(declared["nodes"]),
        joints=tuple(actuated),
        actuated=chosen,
        loops=system.loops,
        couplings=system.couplings,
        length=system.length,
        spherical=written.spherical,
        uncontrolled=uncontrolled,
        dependent=dependent,
        floating=declared.get("floating") is not None,
        q_home=home.q,
        cluster_ranks=home.ranks,
        gap_as_written=gap,
        sensors={sensor["number"]: default | sensor for sensor in declared.get("sensors", [])},
        sensor_constraints=tuple(
            (entry["node"], tuple(entry["sensors"])) for entry in declared.get("sensor_constraints", [])
        ),
        source=source._replace(constraints=constraints, notes=notes),
    )
    if not uncontrolled:
        return mechanism
    if dependent and not mechanism.structure.uncontrolled_dof:  # home alone is singular
        return replace(mechanism, uncontrolled=(), dependent=())
    text = advice(uncontrolled, dependent, syntax_of(Path(name)), mechanism.structure.uncontrolled_dof)
    notes += _noted(text, where, bool(dependent))
    return replace(mechanism, source=mechanism.source._replace(notes=notes))


def _immobile(system: ClosedLoops, q: Array, limits: Limits, where: str) -> tuple[str, ...]:
    """Return the notes about joints that their limits let not move from home, q (nq,); warn if nothing moves there."""
    for joints in [] if limits.exceeded(q) else blocking(system, q, limits.lower, limits.upper):
        warn(
            f"{where}: from home the limits of {', '.join(joints)} let no joint move that loops and "
            "couplings connect to them: correct these limits, or the couplings"
        )
    fixed = locked(limits)
    if fixed and len(fixed) == len(limits) == system.model.nv:
        return _noted("no joint can move: the lower limit of each is its upper limit: correct the limits", where, True)
    return (f"the lower limit is the upper limit of {', '.join(fixed)}: they can't move",) if fixed else ()


def _noted(message: str, where: str, is_warning: bool) -> tuple[str, ...]:
    """Return a message as the only note; warn instead if it is a warning."""
    if is_warning:
        warn(f"{where}: {message}")
    return () if is_warning else (message,)


def degrees_of_freedom(system: ClosedLoops, rank: int) -> dict[str, int]:
    """Return the numbers that a constraints file states."""
    return {"loop_rows": system.rows, "loop_rank": rank, "mobility": system.model.nv - rank}


def _stated(
    constraints: Mapping[str, Any] | None, numbers: Mapping[str, int], actuated: Sequence[str]
) -> Mapping[str, Any] | None:
    """Return constraints with what has been computed in the place of None."""
    if constraints is None:
        return None
    joints = [
        {**joint, "actuated": joint["name"] in actuated} if joint.get("actuated", True) is None else joint
        for joint in constraints.get("joints", [])
    ]
    computed = {key: value for key, value in numbers.items() if constraints.get(key, value) is None}
    return {**constraints, **computed, **({"joints": joints} if "joints" in constraints else {})}


def _balls(constraints: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the ball joints that can be spherical joints, each with the three joints that stand for it: they have no
    limits, no rotors and no friction, are not actuated, and no coupling names them."""
    coupled = {term["joint"] for coupling in constraints.get("couplings", []) for term in coupling["terms"]}
    stated = any("actuated" in joint for joint in constraints["joints"])
    default = True if stated or not (constraints["loops"] or coupled) else None  # in a tree every joint is actuated
    plain = {
        entry["name"]
        for entry in constraints["joints"]
        if not (
            entry["limits"]
            or entry["velocity"]
            or entry.get("actuated", default)
            or entry.get("armature")
            or any(entry["friction"])
            or entry["name"] in coupled
        )
    }
    balls = {entry["name"]: entry["joints"] for entry in constraints.get("balls", [])}
    return {name: joints for name, joints in balls.items() if plain.issuperset(joints)}


def _set_limits(model: pin.Model, joints: Sequence[Mapping[str, Any]]) -> None:
    """Set the limits of a model, infinite where there are none, the inertia of its rotors, and its friction."""
    lower, upper = np.full(model.nq, -np.inf), np.full(model.nq, np.inf)
    fastest, (armature, damping, dry) = np.full(model.nv, np.inf), np.zeros((3, model.nv))
    for entry in joints:
        joint = model.joints[model.getJointId(entry["name"])]
        lower[joint.idx_q], upper[joint.idx_q] = entry["limits"] or (-np.inf, np.inf)
        fastest[joint.idx_v] = entry["velocity"] or np.inf
        armature[joint.idx_v] = entry.get("armature", 0.0)
        damping[joint.idx_v], dry[joint.idx_v] = entry["friction"]
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    model.upperVelocityLimit, model.lowerVelocityLimit, model.armature = fastest, -fastest, armature
    model.damping, model.upperDryFrictionLimit, model.lowerDryFrictionLimit = damping, dry, -dry
    effort = np.array(model.upperEffortLimit)
    effort[~((effort > 0.0) & (effort < UNLIMITED))] = np.inf
    model.upperEffortLimit, model.lowerEffortLimit = effort, -effort


def _written(model: pin.Model, constraints: Mapping[str, Any]) -> Array:
    """Return the configuration (nq,) as written; loops may be open."""
    q = np.array(pin.neutral(model))
    for entry in constraints["joints"]:
        q[model.joints[model.getJointId(entry["name"])].idx_q] = entry["home"]
    return q


def _length(system: ClosedLoops, q: Array, nodes: Sequence[str], balls: Iterable[Sequence[str]] = ()) -> float:
    """Return the characteristic length of a mechanism at q (nq,), m.

    Args:
        system: its loops.
        q: (nq,).
        nodes: their names.
        balls: joints, by threes, that are a ball joint each.
    """
    model, data = system.model, system.data
    system.evaluate(q)
    screws = system.screws()
    for joint in model.joints:
        if joint.nv == 6:  # where the robot is
            screws[:, joint.idx_v : joint.idx_v + 6] = 0.0
    for joints in balls:
        columns = [model.joints[model.getJointId(joint)].idx_v for joint in joints]
        screws[:, columns] = cut_screws(LoopKind.BALL, data.oMi[model.getJointId(joints[0])].homogeneous)
    frames = [model.frames[model.getFrameId(node, pin.FrameType.BODY)] for node in nodes]
    points = np.array([(data.oMi[frame.parentJoint] * frame.placement).translation for frame in frames])
    moves = np.zeros((len(nodes), screws.shape[1]), dtype=bool)
    for row, frame in zip(moves, frames, strict=True):
        row[: model.nv] = supporting_columns(model, frame.parentJoint) > 0.0
    return characteristic_length(screws, points, moves)


def _loop(entry: Mapping[str, Any]) -> LoopConstraint:
    first, second = entry["first"], entry["second"]
    placements = (pin.SE3(np.array(end["placement"])) for end in (first, second))
    return LoopConstraint(entry["name"], loop_kind(entry["kind"]), first["node"], second["node"], *placements)
