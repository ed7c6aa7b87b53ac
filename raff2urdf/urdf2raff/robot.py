"""URDF -> RAFF: any tree of revolute, continuous, prismatic and fixed joints by Kleinfinger's parameters.

A moving joint becomes a link, its frame chosen by `raff2urdf.urdf2raff.axes`; a link of the URDF that stands elsewhere
becomes a RAFF frame, fixed on it, under its own name; a link behind a fixed joint becomes a frame too (or a fixed link,
if it is called as RAFF calls links). A joint variable differs from the URDF's by an offset at most:
RAFF's q = URDF's q + offset.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raff2urdf.check import RESERVED, is_xml_name
from raff2urdf.constraints import Constraints, loop_kind
from raff2urdf.document import (
    UNITS_PER_METRE,
    Document,
    JointType,
    Parameters,
    RaffBase,
    RaffFrame,
    RaffLink,
    RaffLoop,
    RaffPart,
    RaffRobot,
    RaffSensor,
    SensorConstraint,
)
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.kleinfinger import Kleinfinger, transform
from raff2urdf.placement import from_origin, inverse
from raff2urdf.readers import successive
from raff2urdf.readers.urdf import ends, joints, limits, links, middle, origin, root_first, three, velocity
from raff2urdf.tree import BASE_JOINT
from raff2urdf.urdf2raff.axes import EXACT, RigidBody, choose_frame, gather, reach, step, way
from raff2urdf.urdf2raff.tidy import TIDY, tidy

Array = NDArray[np.float64]

ROUGH = 1e-10
"""What a limit (m or rad) may lose to be written shorter: more than other numbers (`TIDY`), for less hangs on it."""

_WORLD = "world"


@dataclass(frozen=True, slots=True)
class Reversal:
    """A robot of a URDF in RAFF, and how the two correspond.

    Attributes:
        document: the RAFF file, with this one robot.
        joints: the URDF's names of the joints that move -> RAFF's.
        offsets: RAFF's names of joints -> RAFF's q less the URDF's, rad or m; most are 0.
        nodes: the URDF's names of links -> RAFF's names of the nodes that stand where they stand.
        notes: what to say of a link or frame, by its number.
    """

    document: Document
    joints: Mapping[str, str]
    offsets: Mapping[str, float]
    nodes: Mapping[str, str]
    notes: Mapping[int, str]


def reverse(
    tree: Any, name: str, beside: Constraints | None = None, units: str = "mm", free_mimic: bool = False
) -> Reversal:
    """A URDF in RAFF, without its graphics.

    Args:
        tree: its root element, from `readers.urdf.parse`. Planar, spherical and floating joints are replaced in it by
            successive ones; a floating joint that frees the whole robot becomes a base that can move.
        name: what errors call it.
        beside: what its `.constraints.json` says: loops, motors, home, sensors.
        units: of the RAFF file's lengths: um, mm, cm or m.
        free_mimic: write a joint that should mimic another as a joint of its own.

    Raises:
        RaffError: a joint mimics another, which RAFF can't say; `beside` names what the URDF lacks.
    """
    mimics = [joint for joint in joints(tree) if joint.find("mimic") is not None]
    if mimics and not free_mimic:
        listed = ", ".join(f"'{joint.get('name')}' (line {joint.sourceline})" for joint in mimics[:8])
        more = f" and {len(mimics) - 8} more" if len(mimics) > 8 else ""
        raise RaffError(
            f"{name}:{mimics[0].sourceline}: RAFF can't say that a joint mimics another: {listed}{more}. With "
            "--free-mimic (in Python free_mimic=True) they become joints of their own"
        )
    successive.replace_compound(tree, name, keep_root=root_first(tree)[0] not in _looped(beside))
    return _Robot(tree, name, beside or {}, units).reversal()


def _looped(beside: Constraints | None) -> set[str]:
    """The links where loops end."""
    return {loop[end]["node"] for loop in (beside or {}).get("loops", []) for end in ("first", "second")}


class _Robot:
    """One URDF on its way."""

    def __init__(self, tree: Any, name: str, beside: Constraints, units: str) -> None:
        self.tree, self.name, self.beside, self.units = tree, name, beside, units
        self.per_metre = UNITS_PER_METRE[units]
        self.joints_on: dict[str, list[Any]] = {}
        for joint in joints(tree):
            self.joints_on.setdefault(ends(joint)[0], []).append(joint)
        self.holder = {ends(joint)[1]: (i, joint) for i, joint in enumerate(joints(tree))}
        self.root = root_first(tree)[0]
        self.entries = {entry["name"]: entry for entry in beside.get("joints", [])}
        self.placing = self._placing()
        own = self.placing is not None and self.placing.get("name") == BASE_JOINT
        self.numbers = _Numbers(tree, self.placing if own else None)
        self.names = _Names(str(link.get("name")) for link in links(tree))
        self.parts: list[tuple[float, RaffLink | RaffFrame]] = []  # each with its place in the file
        self.placed: dict[int, Array] = {}  # nodes by number, as the written numbers place them, joints at 0
        self.number_of: dict[str, int] = {}  # of the node that stands where a link stands
        self.joints: dict[str, str] = {}
        self.offsets: dict[str, float] = {}
        self.nodes: dict[str, str] = {}
        self.notes: dict[int, str] = {}

    def reversal(self) -> Reversal:
        """RigidBody after body, from the base outwards."""
        start, placed, floats = self._start()
        root = RigidBody(None, None, [(start, placed)], placed[:3, 2])
        bodies = gather(root, self.joints_on, self._axis, self._held)
        self.length = reach(bodies)
        for body in bodies:
            body.frame = choose_frame(body, self.length)
        base, self.placed[0] = self._written(step(root.frame, self.length))
        self._hang(root, 0)
        numbers = {id(root): 0}
        for body in bodies[1:]:
            numbers[id(body)] = self._link(body, numbers[id(body.father)])
        loops = [self._loop(entry) for entry in self.beside.get("loops", [])]
        self.parts.sort(key=lambda pair: pair[0])
        robot = RaffRobot(
            name=_xml_name(str(self.tree.get("name") or "robot")),
            base=RaffBase(base),
            parts=tuple(self._with_motors(part for _, part in self.parts)),
            loops=tuple(loops),
            sensor_constraints=tuple(self._sensor_constraints(floats)),
        )
        sensors = tuple(
            RaffSensor(sensor["number"], sensor["port"], sensor.get("translation", 3), sensor.get("rotation", 3))
            for sensor in self.beside.get("sensors", [])
        )
        document = Document(str(self.beside.get("name") or robot.name), (robot,), sensors, self.units)
        return Reversal(document, self.joints, self.offsets, self.nodes, self.notes)

    def _placing(self) -> Any:
        """The joint that only places the robot in the world, or frees it; None without any, or if a loop ends there."""
        own = self.joints_on.get(self.root, []) if self.root not in _looped(self.beside) else []
        places = len(own) == 1 and (
            own[0].get("type") == "floating" or (own[0].get("type") == "fixed" and self.root == _WORLD)
        )
        return own[0] if places else None

    def _start(self) -> tuple[str, Array, bool]:
        """The link that becomes the base, where it stands, and whether it can move.

        A root that only places the robot in the world, or frees it, is left out: it is the world.
        """
        if self.placing is None:
            return self.root, np.eye(4), False
        child, placed = self._held(self.placing)
        return child, placed, self.placing.get("type") == "floating"

    def _axis(self, joint: Any) -> Array | None:
        axis = joint.find("axis")
        if joint.get("type") == "fixed":
            return None
        return np.array((1.0, 0.0, 0.0) if axis is None else three(axis, "xyz", self.name, "1 0 0"))

    def _held(self, joint: Any) -> tuple[str, Array]:
        return ends(joint)[1], from_origin(*origin(joint, self.name))

    # --- links and frames ---------------------------------------------------------------------------------------

    def _link(self, body: RigidBody, pred: int) -> int:
        """A body's link and all that is fixed on it; returns its number."""
        joint, place = body.joint, float(self.holder[body.links[0][0]][0])
        own, number = str(joint.get("name")), self.numbers.of(joint)
        assert body.father is not None
        branches = len(body.father.children) > 1
        pred, found = self._step(pred, ends(joint)[0], body.frame, own, place - 0.5, branches)
        slides = joint.get("type") == "prismatic"
        zero, local = self._written(found)
        self.placed[number] = self.placed[pred] @ local
        offset = self._metres(zero.r) if slides else math.radians(zero.theta)
        home, allowed, fastest = self._motion(joint)
        at = self._length(offset + home) if slides else _degrees(offset + home)
        standing = next((link for link, there in body.links if self._same(number, there)), None)
        link = RaffLink(
            number=number,
            parameters=replace(zero, r=at) if slides else replace(zero, theta=at),
            type=JointType.PRISMATIC if slides else JointType.REVOLUTE,
            pred=pred,
            limits=None if allowed is None else self._both(allowed, offset, slides),
            velocity=None if fastest is None else self._rough(fastest, slides),
            name=self.names.give(standing, f"{body.links[0][0]}_axis", f"link{number}"),
        )
        self.parts.append((place, link))
        self.joints[own] = link.joint
        self.offsets[link.joint] = offset
        self._note(link, own, zero.r if slides else zero.theta, slides)
        self._hang(body, number, standing, link.node)
        return number

    def _hang(self, body: RigidBody, number: int, standing: str | None = None, node: str = "base") -> None:
        """Frames for the links of a body that are not its node itself.

        Args:
            body: which.
            number: of its node.
            standing: the link that is the node. The base takes any that has its name, or the world's.
            node: the node's name.
        """
        for link, there in body.links:
            is_base = number == 0 and link in ("base", _WORLD) and self._same(0, there)
            if link == standing or is_base:
                self.number_of[link], self.nodes[link] = number, node
                continue
            place, joint = self.holder.get(link, (-1, None))
            fixed = joint is not None and joint.get("type") == "fixed" and self.numbers.knows(joint)
            own = self.numbers.of(joint) if fixed else self.numbers.free()
            holder = ends(joint)[0] if fixed else link
            pred, found = self._step(number, holder, there, link, place + 0.2)
            self.number_of[link] = self._frame(found, pred, link, own, place + 0.3, fixed and link == f"link{own}")

    def _step(
        self, pred: int, holder: str, there: Array, name: str, place: float, branches: bool | None = None
    ) -> tuple[int, Kleinfinger]:
        """How a frame is reached by one step: from its body's node, or from a frame that stands in between.

        Args:
            pred: the body's node.
            holder: the link that holds it in the URDF; perhaps that has a node of its own, on the same body.
            there: (4, 4) the frame.
            name: what a frame in between is called after, if a new one is wanted.
            place: where that would stand in the file.
            branches: of a link, whether its body's father carries others: only then it may say gamma and epsilon.

        Returns:
            the node to stand on, and the parameters.
        """
        for node in dict.fromkeys((pred, self.number_of.get(holder, pred))):
            steps = way(self.placed[node], there, self.length, branches is None or (branches and node == pred))
            if len(steps) == 1:
                return node, steps[0]
        between = self._frame(steps[0], node, f"{name}_stand", self.numbers.free(), place)
        return between, step(inverse(self.placed[between]) @ there, self.length)

    def _frame(self, found: Kleinfinger, pred: int, name: str, number: int, place: float, solid: bool = False) -> int:
        """A frame, placed by six parameters, or a fixed link if it bears such a link's name; returns its number."""
        written, local = self._written(found)
        named = self.names.give(name, name, f"{'link' if solid else 'frame'}{number}")
        if solid:
            frame: RaffPart = RaffLink(number, written, JointType.FIXED, pred, name=named)
        else:
            frame = RaffFrame(number, written, pred, named)
        self.placed[number] = self.placed[pred] @ local
        self.parts.append((place, frame))
        if name in self.names.links:
            self.nodes[name] = frame.node
        return number

    def _same(self, number: int, there: Array) -> bool:
        return float(np.abs(self.placed[number] - there).max()) <= 10.0 * EXACT * max(self.length, 1.0)

    def _motion(self, joint: Any) -> tuple[float, tuple[float, float] | None, float | None]:
        """Home, limits and greatest speed of a joint (rad, m), as the URDF or the file beside it has them."""
        entry = self.entries.get(joint.get("name"), {})
        allowed, fastest = limits(joint), velocity(joint)
        if "limits" in entry:
            allowed = None if entry["limits"] is None else (entry["limits"][0], entry["limits"][1])
        if "velocity" in entry:
            fastest = entry["velocity"]
        inside = 0.0 if self.beside.get("loops") else middle(allowed)
        return entry.get("home", inside), allowed, fastest

    def _with_motors(self, parts: Iterable[RaffPart]) -> Iterator[RaffPart]:
        """Says which joints have motors, where that is not what RAFF takes for granted."""
        has = {self.joints[name]: entry.get("actuated", True) for name, entry in self.entries.items()}
        granted = all(has.values()) and not self.beside.get("loops")
        for part in parts:
            if isinstance(part, RaffFrame) or not part.type or granted:
                yield part
            elif any(has.values()):
                yield replace(part, actuated=True) if has.get(part.joint, True) else part
            else:
                yield replace(part, actuated=False)

    def _note(self, link: RaffLink, own: str, offset: float, slides: bool) -> None:
        """What a reader wants to know of a joint that has another name, or another zero, in the URDF."""
        unit = self.units if slides else "degrees"
        moved = f"; 0 here is {-offset:.10g} {unit} there" if offset else ""
        if own != link.joint or offset:
            self.notes[link.number] = f"{own}{moved}"

    # --- loops and sensors --------------------------------------------------------------------------------------

    def _loop(self, entry: Mapping[str, Any]) -> RaffLoop:
        first, second = (self._end(entry[end], entry["name"]) for end in ("first", "second"))
        return RaffLoop(first, second, loop_kind(dict(entry)))

    def _end(self, end: Mapping[str, Any], loop: str) -> int:
        """The node where a loop ends: a frame of its own if it is none of the URDF's links."""
        carrier = self._node_number(end["node"], f"loop '{loop}'")
        there = self.placed[carrier] @ np.array(end["placement"], dtype=float)
        if self._same(carrier, there):
            return carrier
        pred, found = self._step(carrier, end["node"], there, loop, math.inf)
        number = self.numbers.free()
        return self._frame(found, pred, f"frame{number}", number, math.inf)

    def _node_number(self, link: str, what: str) -> int:
        if link not in self.number_of:
            raise RaffError(
                f"{self.name}: {what} names '{link}', which is no link{did_you_mean(link, [*self.number_of])}"
            )
        return self.number_of[link]

    def _sensor_constraints(self, floats: bool) -> Iterator[SensorConstraint]:
        said = self.beside.get("sensor_constraints", [])
        for entry in said:
            number = self._node_number(entry["node"], "a sensor constraint")
            yield SensorConstraint(number, tuple(entry["sensors"]))
        if floats and not any(entry["node"] == "base" for entry in said):
            yield SensorConstraint(0, (0,))

    # --- numbers ------------------------------------------------------------------------------------------------

    def _written(self, found: Kleinfinger) -> tuple[Parameters, Array]:
        """Parameters in the file's units, and the placement (4, 4) that they stand for once they are read back."""
        written = Parameters(
            theta=_degrees(found.theta),
            r=self._length(found.r),
            d=self._length(found.d),
            alpha=_degrees(found.alpha),
            gamma=_degrees(found.gamma),
            epsilon=self._length(found.epsilon),
        )
        read = Kleinfinger(
            gamma=math.radians(written.gamma),
            epsilon=self._metres(written.epsilon),
            alpha=math.radians(written.alpha),
            d=self._metres(written.d),
            theta=math.radians(written.theta),
            r=self._metres(written.r),
        )
        return written, transform(read)

    def _length(self, metres: float) -> float:
        return tidy(metres * self.per_metre, TIDY * self.per_metre)

    def _metres(self, length: float) -> float:
        return length / self.per_metre

    def _both(self, allowed: tuple[float, float], offset: float, slides: bool) -> tuple[float, float]:
        low, high = (self._rough(limit + offset, slides) for limit in allowed)
        return low, high

    def _rough(self, value: float, slides: bool) -> float:
        """A limit (rad, m) in the file's units."""
        unit = self.per_metre if slides else math.degrees(1.0)
        return tidy(value * unit if slides else math.degrees(value), ROUGH * unit)


