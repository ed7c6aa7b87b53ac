"""What a RAFF file says, as values: nothing is converted, so lengths and angles are the file's own.

A `Document` equals another when it says the same; where its words stand in a text is kept beside it (for
error messages) and doesn't count.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import ClassVar

from raff2urdf.errors import Problem, RaffError, SourceLocation, did_you_mean

UNITS_PER_METRE: Mapping[str, float] = {"um": 1e6, "mm": 1e3, "cm": 1e2, "m": 1.0}


class JointType(IntEnum):
    """RAFF's `type` of a link: how it moves on its father."""

    FIXED = 0
    PRISMATIC = 1
    REVOLUTE = 2


class LoopKind(IntEnum):
    """RAFF's `type` of a loop: the joint that was cut to make the mechanism a tree."""

    RIGID = 0
    PRISMATIC = 1
    REVOLUTE = 2
    BALL = 3


@dataclass(frozen=True, slots=True)
class Parameters:
    """Kleinfinger's six parameters in the file's units: r, d, epsilon lengths; theta, alpha, gamma degrees."""

    theta: float = 0.0
    r: float = 0.0
    d: float = 0.0
    alpha: float = 0.0
    gamma: float = 0.0
    epsilon: float = 0.0


Places = Mapping[str, SourceLocation]


def _places() -> Places:
    return {}


@dataclass(frozen=True, slots=True)
class RaffBase:
    """The root of a robot: node number 0, named `base`; `parameters` place it in the world."""

    keyword: ClassVar[str] = "base"

    parameters: Parameters = Parameters()
    filenames: tuple[str, ...] | None = None  # None: the file names none, and a skeleton is drawn
    places: Places = field(default_factory=_places, compare=False, repr=False)

    @property
    def number(self) -> int:
        """0: the base is the node that has no other number."""
        return 0

    @property
    def node(self) -> str:
        """The node's name."""
        return "base"


@dataclass(frozen=True, slots=True)
class RaffLink:
    """A body that moves on its father `pred` by one joint (none if `type` is FIXED)."""

    keyword: ClassVar[str] = "link"
    number: int
    parameters: Parameters
    type: JointType
    pred: int
    limits: tuple[float, float] | None = None  # of theta (degrees) or r
    velocity: float | None = None  # degrees or lengths per second
    actuated: bool | None = None  # None: the file doesn't say
    name: str | None = None
    filenames: tuple[str, ...] | None = None  # None: the file names none, and a skeleton is drawn
    places: Places = field(default_factory=_places, compare=False, repr=False)

    @property
    def node(self) -> str:
        """The node's name: what URDF, API and page show."""
        return self.name if self.name is not None else f"link{self.number}"

    @property
    def joint(self) -> str:
        """The name of the joint that moves this link."""
        return f"joint{self.number}"


@dataclass(frozen=True, slots=True)
class RaffFrame:
    """A coordinate system fixed on a base, link or frame."""

    keyword: ClassVar[str] = "frame"
    number: int
    parameters: Parameters
    pred: int
    name: str | None = None
    filenames: tuple[str, ...] | None = None  # None: the file names none, and a skeleton is drawn
    places: Places = field(default_factory=_places, compare=False, repr=False)

    @property
    def node(self) -> str:
        """The node's name: what URDF, API and page show."""
        return self.name if self.name is not None else f"frame{self.number}"

    @property
    def joint(self) -> str:
        """The name of the fixed joint that holds this frame in the URDF."""
        return f"joint{self.number}"


RaffPart = RaffLink | RaffFrame
"""A node that is placed on another one."""

RaffNode = RaffBase | RaffPart


