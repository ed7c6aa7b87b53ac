"""SDF, Gazebo's Simulation Description Format, as a URDF and the loops that it closes.

SDF gives every link a pose in the model, at the configuration where all joint variables are 0, and joints between
any two links: one that joins links which stand already closes a loop, and becomes one. Read are versions 1.4 to 1.12:
links, their visuals, joints, frames, models within models; not what simulators add (collisions, sensors, plugins).
What raff2urdf adds (`raff:robot`: zeros of joints, motors, loops' ends) is read too: its robots come back as they were.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import yourdfpy
from lxml import etree
from numpy.typing import NDArray

from raff2urdf.constraints import IDENTITY, Constraints
from raff2urdf.errors import RaffError, RaffWarning, did_you_mean
from raff2urdf.loops import skew
from raff2urdf.placement import inverse, of_origin, of_quaternion, turn
from raff2urdf.readers import visuals
from raff2urdf.readers.urdf import SIZE, UNLIMITED, number, numbers
from raff2urdf.readers.xml_file import parse_xml
from raff2urdf.urdf import BASE_JOINT, dumps

Array = NDArray[np.float64]

SPACE = "urn:raff2urdf"
"""The namespace of what raff2urdf adds."""

_WORLD = "world"
_ONE = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
_LOOPS = {"fixed": "rigid", "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "ball": "ball"}
_TWO = ("universal", "revolute2")
_COUPLING = "gearbox"  # couples two joints, and holds nothing
_JOINTS = (*_LOOPS, *_TWO, _COUPLING)
_STRAIGHT = 1e-12  # m: a joint whose axis passes this near a link's origin turns about it


@dataclass(slots=True, eq=False)
class _Joint:
    """A joint, everything in the model's frame."""

    element: Any
    name: str
    kind: str
    parent: str
    child: str
    placement: Array
    axes: list[Array]
    limits: list[tuple[float, float]]
    velocities: list[float]


@dataclass(slots=True)
class _Model:
    """A model with those within it, links and joints by their full names, everything in the outermost model's frame."""

    name: str
    root: str | None = None
    links: dict[str, Any] = field(default_factory=dict)
    placements: dict[str, Array] = field(default_factory=dict)
    joints: list[_Joint] = field(default_factory=list)
    frames: dict[str, str] = field(default_factory=dict)  # by the links that they are attached to
    fixed: bool = False  # static: it stands on the world
    ours: Any = None  # the element raff:robot


def read(text: str, name: str, robot: str | None = None) -> tuple[str, Constraints]:
    """A URDF and what it can't say, from the text of an SDF.

    Args:
        text: of the file.
        name: what errors call it.
        robot: which model; the first unless said.

    Raises:
        RaffError: no SDF, no such model, or something in it that can't be said; with the element's line.
    """
    root = parse_xml(text, name)
    etree.strip_tags(root, etree.Comment)
    models = [m for m in root.iter("model") if m.getparent().tag in ("sdf", "world", "population")]
    chosen = [m for m in models if robot is None or m.get("name") == robot]
    if not chosen:
        known = [str(m.get("name")) for m in models]
        what = "it holds no model" if robot is None else f"no model '{robot}'{did_you_mean(robot, known)}"
        for include in root.iter("include"):
            what += f", but includes '{include.findtext('uri', '').strip()}': load that file itself"
            break
        raise RaffError(f"{name}:{root.sourceline}: {what}")
    version = numbers(root.get("version", "1.6").replace(".", " ")) or [1.0, 6.0]
    model = _Reader(name, (int(version[0]), int(version[-1]) if len(version) > 1 else 0)).model(chosen[0])
    return _Writer(name, model).write()


