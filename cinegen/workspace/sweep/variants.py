"""Variants of a robot: RAFF documents that differ in a few parameters, such as `link2.d=1500..2500:11`."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from cinegen.workspace.errors import MapError
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.quantities import (
    ANGLE,
    ANGULAR_SPEED,
    LENGTH,
    SPEED,
    Dimension,
    parse,
    parse_range,
    refused_as,
    shown,
)  # fmt: skip
from raff2urdf.raff.check import check_tree
from raff2urdf.raff.document import (
    UNITS_PER_METRE,
    Document,
    JointType,
    RaffBase,
    RaffLink,
    RaffNode,
    RaffParameters,
    RaffRobot,
)
from raff2urdf.raff.sizes import check_sizes
from raff2urdf.raff.writer import dumps, number

KLEINFINGER = tuple(RaffParameters.__dataclass_fields__)
NAMES = (*KLEINFINGER, "limits.low", "limits.high", "velocity")
"""Names of the parameters that can vary."""

MOST = 10_000
"""Number of variants of a sweep, and of values of a variation, at most."""

_FAR = 10.0
"""A length beyond this multiple of all lengths of a robot together can't be meant."""

_DIGITS = 12  # of a value: that many are the same in a name and in a file


@dataclass(frozen=True)
class SweptParameter:
    """A number in a block of a RAFF file: `link2.d`, `tool.theta`, `link3.limits.low`.

    Attributes:
        node: name of the base, link or frame, or what RAFF calls it with its number (link2, frame20, base).
        name: of `NAMES`.
        opposite: whether it takes the opposite of a value, as on the other side of a plane of symmetry.

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
    def parse(cls, text: str) -> SweptParameter:
        """Parse `link2.d`, or `-link2.d` for the opposite.

        Raises:
            MapError: the text is no parameter.
        """
        whole = text.strip().removeprefix("-")
        name = next((name for name in NAMES if whole.endswith(f".{name}")), whole.rpartition(".")[2])
        node = whole.removesuffix(f".{name}") if "." in whole else ""
        if not node:
            raise MapError(f"'{text}' is no parameter: give node and name, such as link2.d")
        return cls(node, name, text.strip().startswith("-"))

    def __str__(self) -> str:
        return f"{'-' * self.opposite}{self.node}.{self.name}"

    def put(self, robot: RaffRobot, value: float) -> RaffRobot:
        """Return the robot with another value, in the unit of its file: of lengths, degrees, or either per second.

        Raises:
            MapError: the robot has no such node, or the node has no such parameter.
        """
        part = self.part(robot)
        value = 0.0 - value if self.opposite else value
        if self.name in KLEINFINGER:
            changed = replace(part, parameters=replace(part.parameters, **{self.name: value}))
        elif not isinstance(part, RaffLink) or part.type is JointType.FIXED:
            raise MapError(f"{self.node} does not move on its parent: it has no {self.name} that could vary")
        elif self.name == "velocity":
            changed = replace(part, velocity=value)
        elif part.limits is None:
            raise MapError(f"{self.node} has no limits: write both into its file first, then vary {self.name}")
        else:
            low, high = part.limits
            changed = replace(part, limits=(value, high) if self.name == "limits.low" else (low, value))
        if isinstance(changed, RaffBase):
            return replace(robot, base=changed)
        return replace(robot, parts=tuple(changed if node is part else node for node in robot.parts))

    def dimension(self, robot: RaffRobot) -> Dimension:
        """Return the dimension of its values.

        Raises:
            MapError: the robot has no such node.
        """
        if self.name in KLEINFINGER:
            return LENGTH if self.name in ("r", "d", "epsilon") else ANGLE
        part = self.part(robot)
        prismatic = isinstance(part, RaffLink) and part.type is JointType.PRISMATIC
        if self.name == "velocity":
            return SPEED if prismatic else ANGULAR_SPEED
        return LENGTH if prismatic else ANGLE

    def si(self, document: Document, robot: RaffRobot) -> tuple[float, str]:
        """Return the factor from the unit of its file to SI units and radians, and the latter unit."""
        dimension = self.dimension(robot)
        length = 1.0 / UNITS_PER_METRE[document.units], "m"
        factor, unit = length if dimension in (LENGTH, SPEED) else (math.radians(1.0), "rad")
        return factor, unit if dimension in (LENGTH, ANGLE) else f"{unit}/s"

    def part(self, robot: RaffRobot) -> RaffNode:
        """Return the node's block.

        Raises:
            MapError: the robot has no such node.
        """
        parts: dict[str, RaffNode] = {
            f"{'link' if isinstance(part, RaffLink) else 'frame'}{part.number}": part for part in robot.parts
        }
        parts |= {part.node: part for part in (robot.base, *robot.parts)}
        if self.node not in parts:
            raise MapError(f"robot {robot.name} has no link or frame '{self.node}'{did_you_mean(self.node, [*parts])}")
        return parts[self.node]


@dataclass(frozen=True)
class Variation:
    """Parameters that all take the same value, one after the other of a range.

    Attributes:
        parameters: the parameters; those that are marked take the opposite value.
        low: the first value, in the unit of the file: a length (mm by default) or degrees.
        high: the last value.
        count: number of values, evenly spaced.

    Raises:
        MapError: invalid numbers.
    """

    parameters: tuple[SweptParameter, ...]
    low: float
    high: float
    count: int

    def __post_init__(self) -> None:
        where = self.heading
        if not self.parameters:
            raise MapError("a variation varies at least one parameter, such as link2.d")
        if not (math.isfinite(self.low) and math.isfinite(self.high)):
            raise MapError(f"{where}: {self.low:g}..{self.high:g} is no range of numbers")
        if not 0 < self.count <= MOST:
            raise MapError(f"{where}: {self.count} values: give 1 to {MOST}")
        if self.count == 1 and self.low != self.high:
            raise MapError(f"{where}: one value can't go from {self.low:g} to {self.high:g}: give 2 or more")
        if len(set(self.values)) < self.count:
            raise MapError(f"{where}: {self.count} values from {self.low:g} to {self.high:g} are not all different")
        if len({(p.node, p.name) for p in self.parameters}) < len(self.parameters):
            raise MapError(f"{where}: a parameter is named twice")

    @classmethod
    def typed(cls, text: str, document: Document, robot: str | None = None) -> Variation:
        """Parse what a person types: as `parse`, but in m and degrees, or with units: `link2.d=1.5..2.5:11`.

        Args:
            text: what was typed.
            document: the document that is varied.
            robot: the robot that is varied; the first unless given.

        Raises:
            MapError: as `parse`; or a number has the wrong dimension, or would fit in mm only.
        """
        names, equals, values = text.strip().partition("=")
        ends, colon, count = values.partition(":")
        chosen = document.robot(robot)
        dimensions = {SweptParameter.parse(name).dimension(chosen) for name in names.split("+")} if equals else set()
        if not equals or not ends:
            return cls.parse(text)
        if len(dimensions) > 1:
            raise MapError(f"{names}: parameters that vary together must be all lengths or all angles")
        (dimension,) = dimensions
        with refused_as(MapError, f"'{text}'"):
            both = parse_range(ends, dimension) if ".." in ends else (parse(ends, dimension),)
        size = sum(document.metres(abs(x)) for node in (chosen.base, *chosen.parts) for x in node.parameters.lengths)
        if dimension is LENGTH and _FAR * size < max(map(abs, both)) <= 1000.0 * _FAR * size:
            value = max(both, key=abs)
            raise MapError(
                f"'{text}': {shown(value, LENGTH)}, but all lengths of {chosen.name} together are {shown(size, LENGTH)}"
                f": did you mean {value:g} mm?"
            )
        scale = UNITS_PER_METRE[document.units] if dimension in (LENGTH, SPEED) else math.degrees(1.0)
        written = "..".join(f"{scale * value:.{_DIGITS}g}" for value in both)
        return cls.parse(f"{names}={written}{colon}{count}")

    @classmethod
    def parse(cls, text: str) -> Variation:
        """Parse `link2.d=1500..2500:11`, or one value, `link2.d=1500`, in the unit of the file.

        RaffParameters that vary together are joined by '+': `link2.d+link5.d=...`, `link2.r+-link5.r=...` with opposite
        values.

        Raises:
            MapError: the text is no variation; the message names the missing part.
        """
        names, equals, values = text.strip().partition("=")
        if not equals:
            raise MapError(f"'{text}' has no values: write for instance {names or 'link2.d'}=100..200:5")
        parameters = tuple(SweptParameter.parse(name) for name in names.split("+"))
        ends, colon, count = values.partition(":")
        low, dots, high = ends.partition("..")
        if dots and not colon:
            raise MapError(f"'{text}' lacks the number of values: write for instance {text.strip()}:5")

        def parsed(kind: Callable[[str], Any], value: str, expected: str) -> Any:
            try:
                return kind(value)
            except ValueError:
                example = "write for instance link2.d=100..200:5"
                raise MapError(f"'{text}': '{value.strip()}' is not a {expected}: {example}") from None

        first, last = (parsed(float, value, "number") for value in (low, high if dots else low))
        return cls(parameters, first, last, parsed(int, count if colon else "1", "number of values"))

    @property
    def heading(self) -> str:
        """Names of the parameters."""
        return "+".join(map(str, self.parameters))

    @property
    def values(self) -> tuple[float, ...]:
        """All values, rounded to 12 digits, which file names can hold."""
        return tuple(float(f"{value:.{_DIGITS}g}") + 0.0 for value in np.linspace(self.low, self.high, self.count))

    def __str__(self) -> str:
        return f"{self.heading}={number(self.low)}..{number(self.high)}:{self.count}"


@dataclass(frozen=True)
class Variant:
    """A document in which some parameters have other values.

    Attributes:
        name: such as `link2.d=1500`, several joined by ','.
        values: by the heading of each variation, in the unit of the file.
        document: the whole file.
    """

    name: str
    values: Mapping[str, float]
    document: Document

    def __repr__(self) -> str:
        return f"<Variant {self.name[:150]}>"

    def raff(self) -> str:
        """Return the text of its RAFF file, which reads back to the same document."""
        source = Path(self.document.source.name).name
        return dumps(self.document, (f"{source} with {self.name.replace(',', ', ')}",))


def variants(document: Document, variations: Sequence[Variation], robot: str | None = None) -> list[Variant]:
    """Return all combinations of the values of all variations, the last variation fastest.

    Args:
        document: the document that is varied.
        variations: of parameters that are all different.
        robot: the robot that is varied, of a document that holds several; the first unless given.

    Raises:
        RaffError: no such robot.
        MapError: a parameter does not exist or is varied twice; a file may not hold a value; there are too many
            variants.
    """
    if not variations:
        raise MapError("a sweep varies at least one parameter: give one, such as link2.d=100..200:5")
    chosen = document.robot(robot)
    named = Counter((p.part(chosen).node, p.name) for variation in variations for p in variation.parameters)
    for (node, name), times in named.items():
        if times > 1:
            raise MapError(f"{node}.{name} is varied twice: join parameters that vary together by '+'")
    count = math.prod(variation.count for variation in variations)
    if count > MOST:
        raise MapError(f"{count} variants: at most {MOST} can be compared. Give fewer values")
    combinations = []
    for values in product(*(variation.values for variation in variations)):
        by_heading = {variation.heading: value for variation, value in zip(variations, values, strict=True)}
        name = ",".join(f"{heading}={number(value)}" for heading, value in by_heading.items())
        changed = chosen
        for variation, value in zip(variations, values, strict=True):
            for parameter in variation.parameters:
                changed = parameter.put(changed, value)
        robots = tuple(changed if entry is chosen else entry for entry in document.robots)
        varied = replace(document, robots=robots)
        try:
            check_tree(varied)
            check_sizes(varied, varied.robot(changed.name))
        except RaffError as error:
            text = "; ".join(problem.message for problem in error.problems)
            raise MapError(f"{name}: this is no robot: {text}") from None
        combinations.append(Variant(name, by_heading, varied))
    return combinations