class _Numbers:
    """Numbers of links and frames: those of `joint5` where all joints are called so, else in file order."""

    def __init__(self, tree: Any, base: Any) -> None:
        """Of a URDF's tree; `base` is raff2urdf's own joint that only places the base, which needs none."""
        all_joints = [joint for joint in joints(tree) if joint is not base]
        said = [re.fullmatch("joint([1-9][0-9]{0,8})", joint.get("name")) for joint in all_joints]
        if all(said):
            self.by_joint = {joint.get("name"): int(m[1]) for joint, m in zip(all_joints, said, strict=True) if m}
        else:
            moving = sorted(all_joints, key=lambda joint: joint.get("type") == "fixed")  # the others in their order
            self.by_joint = {joint.get("name"): i + 1 for i, joint in enumerate(moving)}
        self.last = max(self.by_joint.values(), default=0)

    def knows(self, joint: Any) -> bool:
        """Whether a joint holds a node: the one that places the base holds none."""
        return joint.get("name") in self.by_joint

    def of(self, joint: Any) -> int:
        """The number of the node that a joint holds."""
        return int(self.by_joint[joint.get("name")])

    def free(self) -> int:
        """A number that no joint has."""
        self.last += 1
        return self.last


class _Names:
    """Names of nodes: the URDF's where RAFF can say them and they are free."""

    def __init__(self, links: Iterable[str]) -> None:
        self.links = frozenset(links)
        self.meant = {_xml_name(link) for link in self.links}
        self.taken = set(RESERVED)

    def give(self, wanted: str | None, otherwise: str, unsaid: str) -> str | None:
        """A name for a node; None where it has that name unsaid.

        Args:
            wanted: the link's that it is; None if it is none.
            otherwise: then, if the name that it has unsaid is some link's.
            unsaid: the name that it has if none is given.
        """
        if wanted is None and unsaid not in self.meant | self.taken:
            self.taken.add(unsaid)
            return None
        name = own = _xml_name(otherwise if wanted is None else wanted)
        count = 1
        while name in self.taken or (count > 1 and name in self.meant):
            count += 1
            name = f"{own}_{count}"
        self.taken.add(name)
        return None if name == unsaid else name


def _degrees(angle: float) -> float:
    return tidy(math.degrees(angle), math.degrees(TIDY))


def _xml_name(name: str) -> str:
    """A name as RAFF takes it: what no XML name may hold becomes '_'."""
    if is_xml_name(name):
        return name
    name = re.sub(r"[^\w.\-]", "_", name)
    return name if is_xml_name(name) else f"_{name}"
