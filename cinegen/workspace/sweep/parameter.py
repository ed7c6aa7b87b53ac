"""`Parameter`: a number of a RAFF file, by its name: `link2.d`, `tool.theta`, `link3.limits.low`."""

from __future__ import annotations

from dataclasses import dataclass, replace

from cinegen.workspace.errors import MapError
from raff2urdf.document import JointType, Parameters, RaffBase, RaffFrame, RaffLink, RaffNode, RaffRobot
from raff2urdf.errors import did_you_mean

KLEINFINGER = tuple(Parameters.__dataclass_fields__)
OF_JOINTS = ("limits.low", "limits.high", "velocity")
NAMES = (*KLEINFINGER, *OF_JOINTS)
"""What RAFF calls them."""


@dataclass(frozen=True)
class Parameter:
    """A number in a block of a RAFF file.

    Attributes:
        node: whose: its name, or what RAFF calls it with its number (link2, frame20, base).
        name: of `NAMES`.
        opposite: whether it takes a value's opposite: what stands on the other side of a plane of symmetry.

    Raises:
        MapError: no such parameter.
    """

    node: str
    name: str
    opposite: bool = False

    def __post_init__(self) -> None:
        if self.name not in NAMES:
            raise MapError(f"{self.node} has no parameter '{self.name}'{did_you_mean(self.name, NAMES)}")

    @classmethod
    def parse(cls, text: str) -> Parameter:
        """Reads `link2.d`, or `-link2.d` for the opposite.

        Raises:
            MapError: it is none.
        """
        whole = text.strip()
        whole, opposite = whole.removeprefix("-"), whole.startswith("-")
        name = next((name for name in NAMES if whole.endswith(f".{name}")), None)
        node = whole.removesuffix(f".{name}") if name else whole.rpartition(".")[0]
        if not node:
            raise MapError(f"'{text}' names no parameter: say whose and which, such as link2.d")
        return cls(node, name or whole.rpartition(".")[2], opposite)

    def __str__(self) -> str:
        return f"{'-' * self.opposite}{self.node}.{self.name}"

    def put(self, robot: RaffRobot, value: float) -> RaffRobot:
        """The robot with another value, in the file's own unit: of lengths, degrees, or either per second.

        Raises:
            MapError: the robot has no such node, or the node no such parameter.
        """
        part = self._part(robot)
        value = 0.0 - value if self.opposite else value
        if self.name in KLEINFINGER:
            changed = replace(part, parameters=replace(part.parameters, **{self.name: value}))
        else:
            changed = self._of_joint(part, value)
        if isinstance(changed, RaffBase):
            return replace(robot, base=changed)
        return replace(robot, parts=tuple(changed if one is part else one for one in robot.parts))

    def whose(self, robot: RaffRobot) -> str:
        """The name of its node: a frame that has one goes by its number, too.

        Raises:
            MapError: the robot has no such node.
        """
        return self._part(robot).node

    def _part(self, robot: RaffRobot) -> RaffNode:
        parts: dict[str, RaffNode] = {f"{_kind(part)}{part.number}": part for part in robot.parts}
        parts |= {part.node: part for part in (robot.base, *robot.parts)}
        if self.node not in parts:
            raise MapError(f"robot {robot.name} has no link or frame '{self.node}'{did_you_mean(self.node, [*parts])}")
        return parts[self.node]

    def _of_joint(self, part: RaffNode, value: float) -> RaffLink:
        if not isinstance(part, RaffLink) or part.type is JointType.FIXED:
            raise MapError(f"{self.node} does not move on its father: it has no {self.name} that could vary")
        if self.name == "velocity":
            return replace(part, velocity=value)
        if part.limits is None:
            raise MapError(f"{self.node} has no limits: write both into its file first, then vary {self.name}")
        low, high = part.limits
        return replace(part, limits=(value, high) if self.name == "limits.low" else (low, value))


def _kind(part: RaffLink | RaffFrame) -> str:
    return type(part).__name__.lower()