class _Reader:
    """Poses of everything in one file."""

    def __init__(self, name: str, version: tuple[int, int]) -> None:
        self.name, self.version = name, version

    def error(self, element: Any, message: str) -> RaffError:
        return RaffError(f"{self.name}:{element.sourceline}: {message}")

    def model(self, element: Any) -> _Model:
        """A model and all within it."""
        found = _Model(str(element.get("name", "model")))
        for include in element.iter("include"):
            uri = include.findtext("uri", "").strip()
            raise self.error(include, f"it includes '{uri}': write what it holds into the file")
        around = element.getparent()
        poses = _Poses(self, around, np.eye(4), "").inner(element) if around.tag == "world" else None
        poses = poses or _Poses(self, element, self.pose(element), "")
        poses.prefix = ""
        self._gather(poses, found)
        if not found.links:
            raise self.error(element, f"the model '{found.name}' has no link")
        if element.get("canonical_link") is not None:
            found.root = poses.canonical()
        found.fixed = element.findtext("static", "").strip() in ("1", "true")
        found.ours = element.find(f"{{{SPACE}}}robot")
        return found

    def _gather(self, poses: _Poses, found: _Model) -> None:
        for nested in poses.model.iterchildren("model"):
            self._gather(poses.inner(nested), found)
        for element in poses.model.iterchildren("link", "joint", "frame"):
            if not element.get("name"):
                raise self.error(element, f"a {element.tag} without a name")
        for link in poses.model.iterchildren("link"):
            own = poses.prefix + link.get("name")
            if link.get("name") == _WORLD:
                raise self.error(link, f"a link can't be called '{_WORLD}': that is the world itself")
            if own in found.links:
                raise self.error(link, f"a second link '{own}': the first is on line {found.links[own].sourceline}")
            found.links[own] = link
            found.placements[own] = poses.of_element(link)
        for frame in poses.model.iterchildren("frame"):
            own = poses.prefix + frame.get("name")
            if own not in found.links:
                found.frames[own] = poses.link(frame.get("name"), frame)
                found.placements[own] = poses.of_element(frame)
        known: dict[str, Any] = {}
        for joint in poses.model.iterchildren("joint"):
            first = known.setdefault(joint.get("name"), joint)
            if first is not joint:
                raise self.error(
                    joint, f"a second joint '{joint.get('name')}': the first is on line {first.sourceline}"
                )
            found.joints.append(self._joint(joint, poses, found))

    def _joint(self, element: Any, poses: _Poses, found: _Model) -> _Joint:
        name, kind = poses.prefix + str(element.get("name", "")), str(element.get("type", ""))
        said = f"joint '{name}'"
        if kind not in _JOINTS:
            raise self.error(
                element, f"{said} is of the type '{kind}', which can't be said{did_you_mean(kind, _JOINTS)}"
            )
        ends = []
        for word in ("parent", "child"):
            end = element.find(word)
            text = "" if end is None else _named(end)
            where = element if end is None else end
            if not text:
                raise self.error(where, f"{said} has no {word}")
            link = poses.link(text, where, f"{said} has the {word} '{text}', no link")
            ends.append(link)
        if ends[0] == ends[1]:
            raise self.error(element, f"{said} holds '{ends[0]}' on itself")
        placement = poses.of_element(element)
        axes, limits, velocities = [], [], []
        for word in ("axis", "axis2"):
            axis = element.find(word)
            if axis is not None and kind not in ("fixed", "ball", _COUPLING):
                axes.append(self._axis(axis, said, placement, poses))
                limits.append(self._limits(axis, said))
                velocities.append(self._number(axis, "limit/velocity", said, math.inf))
        wanted = 2 if kind in _TWO else 1 if kind in _ONE else 0
        if len(axes) < wanted:
            raise self.error(element, f"{said} wants {wanted} axes and has {len(axes)}")
        return _Joint(element, name, kind, ends[0], ends[1], placement, axes, limits, velocities)

    def _axis(self, element: Any, said: str, placement: Array, poses: _Poses) -> Array:
        xyz = element.find("xyz")
        text = "0 0 1" if xyz is None else xyz.text or ""
        found = numbers(text)
        if found is None or len(found) != 3 or math.hypot(*found) <= 1e-9:
            at = element if xyz is None else xyz
            raise self.error(at, f"the axis '{text.strip()}' of {said} must be three numbers, not all 0{SIZE}")
        frame = placement
        expressed = None if xyz is None else xyz.get("expressed_in")
        if expressed:
            frame = poses.of(expressed, xyz)
        elif self.version < (1, 5) or element.findtext("use_parent_model_frame", "0").strip() in ("1", "true"):
            frame = poses.placed
        axis: Array = frame[:3, :3] @ np.array(found)
        return axis / np.linalg.norm(axis)

    def _limits(self, axis: Any, said: str) -> tuple[float, float]:
        low = self._number(axis, "limit/lower", said, -math.inf)
        high = self._number(axis, "limit/upper", said, math.inf)
        if low > high:
            where = axis.find("limit")
            raise self.error(where, f"{said}: its lower limit of {low:g} is above its upper one of {high:g}")
        return (low if low > -UNLIMITED else -math.inf), (high if high < UNLIMITED else math.inf)

    def _number(self, axis: Any, path: str, said: str, default: float) -> float:
        """A limit; SDF writes -1 or nothing for no limit of velocity."""
        element = axis.find(path)
        if element is None or not (element.text or "").strip():
            return default
        value = number(element.text.strip())
        word = path.rpartition("/")[2]
        if math.isnan(value):
            raise self.error(element, f"{said}: its {word} limit '{element.text.strip()}' is no number")
        if word == "velocity" and value < 0.0:
            if value != -1.0:
                raise self.error(element, f"{said}: its limit of velocity is {value:g}, below 0")
            return math.inf
        return value

    def pose(self, element: Any) -> Array:
        """The matrix (4, 4) of an element's <pose>, in whatever frame it names."""
        pose = element.find("pose")
        text = "" if pose is None else (pose.text or "").strip()
        if not text:
            return np.eye(4)
        found = numbers(text)
        quaternion = pose.get("rotation_format") == "quat_xyzw"
        if found is None or len(found) != (7 if quaternion else 6):
            raise self.error(pose, f"the pose '{text}' must be {'seven' if quaternion else 'six'} numbers{SIZE}")
        matrix = np.eye(4)
        matrix[:3, 3] = found[:3]
        if quaternion:
            x, y, z, w = found[3:]
            if math.hypot(x, y, z, w) <= 1e-9:
                raise self.error(pose, f"the quaternion of the pose '{text}' is 0: it turns no way")
            matrix[:3, :3] = of_quaternion(w, x, y, z)
        else:
            degrees = pose.get("degrees", "false") in ("1", "true")
            matrix = of_origin(found[:3], [math.radians(a) if degrees else a for a in found[3:]])
        return matrix


