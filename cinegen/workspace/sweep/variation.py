"""`Variation`: parameters that vary together over a range: `link2.d=1500..2500:11`."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from cinegen.workspace.errors import MapError
from cinegen.workspace.sweep.parameter import Parameter
from raff2urdf.writer import number

_RANGE = re.compile(r"(?P<low>.+?)\.\.(?P<high>[^:]+)(:(?P<count>.*))?")
_DIGITS = 12  # of a value: that many are the same in a name and in a file
_MOST = 10_000  # values


@dataclass(frozen=True)
class Variation:
    """Parameters that all take the same value, one after the other of a range.

    Attributes:
        parameters: which; those that are marked so take the opposite value.
        low: the first value, in the file's own unit: a length (mm unless it says otherwise) or degrees.
        high: the last one.
        count: how many values, evenly spread.

    Raises:
        MapError: numbers that make no sense.
    """

    parameters: tuple[Parameter, ...]
    low: float
    high: float
    count: int

    def __post_init__(self) -> None:
        where = self.heading
        if not self.parameters:
            raise MapError("a variation varies at least one parameter, such as link2.d")
        if not (math.isfinite(self.low) and math.isfinite(self.high)):
            raise MapError(f"{where}: {self.low:g}..{self.high:g} is no range of numbers")
        if not 0 < self.count <= _MOST:
            raise MapError(f"{where}: {self.count} values: give 1 to {_MOST}")
        if self.count == 1 and self.low != self.high:
            raise MapError(f"{where}: one value can't go from {self.low:g} to {self.high:g}: give 2 or more")
        if len(set(self.values)) < self.count:
            raise MapError(f"{where}: {self.count} values from {self.low:g} to {self.high:g} are not all different")
        if len({(p.node, p.name) for p in self.parameters}) < len(self.parameters):
            raise MapError(f"{where}: a parameter is named twice")

    @classmethod
    def parse(cls, text: str) -> Variation:
        """Reads `link2.d=1500..2500:11`, parameters that vary together joined by '+'
        (`link2.d+link5.d=...`, `link2.r+-link5.r=...` with opposite values); or one value, `link2.d=1500`.

        Raises:
            MapError: it is none: says what it lacks.
        """
        names, equals, said = text.partition("=")
        if not equals:
            raise MapError(f"'{text}' says no values: write such as {text.strip() or 'link2.d'}=100..200:5")
        parameters = tuple(Parameter.parse(name) for name in names.split("+"))
        found = _RANGE.fullmatch(said.strip())
        if found is None:
            value = _number(said, text)
            return cls(parameters, value, value, 1)
        if found["count"] is None:
            raise MapError(f"'{text}' does not say how many values: write such as {text.strip()}:5")
        low, high = (_number(found[end], text) for end in ("low", "high"))
        try:
            count = int(found["count"])
        except ValueError:
            raise MapError(f"'{text}': '{found['count']}' is no number of values") from None
        return cls(parameters, low, high, count)

    @property
    def heading(self) -> str:
        """Names of the parameters."""
        return "+".join(map(str, self.parameters))

    @property
    def values(self) -> tuple[float, ...]:
        """All of them, rounded to digits that a name can bear."""
        return tuple(float(f"{value:.{_DIGITS}g}") + 0.0 for value in np.linspace(self.low, self.high, self.count))

    def __str__(self) -> str:
        return f"{self.heading}={number(self.low)}..{number(self.high)}:{self.count}"


def _number(said: str, text: str) -> float:
    try:
        return float(said)
    except ValueError:
        raise MapError(f"'{text}': '{said.strip()}' is no number: write such as link2.d=100..200:5") from None
