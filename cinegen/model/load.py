"""Files -> `Mechanism`. RAFF goes through the URDF and the constraints that raff2urdf writes, so that a RAFF file and
its conversion are the same mechanism, bit for bit."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree
from numpy.typing import NDArray

import raff2urdf
from cinegen.errors import CinegenWarning, ClosureError, LoadError, UnknownNameError
from cinegen.model.loops import Loop
from cinegen.model.mechanism import Mechanism, Source
from cinegen.model.urdf import free, parsed
from raff2urdf import constraints as beside
from raff2urdf.analysis import loop_kind
from raff2urdf.closure import Closing, close, close_from_afar, generic_rank, why_open
from raff2urdf.tree import characteristic_length

Array = NDArray[np.float64]


def load(path: str | Path, robot: str | None = None, loops: Mapping[str, str] | None = None) -> Mechanism:
    """Loads a mechanism and closes its loops.

    Args:
        path: a RAFF file, or a URDF; what a URDF can't say is read from `<stem>.constraints.json` beside it.
        robot: which robot of a RAFF file that holds several; the first unless said.
        loops: other kinds of closure (rigid, prismatic, revolute, ball) for some loops, by name.

    Raises:
        raff2urdf.RaffError: the RAFF file, or the constraints, are wrong: where and why.
        ClosureError: the loops can't be closed; says which stay open, by how much, and what would close them.
        LoadError: the URDF is wrong.
        UnknownNameError: no such loop.
    """
    path = Path(path)
    if path.suffix.lower() in (".urdf", ".xml"):
        return _load_urdf(path, loops)
    from raff2urdf.conversion import translate
    from raff2urdf.reader import parse, read

    document = parse(read(path), str(path))
    raff2urdf.check(document)
    chosen = document.robot(robot)
    for name in loops or {}:
        if name not in chosen.loop_names:
            raise UnknownNameError("loop", name, chosen.loop_names)
    try:
        made = translate(document, chosen, path.parent, loops=loops)
    except raff2urdf.ClosureError as error:
        raise ClosureError(error.problems) from None
    return build(made.urdf, made.constraints, str(path.parent))


def _load_urdf(path: Path, loops: Mapping[str, str] | None) -> Mechanism:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise LoadError(f"{path}: can't be read: {error}") from None
    companion = path.with_suffix(".constraints.json")
    constraints = beside.load(companion) if companion.exists() else None
    entries = {entry["name"]: entry for entry in constraints["loops"]} if constraints else {}
    for name, kind in (loops or {}).items():
        if name not in entries:
            raise UnknownNameError("loop", name, tuple(entries))
        entries[name]["kind"] = loop_kind(kind).name.lower()
    return build(text, constraints, str(path.parent), str(path))


def build(
    urdf: str, constraints: beside.Constraints | None, folder: str | None = None, name: str = "URDF"
) -> Mechanism:
    """A mechanism from a URDF's text and what it can't say.

    Args:
        urdf: its text.
        constraints: as `raff2urdf.constraints` describes; without them the URDF is a tree whose joints all have motors.
        folder: where the URDF's meshes are looked for.
        name: what errors call the URDF.

    Raises:
        LoadError: no URDF, or it lacks what the constraints name.
        ClosureError: the loops can't be closed.
    """
    tree = parsed(urdf, name)
    unlimited = free(tree, name)
    try:
        model = pin.buildModelFromXML(etree.tostring(tree, encoding="unicode"))
    except (ValueError, RuntimeError) as error:
        raise LoadError(f"{name}: Pinocchio can't read it: {error}") from None
    if constraints is None:
        constraints = _of_tree(tree, model)
    _set_limits(model, constraints, unlimited, name)
    written = _written(model, constraints, name)
    bodies = {frame.name: frame for frame in model.frames if frame.type == pin.FrameType.BODY}
    lost = [node for node in constraints["nodes"] if node not in bodies]
    if lost:
        raise LoadError(f"{name}: the constraints name '{lost[0]}', which is no link of the URDF")
    mechanism = Mechanism(
        name=constraints.get("robot", model.name),
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
        mechanism.loop_rank, _ = generic_rank(mechanism.system, mechanism.q_home)
    mechanism.q_home.flags.writeable = False
    return mechanism


def _of_tree(tree: Any, model: pin.Model) -> beside.Constraints:
    """What the constraints of a URDF without loops would say."""
    links = [link.get("name", "") for link in tree.iter("link")]
    children = {child.get("link") for child in tree.iter("child")}
    root = [link for link in links if link not in children]
    names = [joint.get("name") for joint in tree.iter("joint") if joint.get("name") in set(model.names)]
    floating = next((j.get("name") for j in tree.iter("joint") if j.get("type") == "floating"), None)
    q = pin.neutral(model)
    joints = [
        {"name": name, "home": float(q[model.joints[model.getJointId(name)].idx_q])}
        for name in names
        if name != floating
    ]
    nodes = root + [link for link in links if link not in root]
    return {"robot": model.name, "nodes": nodes, "floating": floating, "joints": joints, "loops": []}


def _set_limits(model: pin.Model, constraints: beside.Constraints, unlimited: set[str], name: str) -> None:
    """Position and velocity limits into the model: infinite where none are said."""
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    fastest = model.upperVelocityLimit
    for entry in constraints["joints"]:
        if not model.existJointName(entry["name"]):
            raise LoadError(f"{name}: the constraints name joint '{entry['name']}', which the URDF lacks")
        joint = model.joints[model.getJointId(entry["name"])]
        if "limits" in entry or entry["name"] in unlimited:
            low, high = entry.get("limits") or (-np.inf, np.inf)
            lower[joint.idx_q : joint.idx_q + joint.nq] = low
            upper[joint.idx_q : joint.idx_q + joint.nq] = high
        if "velocity" in entry or entry["name"] in unlimited:
            fastest[joint.idx_v : joint.idx_v + joint.nv] = entry.get("velocity") or np.inf
    floating = constraints.get("floating")
    if floating is not None and model.existJointName(floating):
        joint = model.joints[model.getJointId(floating)]
        lower[joint.idx_q : joint.idx_q + joint.nq] = -np.inf
        upper[joint.idx_q : joint.idx_q + joint.nq] = np.inf
        fastest[joint.idx_v : joint.idx_v + joint.nv] = np.inf
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    model.upperVelocityLimit, model.lowerVelocityLimit = fastest, -fastest


def _written(model: pin.Model, constraints: beside.Constraints, name: str) -> Array:
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
        outside = _outside(mechanism, inside.q)
        if not outside:
            return inside.q
        q = inside.q.copy()
        for joint, bound in outside.items():
            q[mechanism.q_index(joint)] = bound
            free[mechanism.v_index(joint)] = False
        inside = close(system, q, free)
        if not inside.closed:
            break
    names = ", ".join(_outside(mechanism, closing.q))
    warnings.warn(f"{mechanism.name}: closed, home is outside the limits of {names}", CinegenWarning, stacklevel=4)
    return closing.q


def _outside(mechanism: Mechanism, q: Array) -> dict[str, float]:
    """Joints that are beyond a limit, and that limit."""
    found = {}
    for joint in mechanism.joints:
        i = mechanism.q_index(joint)
        low, high = mechanism.model.lowerPositionLimit[i], mechanism.model.upperPositionLimit[i]
        if not low <= q[i] <= high:
            found[joint] = float(low if q[i] < low else high)
    return found


def _diagnosis(mechanism: Mechanism, written: Array, best: Closing) -> str:
    system = mechanism.system
    names = [loop.name for loop in mechanism.loops]
    kinds = [loop.kind for loop in mechanism.loops]
    return f"{mechanism.name}: {why_open(names, kinds, system.gaps, system.with_kinds, written, best)}"
