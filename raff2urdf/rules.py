"""Values of the grammar's rules: the document is put together while the text is parsed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from lark import Token, Transformer
from lark.visitors import v_args

from raff2urdf.document import (
    UNITS_PER_METRE,
    JointType,
    LoopKind,
    Parameters,
    RaffBase,
    RaffFrame,
    RaffLink,
    RaffLoop,
    RaffRobot,
    RaffSensor,
    SensorConstraint,
)
from raff2urdf.errors import SourceLocation


@dataclass(frozen=True, slots=True)
class Statement:
    """A word of a block with its value."""

    word: str
    value: Any
    location: SourceLocation


def location_of(token: Token) -> SourceLocation:
    """Return the location of a token."""
    return SourceLocation(token.line or 1, token.column or 1, len(token))


def _number(word: str) -> Any:
    return lambda self, token: Statement(word, self._finite(token), location_of(token))


def _choice(word: str, what: str, meanings: Sequence[str], make: Callable[[int], Any] = int) -> Any:
    """Return a rule for a whole number that stands for one of the meanings."""
    known = ", ".join(f"{i} {meaning}" for i, meaning in enumerate(meanings))

    def rule(self: Build, token: Token) -> Statement:
        value = self._finite(token)
        if value != int(value) or not 0 <= value < len(meanings):
            self.report(f"{what} {token} is unknown (known: {known})", location_of(token))
            value = 0
        return Statement(word, make(int(value)), location_of(token))

    return rule


def _text(word: str) -> Any:
    return lambda self, token: Statement(word, _string(token), location_of(token))


def _string(token: Token) -> str:
    return str(token[1:-1]) if token.type == "STRING" else str(token)


def _names(kinds: type[JointType] | type[LoopKind]) -> list[str]:
    return [kind.name.lower() for kind in kinds]


@v_args(inline=True)
class Build(Transformer[Token, Any]):
    """Build the document while the text is parsed.

    Attributes:
        report: called with each problem and its location.
        report_missing: called with each statement that a block lacks.
    """

    report: Callable[[str, SourceLocation], None]
    report_missing: Callable[[str, SourceLocation], None]

    def _finite(self, token: Token) -> float:
        value = float(token)
        if not math.isfinite(value):
            self.report(f"'{token}' is too large for a number", location_of(token))
            return 0.0
        return value

    def _whole(self, token: Token, least: int = 0) -> int:
        value = self._finite(token)
        if value != int(value) or value < least:
            self.report(f"'{token}' must be a whole number from {least}", location_of(token))
            return least
        return int(value)

    def _values(
        self, owner: str, statements: Sequence[Statement], *required: tuple[str, str], at: Token | None = None
    ) -> tuple[dict[str, Any], dict[str, SourceLocation]]:
        """Return the values of a block by word, and their locations; of words that occur twice, the first.

        Args:
            owner: the block, in errors.
            statements: in it.
            required: words that it must have, and their meanings.
            at: the number of the block.
        """
        values: dict[str, Any] = {}
        locations: dict[str, SourceLocation] = {}
        for statement in statements:
            word = statement.word
            if word == "filenames" and word in values:
                values[word] += statement.value
            elif word in values and word != "node":
                message = f"'{word}' is given twice in {owner}: first on line {locations[word].line}"
                self.report(message, statement.location)
            values.setdefault(word, statement.value)
            locations.setdefault(word, statement.location)
        if at is not None:
            for word, meaning in required:
                if word not in values:
                    self.report_missing(f"{owner} has no '{word}'{meaning}", location_of(at))
            values["number"], locations["number"] = self._whole(at, 1), location_of(at)
        return values, locations

    # --- statements ---------------------------------------------------------------------------------------------

    type = _choice("type", "joint type", _names(JointType), JointType)
    closure = _choice("type", "loop type", _names(LoopKind), LoopKind)
    actuated = _choice("actuated", "'actuated'", ["passive", "actuated"], bool)
    translation, rotation = (
        _choice(word, f"'{word}'", ["none", "one", "two", "three"]) for word in ("translation", "rotation")
    )
    path, name, port, velocity = _text("path"), _text("name"), _text("port"), _number("velocity")

    def header(self, token: Token) -> Statement:
        return Statement("RAFF", _string(token), location_of(token))

    def units(self, token: Token) -> Statement:
        if token not in UNITS_PER_METRE:
            self.report(f"unknown unit '{token}' (known: {', '.join(UNITS_PER_METRE)})", location_of(token))
        return Statement("units", str(token), location_of(token))

    def parameter(self, word: Token, number: Token) -> Statement:
        return Statement(str(word), self._finite(number), location_of(word))

    def parameters(self, keyword: Token, *statements: Statement) -> Statement:
        values, _ = self._values("these parameters", statements)
        return Statement("parameters", Parameters(**values), location_of(keyword))

    def limits(self, low: Token, high: Token) -> Statement:
        return Statement("limits", (self._finite(low), self._finite(high)), location_of(low))

    def filename(self, keyword: Token, *tokens: Token) -> Statement:
        return Statement("filenames", tuple(map(_string, tokens)), location_of(keyword))

    def pred(self, token: Token) -> Statement:
        return Statement("pred", self._whole(token), location_of(token))

    def node(self, word: Token, number: Token | None = None) -> Statement:
        at = word if number is None else number
        return Statement("node", 0 if number is None else self._whole(number), location_of(at))

    def choice(self, *tokens: Token) -> Statement:
        sensors = [(self._whole(token), location_of(token)) for token in tokens]
        return Statement("sensor", sensors, location_of(tokens[0]))

    # --- blocks -------------------------------------------------------------------------------------------------

    def start(self, header: Statement, *items: Any) -> dict[str, Any]:
        values, _ = self._values("the file", [item for item in items if isinstance(item, Statement)])
        return {
            "name": header.value,
            "robots": tuple(item for item in items if isinstance(item, RaffRobot)),
            "sensors": tuple(item for item in items if isinstance(item, RaffSensor)),
            **values,
        }

    def robot(self, name: Token, *parts: Any) -> RaffRobot:
        values, locations = self._values(f"robot {name}", [part for part in parts if isinstance(part, Statement)])
        return RaffRobot(
            name=_string(name),
            parts=tuple(part for part in parts if isinstance(part, RaffLink | RaffFrame)),
            loops=tuple(part for part in parts if isinstance(part, RaffLoop)),
            sensor_constraints=tuple(part for part in parts if isinstance(part, SensorConstraint)),
            locations={"name": location_of(name)} | locations,
            **values,
        )

    def base(self, keyword: Token, *statements: Statement) -> Statement:
        values, locations = self._values("the base", statements)
        return Statement("base", RaffBase(**values, locations=locations), location_of(keyword))

    def link(self, number: Token, *statements: Statement) -> RaffLink:
        kind = ("type", " (0 fixed, 1 prismatic, 2 revolute)")
        values, locations = self._values(f"link {number}", statements, kind, _PRED, at=number)
        return RaffLink(**{**_DEFAULTS, "type": JointType.FIXED, **values}, locations=locations)

    def frame(self, number: Token, *statements: Statement) -> RaffFrame:
        values, locations = self._values(f"frame {number}", statements, _PRED, at=number)
        return RaffFrame(**{**_DEFAULTS, **values}, locations=locations)

    def sensor(self, number: Token, *statements: Statement) -> RaffSensor:
        values, locations = self._values(f"sensor {number}", statements, ("port", ""), at=number)
        return RaffSensor(**{"port": "", **values}, locations=locations)

    def constraint(self, keyword: Token, *statements: Statement) -> RaffLoop | SensorConstraint:
        nodes = [statement for statement in statements if statement.word == "node"]
        values, locations = self._values("this constraint", statements)
        at = statements[0].location if statements else location_of(keyword)
        if "sensor" in values:
            if len(nodes) != 1 or "type" in values:
                self.report("a constraint with sensors names one node, and no type", at)
            locations |= {f"sensor {number}": location for number, location in values["sensor"]}
            numbers = tuple(number for number, _ in values["sensor"])
            return SensorConstraint(nodes[0].value if nodes else 0, numbers, locations)
        if len(nodes) != 2:
            self.report("a constraint names two nodes (a loop), or one node and the sensors it may follow", at)
            return RaffLoop(0, 0)
        first, second = nodes
        locations |= {"first": first.location, "second": second.location}
        return RaffLoop(first.value, second.value, values.get("type", LoopKind.RIGID), locations)


_PRED = ("pred", ": the number of its parent (0: the base)")
_DEFAULTS: dict[str, Any] = {"parameters": Parameters(), "pred": 0}