@dataclass(frozen=True, slots=True)
class RaffLoop:
    """Two nodes, by number, whose frames coincide up to the freedoms of the joint `kind`."""

    first: int
    second: int
    kind: LoopKind = LoopKind.RIGID
    places: Places = field(default_factory=_places, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class SensorConstraint:
    """A node, by number, that may follow one of `sensors`; 0 among them means that it may be left free."""

    node: int
    sensors: tuple[int, ...]
    places: Places = field(default_factory=_places, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class RaffSensor:
    """An input device on a port, with the freedoms it commands."""

    number: int
    port: str
    translation: int = 3
    rotation: int = 3
    places: Places = field(default_factory=_places, compare=False, repr=False)


@dataclass(frozen=True)
class RaffRobot:
    """One robot of a file: `parts` are its links and frames in file order, a tree under `base`."""

    name: str
    base: RaffBase = RaffBase()
    parts: tuple[RaffPart, ...] = ()
    loops: tuple[RaffLoop, ...] = ()
    sensor_constraints: tuple[SensorConstraint, ...] = ()
    path: str | None = None
    places: Places = field(default_factory=_places, compare=False, repr=False)

    @cached_property
    def links(self) -> tuple[RaffLink, ...]:
        """The links, in file order."""
        return tuple(part for part in self.parts if isinstance(part, RaffLink))

    @cached_property
    def frames(self) -> tuple[RaffFrame, ...]:
        """The frames, in file order."""
        return tuple(part for part in self.parts if isinstance(part, RaffFrame))

    @cached_property
    def nodes(self) -> Mapping[int, RaffNode]:
        """Every node by its number: base first, then file order."""
        return {0: self.base} | {part.number: part for part in self.parts}

    @cached_property
    def outward(self) -> tuple[RaffPart, ...]:
        """Links and frames ordered so that a father stands before its children (file order else)."""
        children: dict[int, list[RaffPart]] = {}
        for part in self.parts:
            children.setdefault(part.pred, []).append(part)
        order: list[RaffPart] = []
        waiting = list(reversed(children.get(0, [])))
        while waiting:
            part = waiting.pop()
            order.append(part)
            waiting.extend(reversed(children.get(part.number, [])))
        return tuple(order)

    @property
    def movable(self) -> bool:
        """Whether the base can move: some sensor constraint names it."""
        return any(constraint.node == 0 for constraint in self.sensor_constraints)

    @cached_property
    def loop_names(self) -> tuple[str, ...]:
        """A name for each loop, `link5-link11`; a second loop between the same nodes gets `#2`, and so on."""
        seen: dict[str, int] = {}
        names = []
        for loop in self.loops:
            name = f"{self.nodes[loop.first].node}-{self.nodes[loop.second].node}"
            seen[name] = seen.get(name, 0) + 1
            names.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
        return tuple(names)


@dataclass(frozen=True, slots=True)
class SourceText:
    """The text a document was read from, kept to show where a problem stands."""

    name: str = "<document>"
    lines: tuple[str, ...] = ()

    def problem(self, message: str, place: SourceLocation | None = None) -> Problem:
        """A problem with this source's name and the line it stands on."""
        text = self.lines[place.line - 1] if place and 0 < place.line <= len(self.lines) else ""
        return Problem(message, self.name, place, text)


@dataclass(frozen=True, slots=True)
class Document:
    """A whole RAFF file.

    Attributes:
        name: what stands behind `RAFF` in its first line.
        units: unit of every length in it: "mm" (default), "um", "cm" or "m".
    """

    name: str
    robots: tuple[RaffRobot, ...] = ()
    sensors: tuple[RaffSensor, ...] = ()
    units: str = "mm"
    source: SourceText = field(default_factory=SourceText, compare=False, repr=False)

    def robot(self, name: str | None = None) -> RaffRobot:
        """The robot of that name, or the first one.

        Raises:
            RaffError: there is none; the message lists those that exist.
        """
        for robot in self.robots:
            if name is None or robot.name == name:
                return robot
        if name is None:
            raise RaffError(self.source.problem("the file holds no robot"))
        names = [robot.name for robot in self.robots]
        raise RaffError(self.source.problem(f"no robot '{name}'{did_you_mean(name, names)}"))

    def metres(self, length: float) -> float:
        """A length of the file in metres (a division, so that 211.21 mm is the double nearest to 0.21121)."""
        return length / UNITS_PER_METRE[self.units]
