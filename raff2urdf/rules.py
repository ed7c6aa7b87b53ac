"""The grammar's rules as values: puts the document together while the text is parsed."""

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
    """A word of a block with its value, before the block is put together."""

    word: str
    value: Any
    place: SourceLocation


def place_of(token: Token) -> SourceLocation:
    """Where a token stands."""
    return SourceLocation(token.line or 1, token.column or 1, len(token))


def _one(word: str) -> Any:
    """A rule that holds one token, kept as it stands until its owner reads it."""

    def rule(self: Build, token: Token) -> Statement:
        return Statement(word, token, place_of(token))

    return rule


def _text(word: str) -> Any:
    """A rule that holds one text."""

    def rule(self: Build, token: Token) -> Statement:
        return Statement(word, self._string(token), place_of(token))

    return rule


@v_args(inline=True)
class Build(Transformer[Token, Any]):
    """Puts the document together while the text is parsed; what is wrong goes to `report`."""

    report: Callable[[str, SourceLocation], None]
    lacks: Callable[[str, SourceLocation], None]

    # values
    def _number(self, token: Token) -> float:
        value = float(token)
        if not math.isfinite(value):
            self.report(f"'{token}' is too large for a number", place_of(token))
            return 0.0
        return value

    def _whole(self, token: Token, least: int = 0) -> int:
        value = self._number(token)
        if value != int(value) or value < least:
            self.report(f"'{token}' must be a whole number from {least}", place_of(token))
            return least
        return int(value)

    def _choice(self, token: Token, words: Sequence[str], what: str) -> int:
        """A whole number that stands for one of `words`."""
        value = self._number(token)
        if value != int(value) or not 0 <= value < len(words):
            meanings = ", ".join(f"{i} {word}" for i, word in enumerate(words))
            self.report(f"{what} {token} is unknown (known: {meanings})", place_of(token))
            return 0
        return int(value)

    def _string(self, token: Token) -> str:
        return str(token[1:-1]) if token.type == "STRING" else str(token)

    # blocks
    def _gather(self, owner: str, fields: Sequence[Statement], several: Sequence[str] = ()) -> dict[str, Statement]:
        """Fields by word; a word said twice is reported, unless it may stand several times."""
        found: dict[str, Statement] = {}
        for field in fields:
            if field.word in found and field.word not in several:
                message = f"'{field.word}' is said twice in {owner}: first on line {found[field.word].place.line}"
                self.report(message, field.place)
            found.setdefault(field.word, field)
        return found

    def start(self, header: Statement, *items: Any) -> dict[str, Any]:
        units = self._gather("the file", [item for item in items if isinstance(item, Statement)])
        return {
            "name": header.value,
            "robots": tuple(item for item in items if isinstance(item, RaffRobot)),
            "sensors": tuple(item for item in items if isinstance(item, RaffSensor)),
            "units": units["units"].value if "units" in units else "mm",
        }

    def header(self, token: Token) -> Statement:
        return Statement("RAFF", self._string(token), place_of(token))

    def units(self, token: Token) -> Statement:
        if token not in UNITS_PER_METRE:
            self.report(f"unknown unit '{token}' (known: {', '.join(UNITS_PER_METRE)})", place_of(token))
            return Statement("units", "mm", place_of(token))
        return Statement("units", str(token), place_of(token))

    def robot(self, name: Token, *parts: Any) -> RaffRobot:
        fields = self._gather(f"robot {name}", [part for part in parts if isinstance(part, Statement)])
        places = {"name": place_of(name)} | {word: field.place for word, field in fields.items()}
        return RaffRobot(
            name=self._string(name),
            base=fields["base"].value if "base" in fields else RaffBase(),
            parts=tuple(part for part in parts if isinstance(part, RaffLink | RaffFrame)),
            loops=tuple(part for part in parts if isinstance(part, RaffLoop)),
            sensor_constraints=tuple(part for part in parts if isinstance(part, SensorConstraint)),
            path=fields["path"].value if "path" in fields else None,
            places=places,
        )

    type, pred, velocity, actuated = _one("type"), _one("pred"), _one("velocity"), _one("actuated")
    closure, translation, rotation = _one("type"), _one("translation"), _one("rotation")
    path, name, port = _text("path"), _text("name"), _text("port")

    def parameter(self, word: Token, number: Token) -> Statement:
        return Statement(str(word), self._number(number), place_of(word))

    def parameters(self, keyword: Token, *fields: Statement) -> Statement:
        found = self._gather("these parameters", fields)
        values = {word: field.value for word, field in found.items()}
        return Statement("parameters", Parameters(**values), place_of(keyword))

    def limits(self, low: Token, high: Token) -> Statement:
        return Statement("limits", (self._number(low), self._number(high)), place_of(low))

    def filename(self, keyword: Token, *tokens: Token) -> Statement:
        return Statement("filename", tuple(self._string(token) for token in tokens), place_of(keyword))

    def _common(self, owner: str, fields: Sequence[Statement]) -> tuple[dict[str, Statement], dict[str, Any]]:
        """What base, link and frame share: their fields by word, and the arguments common to all three."""
        found = self._gather(owner, fields, several=["filename"])
        said = [field.value for field in fields if field.word == "filename"]
        filenames = tuple(name for names in said for name in names) if said else None
        places = {word: field.place for word, field in found.items()}
        parameters = found["parameters"].value if "parameters" in found else Parameters()
        return found, {"parameters": parameters, "filenames": filenames, "places": places}

    def base(self, keyword: Token, *fields: Statement) -> Statement:
        _, common = self._common("the base", fields)
        return Statement("base", RaffBase(**common), place_of(keyword))

    def link(self, number: Token, *fields: Statement) -> RaffLink:
        owner = f"link {number}"
        found, common = self._common(owner, fields)
        common["places"]["number"] = place_of(number)
        kind = found.get("type")
        if kind is None:
            self.lacks(f"{owner} has no 'type' (0 fixed, 1 prismatic, 2 revolute)", place_of(number))
        velocity = found.get("velocity")
        actuated = found.get("actuated")
        return RaffLink(
            number=self._whole(number, 1),
            type=JointType(self._choice(kind.value, [t.name.lower() for t in JointType], "joint type") if kind else 0),
            pred=self._pred(owner, number, found),
            limits=found["limits"].value if "limits" in found else None,
            velocity=self._number(velocity.value) if velocity else None,
            actuated=bool(self._choice(actuated.value, ["no motor", "motor"], "'actuated'")) if actuated else None,
            name=found["name"].value if "name" in found else None,
            **common,
        )

    def frame(self, number: Token, *fields: Statement) -> RaffFrame:
        owner = f"frame {number}"
        found, common = self._common(owner, fields)
        common["places"]["number"] = place_of(number)
        name = found["name"].value if "name" in found else None
        return RaffFrame(number=self._whole(number, 1), pred=self._pred(owner, number, found), name=name, **common)

    def _pred(self, owner: str, number: Token, found: dict[str, Statement]) -> int:
        if "pred" not in found:
            self.lacks(f"{owner} has no 'pred': the number of the node it stands on (0: the base)", place_of(number))
            return 0
        return self._whole(found["pred"].value)

    def node(self, word: Token, number: Token | None = None) -> Statement:
        return Statement(
            "node", 0 if number is None else self._whole(number), place_of(word if number is None else number)
        )

    def choice(self, *tokens: Token) -> Statement:
        return Statement("sensor", [(self._whole(token), place_of(token)) for token in tokens], place_of(tokens[0]))

    def constraint(self, keyword: Token, *fields: Statement) -> RaffLoop | SensorConstraint:
        nodes = [field for field in fields if field.word == "node"]
        found = self._gather("this constraint", fields, several=["node"])
        place = fields[0].place if fields else place_of(keyword)
        places = {word: field.place for word, field in found.items()}
        if "sensor" in found:
            if len(nodes) != 1 or "type" in found:
                self.report("a constraint with sensors names one node, and no type", place)
            node = nodes[0].value if nodes else 0
            sensors = found["sensor"].value
            places |= {f"sensor {number}": where for number, where in sensors}
            return SensorConstraint(node, tuple(number for number, _ in sensors), places)
        if len(nodes) != 2:
            self.report("a constraint names two nodes (a loop), or one node and the sensors it may follow", place)
            return RaffLoop(0, 0, places=places)
        first, second = nodes
        places |= {"first": first.place, "second": second.place}
        kind = 0
        if "type" in found:
            kind = self._choice(found["type"].value, [kind.name.lower() for kind in LoopKind], "loop type")
        return RaffLoop(first.value, second.value, LoopKind(kind), places)

    def sensor(self, number: Token, *fields: Statement) -> RaffSensor:
        owner = f"sensor {number}"
        found = self._gather(owner, fields)
        if "port" not in found:
            self.lacks(f"{owner} has no 'port'", place_of(number))
        count = {}
        for word in ("translation", "rotation"):
            if word in found:
                count[word] = self._choice(found[word].value, ["none", "one", "two", "three"], f"'{word}'")
        return RaffSensor(
            number=self._whole(number, 1),
            port=found["port"].value if "port" in found else "",
            places={"number": place_of(number)} | {word: field.place for word, field in found.items()},
            **count,
        )