class _Poses:
    """Where the links, joints, frames and models of one model stand, in the outermost model's frame.

    Names are looked up in the model itself; `inner::name` is in a model within it.
    """

    def __init__(self, reader: _Reader, model: Any, placed: Array, prefix: str) -> None:
        self.reader, self.model, self.placed, self.prefix = reader, model, placed, prefix
        self.elements: dict[str, Any] = {}
        for tag in ("link", "model", "frame", "joint"):  # files before 1.7 give a joint and a link the same name
            for element in model.iterchildren(tag):
                self.elements.setdefault(str(element.get("name", "")), element)
        self.found: dict[Any, Array] = {}
        self.within: dict[Any, _Poses] = {}
        self.asked: set[Any] = set()

    def of(self, name: str, where: Any) -> Array:
        """The placement of what bears this name; `where` is the element that speaks of it."""
        if name in ("__model__", ""):
            return self.placed
        element, inner, rest = self._find(name)
        if inner is not None:
            return inner.of(rest, where)
        if element is not None:
            return self.of_element(element)
        if name == _WORLD:
            return np.eye(4)
        known = [*self.elements, "__model__"]
        raise self.reader.error(where, f"no frame '{name}'{did_you_mean(name, known)}")

    def of_element(self, element: Any) -> Array:
        """The placement of a link, joint, frame or model."""
        chain, at = [], element  # each is placed relative to the next
        while at is not None and at not in self.found:
            if at in self.asked:
                raise self.reader.error(at, f"the pose of '{at.get('name')}' is given relative to itself")
            self.asked.add(at)
            chain.append(at)
            at = self._find(self._base(at)[0])[0]
        for one in reversed(chain):
            self.found[one] = self.of(*self._base(one)) @ self.reader.pose(one)
        self.asked.difference_update(chain)
        return self.found[element]

    def inner(self, model: Any) -> _Poses:
        """The same of a model within this one."""
        if model not in self.within:
            prefix, placed, held = f"{self.prefix}{model.get('name')}::", self.of_element(model), np.eye(4)
            if model.get("placement_frame"):  # that is what the pose places
                held = _Poses(self.reader, model, np.eye(4), prefix).of(model.get("placement_frame"), model)
            self.within[model] = _Poses(self.reader, model, placed @ inverse(held), prefix)
        return self.within[model]

    def link(self, name: str, where: Any, wrong: str = "") -> str:
        """The link, by its full name, that a name stands for: what a frame is attached to, a joint's child.

        Args:
            name: of a link, a frame, a joint or a model.
            where: the element that speaks of it.
            wrong: what to say if there is none.
        """
        passed = set()
        while name not in ("__model__", ""):
            element, inner, rest = self._find(name)
            if inner is not None:
                return inner.link(rest, where, wrong)
            if element is None and name == _WORLD:
                return _WORLD
            if element is None:
                near = did_you_mean(name, [_WORLD, *self.elements])
                raise self.reader.error(where, (wrong or f"no link or frame '{name}'") + near)
            if element.tag == "link":
                return self.prefix + name
            if element.tag == "model":
                return self.inner(element).canonical()
            if element in passed:
                raise self.reader.error(element, f"the {element.tag} '{name}' is attached to itself")
            passed.add(element)
            child, where = element.find("child"), element
            name = element.get("attached_to", "") if element.tag == "frame" else "" if child is None else _named(child)
        return self.canonical()

    def canonical(self) -> str:
        """The link, by its full name, that the model's own frame is attached to."""
        said = self.model.get("canonical_link")
        if said:
            return self.link(said, self.model, f"the canonical link '{said}' does not exist")
        for link in self.model.iterchildren("link"):
            return self.prefix + str(link.get("name", ""))
        for model in self.model.iterchildren("model"):
            return self.inner(model).canonical()
        raise self.reader.error(self.model, f"the model '{self.model.get('name', '')}' has no link")

    def _find(self, name: str) -> tuple[Any, _Poses | None, str]:
        """The element of that name; or the model within this one where the rest of the name is to be looked up."""
        if name in ("__model__", _WORLD, ""):
            return None, None, ""
        if name in self.elements:
            return self.elements[name], None, ""
        for model in self.model.iterchildren("model"):
            if name.startswith(f"{model.get('name')}::"):
                return None, self.inner(model), name[len(str(model.get("name"))) + 2 :]
        return None, None, ""

    def _base(self, element: Any) -> tuple[str, Any]:
        """The name of what an element's pose is relative to, and the element that says so."""
        pose = element.find("pose")
        said = None if pose is None else pose.get("relative_to") or pose.get("frame")
        if said:
            return str(said), pose
        if element.tag == "joint":
            child = element.find("child")
            return ("", element) if child is None else (_named(child), child)
        return (element.get("attached_to") or "" if element.tag == "frame" else ""), element


