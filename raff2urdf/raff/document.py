"""The contents of a RAFF file as values. Nothing is converted: lengths and angles are in the file's own units.

Two documents are equal if they describe the same robots and sensors. Locations in the text, which error messages need,
are kept but do not count.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import KW_ONLY, dataclass, field
from enum import IntEnum, StrEnum
from functools import cached_property
from typing import ClassVar

from raff2urdf.errors import Problem, RaffError, did_you_mean
from raff2urdf.raff.source import Located, SourceText

LEAST_SIZE = 5.0
"""Longest length, mm, below which a file must state its units: it may well be in m."""

UNITS_PER_METRE: Mapping[str, float] = {"um": 1e6, "mm": 1e3, "cm": 1e2, "m": 1.0}


class JointType(IntEnum):
    """RAFF's `type` of a link: how it moves relative to its parent."""

    FIXED = 0
    PRISMATIC = 1
    REVOLUTE = 2


class CompoundKind(StrEnum):
    """RAFF's `joint` of a link: a joint of several variables."""

    BALL = "ball"
    UNIVERSAL = "universal"
    CYLINDRICAL = "cylindrical"
    PLANAR = "planar"


class LoopKind(IntEnum):
    """RAFF's `type` of a loop: the joint that was cut to make the mechanism a tree."""

    RIGID = 0
    PRISMATIC = 1
    REVOLUTE = 2
    BALL = 3


@dataclass(frozen=True, slots=True)
class RaffParameters:
    """Kleinfinger's six parameters in the file's units: r, d, epsilon lengths; theta, alpha, gamma degrees."""

    theta: float = 0.0
    r: float = 0.0
    d: float = 0.0
    alpha: float = 0.0
    gamma: float = 0.0
    epsilon: float = 0.0

    @property
    def lengths(self) -> tuple[float, float, float]:
        """r, d and epsilon."""
        return self.r, self.d, self.epsilon


class _Named:
    """Names of a node and its joint, which follow from the node's number unless the file gives a name."""

    __slots__ = ()
    keyword: ClassVar[str]
    number: int
    name: str | None

    @property
    def node(self) -> str:
        """Name of the node, in the URDF and in Python."""
        return f"{self.keyword}{self.number}" if self.name is None else self.name

    @property
    def joint(self) -> str:
        """Name of the joint between the node and its parent; a frame's joint is fixed."""
        return f"joint{self.number}"


Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class RaffInertial(Located):
    """The mass of a node, in its own frame: stated, or that of a solid of one density. Lengths in the file's unit.

    Attributes:
        mass: kg; None with a density.
        centre: of mass.
        moments: of inertia about the centre, Ixx, Iyy, Izz: kg times the square of the unit of length.
        products: of inertia, Ixy, Ixz, Iyz, the off-diagonal elements of the inertia matrix.
        density: kg/m3, of the node's graphics, or of bars.
        radius: of bars along the node's parameters, which take the place of its graphics.
    """

    mass: float | None = None
    centre: Vector = (0.0, 0.0, 0.0)
    moments: Vector = (0.0, 0.0, 0.0)
    products: Vector = (0.0, 0.0, 0.0)
    density: float | None = None
    radius: float | None = None


@dataclass(frozen=True, slots=True)
class RaffBase(Located):
    """The root of a robot: node number 0, named `base`; `parameters` place it in the world."""

    keyword: ClassVar[str] = "base"
    number: ClassVar[int] = 0
    node: ClassVar[str] = "base"
    parameters: RaffParameters = RaffParameters()
    filenames: tuple[str, ...] | None = None  # None: the file names none, and a skeleton is drawn
    inertial: RaffInertial | None = None  # None: the mass is not in the file


@dataclass(frozen=True, slots=True, kw_only=True)
class RaffMotion(Located):
    """A joint of one variable, or one of several variables: what the file states, else None. Lengths, or degrees.

    Attributes:
        limits: lower and upper limit.
        velocity: velocity limit, 1/s.
        effort: limit of its actuator's torque or force, N m or N.
        armature: inertia of rotors seen at the joint, kg times lengths squared, or kg.
        damping: torque or force by velocity: N m or N times seconds, per degree or length.
        friction: of Coulomb, N m or N.
        actuated: whether it is actuated.
    """

    limits: tuple[float, float] | None = None
    velocity: float | None = None
    effort: float | None = None
    armature: float | None = None
    damping: float | None = None
    friction: float | None = None
    actuated: bool | None = None


