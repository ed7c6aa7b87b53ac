"""Amounts by name or pattern: standard deviations, plays and expected errors, in m and rad, or as texts with a unit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters
from cinegen.design.ties import fits
from raff2urdf.quantities import ANGLE, Dimension, has_unit, parse, refused_as

Amounts = Mapping[str, float | str] | Iterable[tuple[str, float | str]]
"""Amounts by name or pattern, or pairs of both: a number in m or rad, or a text such as "0.05mm". Later ones replace
earlier ones."""


def pairs(amounts: Amounts | None) -> list[tuple[str, float | str]]:
    """Return names or patterns, and their amounts, in the order in which they were given."""
    if amounts is None:
        return []
    return [(name, amount) for name, amount in (amounts.items() if isinstance(amounts, Mapping) else amounts)]


def known_pairs(parameters: Parameters, amounts: Amounts | None) -> list[tuple[str, float | str]]:
    """Return names or patterns of parameters, and their amounts, as `pairs`.

    Raises:
        DesignError: unknown names; names all of them.
    """
    chosen = pairs(amounts)
    parameters.matching(pattern for pattern, _ in chosen)
    return chosen


def amount_in(name: str, amount: float | str, dimension: Dimension) -> float:
    """Return an amount in m or rad.

    Raises:
        DesignError: a wrong unit or none, or a negative amount.
    """
    if isinstance(amount, str):
        with refused_as(DesignError, name):
            value = parse(amount, dimension)
        if value and not has_unit(amount):
            raise DesignError(f"{name}: '{amount}' has no unit: write {amount}{'deg' if dimension is ANGLE else 'mm'}")
    else:
        value = float(amount)
    if not 0.0 <= value < math.inf:
        raise DesignError(f"{name}: a tolerance is not negative, as {amount} is")
    return value


def sizes_by_index(parameters: Parameters, amounts: Amounts | None) -> dict[int, float]:
    """Return amounts in m or rad, by index in `Parameters.all`.

    Raises:
        DesignError: unknown names (all of them), a wrong unit, or a negative amount.
    """
    return {
        i: amount_in(pattern, amount, parameters.all[i].dimension)
        for pattern, amount in known_pairs(parameters, amounts)
        for i in _matching(parameters, pattern, amount)
    }


def _matching(parameters: Parameters, pattern: str, amount: float | str) -> list[int]:
    """Return the indices in `Parameters.all` of what a pattern matches; with a unit, only those of its dimension. The
    base's are matched by patterns that begin with `base` only: a robot's base pose is no property of the robot.

    Raises:
        DesignError: none; or lengths and angles, and the amount has no unit.
    """
    indices = parameters.matching([pattern])
    indices = [i for i in indices if parameters.all[i].node or pattern.strip().startswith("base")] or indices
    if isinstance(amount, str) and has_unit(amount):
        fitting = [i for i in indices if fits(amount, parameters.all[i].dimension)]
        if not fitting:
            amount_in(pattern, amount, parameters.all[indices[0]].dimension)
        return fitting
    if len({parameters.all[i].dimension for i in indices}) > 1:
        raise DesignError(f"'{pattern}={amount}' matches lengths and angles: write a unit, such as {pattern}=0.05mm")
    return indices