def _named(end: Any) -> str:
    """The name that a joint's <parent> or <child> holds."""
    return str(end.get("link_name") or end.text or "").strip()


class _Writer:
    """A model as a tree of joints, and loops."""

    def __init__(self, name: str, model: _Model) -> None:
        self.name, self.model = name, model
        self.placements = {**model.placements, _WORLD: np.eye(4)}
        self.links: list[yourdfpy.Link] = []
        self.joints: list[yourdfpy.Joint] = []
        self.entries: list[dict[str, Any]] = []
        self.loops: list[dict[str, Any]] = []
        self.taken = {*model.links, *model.frames, *(joint.name for joint in model.joints)}
        self.said = {} if model.ours is None else {e.get("name"): e for e in model.ours if isinstance(e.tag, str)}

    def write(self) -> tuple[str, Constraints]:
        tree, cut, root = self._spanned()
        free = self.model.ours is not None and root != _WORLD
        if root == _WORLD or free:
            self.links.append(yourdfpy.Link(name=_WORLD))
        if free:  # raff2urdf fixes a base to the world unless it can move
            freed = yourdfpy.Joint(name=BASE_JOINT, type="floating", parent=_WORLD, child=root)
            freed.origin = self.placements[root]
            self.joints.append(freed)
        self.links += [yourdfpy.Link(name=n, visuals=self._visuals(e)) for n, e in self.model.links.items()]
        self.links += [yourdfpy.Link(name=frame) for frame in self.model.frames]
        for frame, holder in self.model.frames.items():
            held = yourdfpy.Joint(name=self._free(f"{frame}_attached"), type="fixed", parent=holder, child=frame)
            held.origin = inverse(self.placements[holder]) @ self.placements[frame]
            self.joints.append(held)
        nodes = [root, *(n for n in (*self.model.links, *self.model.frames) if n != root)]
        if self.model.ours is not None and root == _WORLD and "base" in nodes:  # as raff2urdf has it
            nodes = ["base", *(node for node in nodes if node not in (_WORLD, "base"))]
        for joint, turned in tree:
            self._tree_joint(joint, turned)
        for joint in cut:
            self._loop(joint)
        urdf = dumps(yourdfpy.Robot(name=self.model.name, links=self.links, joints=self.joints))
        said: Constraints = {
            "robot": self.model.name,
            "nodes": nodes,
            "floating": BASE_JOINT if free else None,
            "joints": self.entries,
            "loops": self.loops,
        }
        return urdf, said

    def _spanned(self) -> tuple[list[tuple[_Joint, bool]], list[_Joint], str]:
        """Joints that make a tree, each with whether it is walked from child to parent; those that close loops; root.

        A link stands on the first joint of the file that reaches it: from its parent if any does, else from its child.
        """
        couplings = [j for j in self.model.joints if j.kind == _COUPLING or j.element.find("axis/mimic") is not None]
        if couplings:
            first, more = couplings[0], len(couplings) - 1
            others = f" and {more} more" if more else ""
            warnings.warn(
                f"{self.name}:{first.element.sourceline}: joint '{first.name}'{others} couples two joints: left out, "
                "both move on their own",
                RaffWarning,
                stacklevel=6,
            )
        joints = [joint for joint in self.model.joints if joint.kind != _COUPLING]
        fixed = self.model.fixed or any(_WORLD in (joint.parent, joint.child) for joint in joints)
        root = _WORLD if fixed else self.model.root or self._first(joints, set())
        reached, tree, left = {root}, [], list(joints)
        while True:
            step = next((j for j in left if j.parent in reached and j.child not in reached), None)
            ahead = step is not None
            step = step or next((j for j in left if j.child in reached and j.parent not in reached), None)
            if step is not None:
                left.remove(step)
                tree.append((step, not ahead))
                reached |= {step.parent, step.child}
            elif len(reached - {_WORLD}) < len(self.model.links):
                link = self._first(left, reached)  # it stands where it is, on nothing, with all that stands on it
                stands = yourdfpy.Joint(name=self._free(f"{link}_stands"), type="fixed", parent=root, child=link)
                stands.origin = inverse(self.placements[root]) @ self.placements[link]
                self.joints.append(stands)
                reached.add(link)
            else:
                return tree, left, root

    def _first(self, joints: Sequence[_Joint], reached: set[str]) -> str:
        """The first link, of those not reached, that no joint holds, or the first at all."""
        held = {joint.child for joint in joints}
        left = [link for link in self.model.links if link not in reached]
        return next((link for link in left if link not in held), left[0])

    def _free(self, name: str) -> str:
        """A name for something that the file does not name."""
        while name in self.taken:
            name += "_"
        self.taken.add(name)
        return name

    def _tree_joint(self, joint: _Joint, turned: bool) -> None:
        """One joint for each axis; the last one holds the link, by a fixed joint where the axis passes beside it."""
        father, child = (joint.child, joint.parent) if turned else (joint.parent, joint.child)
        way = -1.0 if turned else 1.0
        steps = list(zip(joint.axes, joint.limits, joint.velocities, strict=True))
        kind = _ONE.get(joint.kind, "revolute")
        if joint.kind == "ball":
            steps = [(joint.placement[:3, i], (-math.inf, math.inf), math.inf) for i in range(3)]
        if joint.kind == "fixed":
            steps = []
        if turned:
            steps.reverse()
        at = joint.placement.copy()
        beside = [skew(axis) @ (self.placements[child][:3, 3] - at[:3, 3]) for axis, _, _ in steps]
        through = kind == "prismatic" or all(np.abs(offset).max() <= _STRAIGHT for offset in beside)
        if through and len(steps) <= 1:
            at = self.placements[child]
        standing = self.placements[father]
        for i, (axis, limits, velocity) in enumerate(steps):
            name = joint.name if len(steps) == 1 else f"{joint.name}_{'XYZ'[i] if joint.kind == 'ball' else i + 1}"
            home, motor = self._own(name)
            last = i == len(steps) - 1 and np.array_equal(at, self.placements[child])
            holds = child if last else self._free(f"{name}_axis")
            if not last:
                self.links.append(yourdfpy.Link(name=holds))
            made = yourdfpy.Joint(name=name, type=kind, parent=father, child=holds)
            made.axis = way * (at[:3, :3].T @ axis)
            made.origin = inverse(standing) @ at @ inverse(_moved(kind, made.axis, home))
            made.limit = yourdfpy.Limit(effort=UNLIMITED, velocity=min(velocity, UNLIMITED))
            low, high = limits[0] + home, limits[1] + home
            made.limit.lower, made.limit.upper = max(low, -UNLIMITED), min(high, UNLIMITED)
            self.joints.append(made)
            self.entries.append({"name": name, "home": home, **motor})
            father, standing = holds, at
        if father != child:
            name = joint.name if not steps else self._free(f"{joint.name}_holds")
            made = yourdfpy.Joint(name=name, type="fixed", parent=father, child=child)
            made.origin = inverse(standing) @ self.placements[child]
            self.joints.append(made)

    def _own(self, joint: str) -> tuple[float, dict[str, bool]]:
        """What raff2urdf says of a joint: its value where the links stand, and whether it has a motor."""
        said = self.said.get(joint)
        if said is None:
            return 0.0, {}
        home = numbers(said.get("home", "0"))
        if home is None or len(home) != 1:
            raise RaffError(f"{self.name}:{said.sourceline}: home='{said.get('home')}' of a raff:joint is no number")
        return home[0], {"actuated": said.get("actuated") == "true"}

    def _loop(self, joint: _Joint) -> None:
        """A joint that was cut; of two axes, the first becomes a joint of the tree."""
        first, kind, axes = joint.parent, joint.kind, joint.axes
        if kind in _TWO:
            helper = self._free(f"{joint.name}_cross")
            self.placements[helper] = joint.placement
            half = _Joint(joint.element, f"{joint.name}_1", "revolute", first, helper, joint.placement, [], [], [])
            half.axes, half.limits, half.velocities = axes[:1], joint.limits[:1], joint.velocities[:1]
            self.links.append(yourdfpy.Link(name=helper))
            self._tree_joint(half, False)
            first, kind, axes = helper, "revolute", axes[1:]
        at = joint.placement.copy()
        if axes and kind != "fixed":
            at[:3, :3] = _with_z(axes[0])
        ends = ((word, node) for word, node in (("first", first), ("second", joint.child)))
        placed = {
            word: {"node": node, "placement": (inverse(self.placements[node]) @ at).tolist()} for word, node in ends
        }
        said = self.said.get(joint.name)
        if said is not None and all(said.get(word) in self.placements for word in placed):
            for word in placed:  # the ends that it had, of which SDF could say but one
                placed[word] = {"node": said.get(word), "placement": IDENTITY}
        self.loops.append({"name": joint.name, "kind": _LOOPS[kind], **placed})

    def _visuals(self, link: Any) -> list[yourdfpy.Visual]:
        found = []
        for visual in link.iterchildren("visual"):
            shapes = list(_geometry(visual.find("geometry")))
            reader = _Reader(self.name, (1, 7))
            for shape, offset in shapes:
                origin = reader.pose(visual) @ offset
                found.append(yourdfpy.Visual(origin=origin, geometry=shape, material=_material(visual)))
        return found