OF_JOINT = tuple(RaffMotion.__annotations__)
"""Statements about a joint of one variable, or about one of several variables."""


@dataclass(frozen=True, slots=True)
class RaffVariable(RaffMotion):
    """A variable of a joint that has several: see `raff2urdf.raff.compound`.

    Attributes:
        name: x, y or z, a rotation about that axis; tx, ty or tz, a translation along it.
        home: its value as written, unless `theta` or `r` of the link's parameters is.
    """

    name: str
    home: float = 0.0


@dataclass(frozen=True, slots=True)
class RaffLink(_Named, RaffMotion):
    """A body that moves relative to its parent `pred` by one joint, or is fixed to it if `type` is FIXED.

    If its joint has several variables, `compound` is its kind and `type` is FIXED; `variables` are those that the file
    describes. `own_joint` is the name of its joint, if that does not follow from the number.
    """

    keyword: ClassVar[str] = "link"
    number: int
    parameters: RaffParameters
    type: JointType
    pred: int
    _: KW_ONLY
    compound: CompoundKind | None = None
    variables: tuple[RaffVariable, ...] = ()
    own_joint: str | None = None
    name: str | None = None
    filenames: tuple[str, ...] | None = None  # None: the file names none, and a skeleton is drawn
    inertial: RaffInertial | None = None  # None: the mass is not in the file

    @property
    def joint(self) -> str:
        """Name of the joint between the link and its parent."""
        return f"joint{self.number}" if self.own_joint is None else self.own_joint


@dataclass(frozen=True, slots=True)
class RaffFrame(_Named, Located):
    """A coordinate system fixed to the base, a link or another frame."""

    keyword: ClassVar[str] = "frame"
    number: int
    parameters: RaffParameters
    pred: int
    name: str | None = None
    filenames: tuple[str, ...] | None = None  # None: the file names none, and a skeleton is drawn
    inertial: RaffInertial | None = None  # None: the mass is not in the file


RaffPart = RaffLink | RaffFrame
"""A node with a parent."""

RaffNode = RaffBase | RaffPart


@dataclass(frozen=True, slots=True)
class RaffLoop(Located):
    """Two nodes, by number, whose frames coincide up to the degrees of freedom of the joint `kind`."""

    first: int
    second: int
    kind: LoopKind = LoopKind.RIGID


class DriveKind(IntEnum):
    """The word of RAFF with which a coupling's link drives: how its number is meant."""

    RATIO = 0
    LEAD = 1
    RADIUS = 2
    POLYNOMIAL = 3


@dataclass(frozen=True, slots=True)
class RaffDrive:
    """A link, by number, whose joint drives a coupling.

    Attributes:
        link: its number.
        kind: meaning of the numbers: `RATIO` of two joints of one type; `LEAD` of a screw, lengths per revolution;
            `RADIUS` of a pinion or pulley; `POLYNOMIAL` in the variable of the joint, without its constant term.
        numbers: one; of a polynomial, the coefficients of the powers from 1 on.
    """

    link: int
    kind: DriveKind
    numbers: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class RaffCoupling(Located):
    """A link, by number, whose joint variable is `offset` plus what each drive adds: gears, belts, screws ..."""

    follower: int
    drives: tuple[RaffDrive, ...]
    offset: float = 0.0
    name: str | None = None


@dataclass(frozen=True, slots=True)
class SensorConstraint(Located):
    """A node, by number, that may follow one of `sensors`; 0 among them means that it may be left free."""

    node: int
    sensors: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class RaffSensor(Located):
    """An input device on a port, with the number of translations and rotations that it commands.

    `axes` is a text as `raff2urdf.axes` describes it; None: unchanged.
    """

    number: int
    port: str
    translation: int = 3
    rotation: int = 3
    axes: str | None = None


