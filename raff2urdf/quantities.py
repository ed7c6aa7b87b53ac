"""Numbers that people type and read: quantities with an optional unit, ranges and lists of them, and their text.

    parse("-900mm", LENGTH)         # -0.9
    parse("15", ANGLE)              # 0.2617993877991494: degrees, unless it has another unit
    parse_range("0..90", ANGLE)     # (0.0, 1.5707963267948966)

The dimension is declared where a number is used. Values are in SI units and radians; a number without a unit is in m,
degrees, s, ..., the same everywhere. Only RAFF files and the Python API have units of their own.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from contextvars import ContextVar
from dataclasses import dataclass
from decimal import Decimal

from raff2urdf.errors import raised_as


class QuantityError(ValueError):
    """A text that is no quantity of the dimension that is wanted; the message quotes it, with the remedy."""


def refused_as(kind: Callable[[str], Exception], what: str) -> AbstractContextManager[None]:
    """Raise a `QuantityError` as another kind of error, which states what the quantity is."""
    return raised_as(kind, QuantityError, f"{what}: ")


@dataclass(frozen=True, eq=False)
class Dimension:
    """A physical dimension and its units.

    Attributes:
        name: for messages, such as "a length".
        units: factor from each unit to SI, as a decimal number; None for degrees, which no decimal number converts.
        default: unit of a number without one; empty if the dimension has no units.
    """

    name: str
    units: Mapping[str, str | None]
    default: str = ""

    @property
    def shown(self) -> str:
        """The units for messages, the default first."""
        return ", ".join([self.default, *(unit for unit in self.units if unit.isascii() and unit != self.default)])


_LENGTHS = {"um": "1e-6", "µm": "1e-6", "mm": "1e-3", "cm": "1e-2", "m": "1", "in": "0.0254"}
_ANGLES = {"deg": None, "°": None, "rad": "1"}

LENGTH = Dimension("a length", _LENGTHS, "m")
ANGLE = Dimension("an angle", _ANGLES, "deg")
TIME = Dimension("a time", {"s": "1", "ms": "1e-3", "us": "1e-6", "min": "60"}, "s")
FREQUENCY = Dimension("a frequency", {"Hz": "1", "kHz": "1e3"}, "Hz")
FORCE = Dimension("a force", {"N": "1", "kN": "1e3"}, "N")
TORQUE = Dimension("a torque", {"Nm": "1", "Nmm": "1e-3"}, "Nm")
STIFFNESS = Dimension("a stiffness", {"N/m": "1", "kN/m": "1e3", "N/mm": "1e3", "N/um": "1e6"}, "N/m")
ANGULAR_STIFFNESS = Dimension("an angular stiffness", {"Nm/rad": "1", "kNm/rad": "1e3"}, "Nm/rad")
SPEED = Dimension("a speed", {f"{unit}/s": factor for unit, factor in _LENGTHS.items()}, "m/s")
ANGULAR_SPEED = Dimension("an angular speed", {f"{unit}/s": factor for unit, factor in _ANGLES.items()}, "deg/s")
ACCELERATION = Dimension(
    "an acceleration",
    {f"{unit}/{second}": factor for unit, factor in _LENGTHS.items() for second in ("s2", "s^2")},
    "m/s2",
)
ANGULAR_ACCELERATION = Dimension(
    "an angular acceleration",
    {f"{unit}/{second}": factor for unit, factor in _ANGLES.items() for second in ("s2", "s^2")},
    "deg/s2",
)
MASS = Dimension("a mass", {"kg": "1", "g": "1e-3", "t": "1e3"}, "kg")
DENSITY = Dimension("a density", {"kg/m3": "1", "kg/m^3": "1", "g/cm3": "1e3"}, "kg/m3")
NUMBER = Dimension("a number without a unit", {})

DIMENSIONS = (
    LENGTH,
    ANGLE,
    TIME,
    FREQUENCY,
    FORCE,
    TORQUE,
    STIFFNESS,
    ANGULAR_STIFFNESS,
    SPEED,
    ANGULAR_SPEED,
    ACCELERATION,
    ANGULAR_ACCELERATION,
    MASS,
    DENSITY,
    NUMBER,
)

_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_QUANTITY = re.compile(rf"({_NUMBER})\s*([^\s\d.+-].*)?", re.ASCII)
_DOTS = re.compile(r"\.{2,}")


# --- what people type --------------------------------------------------------------------------------------------


def parse(text: str, dimension: Dimension, unit: str | None = None) -> float:
    """Return a quantity in SI units and radians.

    Args:
        text: a number, and a unit behind it or the unit that is meant without one.
        dimension: the dimension that is wanted.
        unit: unit of a number without one; the dimension's default unless given.

    Raises:
        QuantityError: it is not a finite number, or its unit is unknown or of another dimension.
    """
    number, stated = _split(text, dimension)
    used = stated or unit or dimension.default
    factor = dimension.units.get(used, "1")
    if factor is None:
        return math.radians(float(number))
    value = float(number)
    return value if factor == "1" or value == 0.0 else float(Decimal(number) * Decimal(factor))


def has_unit(text: str) -> bool:
    """Return whether a text is a number with a unit behind it."""
    match = _QUANTITY.fullmatch(text.strip())
    return match is not None and bool(match[2])


def is_quantity(text: str) -> bool:
    """Return whether a text is a number, with or without a unit of any dimension."""
    match = _QUANTITY.fullmatch(text.strip())
    return match is not None and (not match[2] or any(match[2].strip() in dimension.units for dimension in DIMENSIONS))


def parse_list(texts: Sequence[str], dimension: Dimension) -> list[float]:
    """Return quantities of one dimension, such as the coordinates of a point, in SI units and radians.

    Raises:
        QuantityError: as `parse`; or some numbers have a unit and others, which are not 0, have none.
    """
    values = [parse(text, dimension) for text in texts]
    bare = [text for text, value in zip(texts, values, strict=True) if value and not has_unit(text)]
    units = [text for text in texts if has_unit(text)]
    if bare and units:
        raise QuantityError(f"'{','.join(texts)}' can be read two ways: '{units[0]}' has a unit, '{bare[0]}' has none")
    return values


def parse_range(text: str, dimension: Dimension) -> tuple[float, float]:
    """Return both ends of `LOW..HIGH` in SI units and radians; a unit behind the second is that of both.

    Raises:
        QuantityError: it is not a range, or only the first end has a unit.
    """
    ends, dots = _DOTS.split(text), _DOTS.findall(text)
    example = {"m": "-0.5..0.5 or -500..500mm", "deg": "-60..60"}.get(dimension.default, "0..1")
    if len(dots) != 1 or dots[0] != "..":
        why = f" has {len(dots[0])} dots" if len(dots) == 1 else " is not a range" if dots else " is one number"
        raise QuantityError(f"'{text}'{why}: write LOW..HIGH with two dots, such as {example}")
    (_, first), (_, last) = (_split(end, dimension) for end in ends)
    if first and not last and parse(ends[1], dimension):
        raise QuantityError(f"'{text}' can be read two ways: write the unit behind both ends, or behind the second")
    return parse(ends[0], dimension, last or first or None), parse(ends[1], dimension)


def _split(text: str, dimension: Dimension) -> tuple[str, str]:
    """Return the number and the unit, empty if there is none."""
    shown = text.strip() if len(text) < 60 else f"{text.strip()[:40]}..."
    match = _QUANTITY.fullmatch(text.strip())
    if match is None or not math.isfinite(float(match[1])):
        unit = f", with a unit unless it is in {dimension.default}" if dimension.default else ""
        raise QuantityError(f"'{shown}' is not {dimension.name}: write a number{unit}")
    unit = (match[2] or "").strip()
    if unit and unit not in dimension.units:
        wanted = f"{dimension.name} is wanted ({dimension.shown})" if dimension.units else f"{dimension.name} is wanted"
        other = next((known for known in DIMENSIONS if unit in known.units), None)
        if other is not None:
            raise QuantityError(f"'{shown}' is {other.name}: {wanted}")
        near = next((name for name in dimension.units if name.lower() == unit.lower().removesuffix("s")), None)
        near = near or {"degree": "deg", "degrees": "deg", "radians": "rad", '"': "in"}.get(unit.lower())
        hint = f"did you mean {near}? " if near in dimension.units else ""
        raise QuantityError(f"'{shown}': unknown unit '{unit[:20]}': {hint}{wanted}")
    return match[1], unit


# --- what people read --------------------------------------------------------------------------------------------

_shown_length: ContextVar[str] = ContextVar("shown_length", default="m")


def show_lengths_in(unit: str) -> None:
    """Show lengths in another unit than m, such as mm, in this context (`contextvars`)."""
    _shown_length.set(unit)


def shown_scale(dimension: Dimension) -> tuple[float, str]:
    """Return the factor from SI to the unit in which a dimension is shown, and that unit."""
    if dimension in (LENGTH, SPEED):
        unit = _shown_length.get()
        return 1.0 / float(_LENGTHS[unit] or 1), f"{unit}/s" if dimension is SPEED else unit
    if dimension in (ANGLE, ANGULAR_SPEED, ANGULAR_ACCELERATION):
        return math.degrees(1.0), dimension.default
    return 1.0, dimension.default


def shown_unit(unit: str) -> tuple[float, str]:
    """Return the factor from a unit of SI, such as `m^2 rad` or `m/s`, to what is shown instead, and the latter."""
    factor, texts = 1.0, list[str]()
    for part in unit.split():
        base, slash, below = part.partition("/")
        base, hat, power = base.partition("^")
        dimension = {"m": LENGTH, "rad": ANGLE}.get(base)
        scale, text = (1.0, base) if dimension is None else shown_scale(dimension)
        factor *= scale ** int(power or 1)
        texts.append(f"{text}{hat}{power}{slash}{below}")
    return factor, " ".join(texts)


def shown(value: float, dimension: Dimension, digits: int = 4) -> str:
    """Return a value in SI units and radians as text: a number of some significant digits, and its unit."""
    scale, unit = shown_scale(dimension)
    number = 0.0 if abs(value) < 1e-12 else scale * value
    text = f"{number:.{digits}g}"
    if "e" in text and 1e-5 < abs(number) < 1e7:
        text = f"{number:.0f}" if abs(number) >= 1.0 else f"{number:.{digits + 4}f}".rstrip("0")
    return f"{text} {unit}".rstrip()


def typed_in_radians(limits: Sequence[float]) -> list[float] | None:
    """Return limits of a joint in degrees, if they are radians: each is a whole multiple of five degrees then, though
    typed with two decimals at least. None if they may well be degrees."""
    if not 0.0 < max(map(abs, limits), default=0.0) <= math.tau:
        return None
    in_degrees = [math.degrees(limit) for limit in limits]
    rounded = [5.0 * round(degrees / 5.0) for degrees in in_degrees]
    near = all(abs(value - other) < 0.05 for value, other in zip(in_degrees, rounded, strict=True))
    decimals = any(limit != round(limit, 1) for limit in limits)
    return rounded if near and decimals else None