def _geometry(geometry: Any) -> Iterator[visuals.Shape]:
    """The shapes of a visual as a URDF has them, each with where it stands; what a URDF can't show is left out."""

    def three(path: str, default: str) -> Array:
        return np.array((numbers(geometry.findtext(path, default)) or numbers(default) or [])[:3])

    def one(path: str) -> float:
        return (numbers(geometry.findtext(path, "1")) or [1.0])[0]

    if geometry is None:
        return
    if geometry.find("box") is not None:
        yield visuals.box(three("box/size", "1 1 1"))
    if geometry.find("cylinder") is not None:
        yield visuals.cylinder(one("cylinder/radius"), one("cylinder/length"))
    if geometry.find("capsule") is not None:
        yield from visuals.capsule(one("capsule/radius"), one("capsule/length"))
    if geometry.find("sphere") is not None:
        yield visuals.sphere(one("sphere/radius"))
    if geometry.find("mesh") is not None:
        yield visuals.mesh(geometry.findtext("mesh/uri", "").strip(), three("mesh/scale", "1 1 1"))


def _material(visual: Any) -> yourdfpy.Material | None:
    for word in ("diffuse", "ambient"):
        found = numbers(visual.findtext(f"material/{word}", "none"))
        if found is not None and len(found) in (3, 4):
            return visuals.material([*found, 1.0][:4])
    return None


def _moved(kind: str, axis: Array, value: float) -> Array:
    """The placement (4, 4) that a joint brings about."""
    if kind != "prismatic":
        return turn(axis, value)
    moved = np.eye(4)
    moved[:3, 3] = value * axis
    return moved


def _with_z(axis: Array) -> Array:
    """A rotation (3, 3) whose z is the axis."""
    aside = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(aside, axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])