@dataclass(frozen=True)
class RaffRobot(Located):
    """One robot of a file: `parts` are its links and frames in file order, a tree under `base`."""

    name: str
    base: RaffBase = RaffBase()
    parts: tuple[RaffPart, ...] = ()
    loops: tuple[RaffLoop, ...] = ()
    couplings: tuple[RaffCoupling, ...] = ()
    sensor_constraints: tuple[SensorConstraint, ...] = ()
    path: str | None = None

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
    def children(self) -> Mapping[int, list[RaffPart]]:
        """Links and frames by the number of their parent, in file order."""
        by_parent: dict[int, list[RaffPart]] = {}
        for part in self.parts:
            by_parent.setdefault(part.pred, []).append(part)
        return by_parent

    @cached_property
    def outward(self) -> tuple[RaffPart, ...]:
        """Links and frames in depth-first order: every parent before its children."""
        order: list[RaffPart] = []
        pending = self.children.get(0, [])[::-1]
        while pending:
            order.append(pending.pop())
            pending += self.children.get(order[-1].number, [])[::-1]
        return tuple(order)

    @cached_property
    def depth(self) -> Mapping[int, int]:
        """The number of joints, fixed ones too, between the base and each node, by its number."""
        depths = {0: 0}
        for part in self.outward:
            depths[part.number] = depths[part.pred] + 1
        return depths

    @property
    def movable(self) -> bool:
        """True if the base can move, because a sensor constraint names it."""
        return any(constraint.node == 0 for constraint in self.sensor_constraints)

    @cached_property
    def loop_names(self) -> tuple[str, ...]:
        """Names of the loops, such as `link5-link11`; a second loop between the same nodes ends in `#2`, and so on."""
        return _distinct(f"{self.nodes[loop.first].node}-{self.nodes[loop.second].node}" for loop in self.loops)

    @cached_property
    def coupling_names(self) -> tuple[str, ...]:
        """Names of the couplings: the file's, or such as `joint5-joint3`, the follower first; distinct as loops'."""
        return _distinct(
            c.name or "-".join(f"joint{number}" for number in (c.follower, *(drive.link for drive in c.drives)))
            for c in self.couplings
        )


def _distinct(names: Iterable[str]) -> tuple[str, ...]:
    seen: dict[str, int] = {}
    distinct = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        distinct.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return tuple(distinct)


@dataclass(frozen=True, slots=True)
class Document:
    """A whole RAFF file.

    Attributes:
        name: the word after `RAFF` in its first line.
        units: unit of every length in it: "mm" (default), "um", "cm" or "m".
        gravity: acceleration in the world, m/s2 whatever the unit of lengths; None: not in the file.
        states_units: whether the text states them; False if they are the default.
    """

    name: str
    robots: tuple[RaffRobot, ...] = ()
    sensors: tuple[RaffSensor, ...] = ()
    units: str = "mm"
    gravity: Vector | None = None
    states_units: bool = field(default=True, compare=False, repr=False)
    source: SourceText = field(default_factory=SourceText, compare=False, repr=False)

    def robot(self, name: str | None = None) -> RaffRobot:
        """Return the robot of that name, or the first one.

        Raises:
            RaffError: there is no such robot; the message lists those that exist.
        """
        for robot in self.robots:
            if name is None or robot.name == name:
                return robot
        if name is None:
            raise RaffError(self.source.problem("the file has no robot: add 'robot NAME { }'"))
        names = [robot.name for robot in self.robots]
        raise RaffError(self.problem(f"there is no robot '{name}'{did_you_mean(name, names)}"))

    def problem(self, message: str, statement: Located | None = None, *words: str) -> Problem:
        """Return a problem at the first of some words that the statement has."""
        at = (statement.locations.get(word) for word in words) if statement is not None else ()
        return self.source.problem(message, next(filter(None, at), None))

    def metres(self, length: float) -> float:
        """Convert a length of the file to metres, by a division: 211.21 mm is the double nearest to 0.21121."""
        return length / UNITS_PER_METRE[self.units]
