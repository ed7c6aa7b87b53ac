"""Ties between parameters as people type them: `link2.d = link7.d = link13.d`, `link3.d = 2*link2.d + 10mm`.

A tie makes parameters affine functions of those that remain free: x = A p + b. A chain of bare names makes them equal,
and its first name stays free; in any other tie the name on the left follows the expression on the right.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array
from cinegen.design.errors import DesignError
from raff2urdf.quantities import ANGLE, Dimension, QuantityError, has_unit, parse, refused_as

_TERM = re.compile(r"\s*([+-]?(?:\s*-)?)\s*((?:[eE][+-]?\d|[^+-])*)")
_NAME = re.compile(r"[^\W\d][^\s+*/=]*\.\w+")


class Ties(NamedTuple):
    """All parameters x as affine functions of the free ones p: x = matrix p + constant.

    Attributes:
        free: indices of the free parameters in x.
        matrix: (all, free).
        constant: (all,) m and rad.
    """

    free: tuple[int, ...]
    matrix: Array
    constant: Array


def resolve(texts: Sequence[str], find: Callable[[str], int], dimensions: Sequence[Dimension]) -> Ties:
    """Return parameters as functions of those that no tie determines.

    Args:
        texts: the ties.
        find: returns the index of a parameter's name.
        dimensions: of all parameters.

    Raises:
        DesignError: a text is no tie; ties contradict each other, repeat each other or are circular.
    """
    count = len(dimensions)
    table = np.eye(count + 1)  # each parameter, and 1, as a sum of parameters that are free, and of 1
    reasons = [dict[str, None]() for _ in dimensions]  # the ties from which each parameter follows
    for text in texts:
        sides = [side.strip() for side in text.split("=")]
        if len(sides) < 2 or not all(sides):
            raise DesignError(f"'{text}' is no tie: write link2.d = link7.d, or link3.d = 2*link2.d + 10mm")
        for side in sides[:-1]:
            if not _NAME.fullmatch(side):
                raise DesignError(f"'{text}': '{side}' on the left is not a single parameter: solve the tie for one")
        first = find(sides[0])
        rows = [_row(side, text.strip(), find, dimensions, dimensions[first]) for side in sides[1:]]
        for row in rows:
            named = [first, *np.flatnonzero(row[:-1]).tolist()]
            because = {reason: None for i in named for reason in reasons[i]} | {text.strip(): None}
            left, right = table[first].copy(), row @ table
            ends = [(right, left), (left, right)] if _alone(row) is not None else [(left, right)]
            solved = [(i, value) for end, value in ends if (i := _alone(end)) is not None and value[i] == 0.0]
            if not solved and any(text.strip() in reasons[i] for i in named):
                raise DesignError(f"the tie '{text.strip()}' is given twice: remove one")
            if not solved:
                listed = " and ".join(f"'{reason}'" for reason in because)
                raise DesignError(f"contradictory or circular ties of {sides[0]}: {listed}: remove one")
            determined, value = solved[0]
            for i in np.flatnonzero(table[:-1, determined]).tolist():
                reasons[i] |= because
            value[determined] -= 1.0
            at = np.flatnonzero(table[:, determined])
            table[at] += np.outer(table[at, determined], value)
    free = np.flatnonzero(table.diagonal()[:-1])
    return Ties(tuple(free.tolist()), table[:-1, free], table[:-1, -1])


def _alone(row: Array) -> int | None:
    """Return the parameter that an affine expression is, if it is nothing else."""
    used = np.flatnonzero(row)
    return int(used[0]) if len(used) == 1 and used[0] < len(row) - 1 and row[used[0]] == 1.0 else None


def _row(
    text: str, tie: str, find: Callable[[str], int], dimensions: Sequence[Dimension], dimension: Dimension
) -> Array:
    """Parse an expression of a tie, such as `2*link2.d + 10mm`: return the coefficients of all parameters, and the
    constant (m or rad).

    Raises:
        DesignError: it is no affine expression of parameters of its dimension; a constant has no unit, or a wrong one.
    """
    row, constants, position = np.zeros(len(dimensions) + 1), list[str](), 0
    while position < len(text):
        term = _TERM.match(text, position)
        body = term[2].strip() if term else ""
        if term is None or not body or (position and not term[1]):
            raise DesignError(f"'{tie}': expected a term such as 2*link2.d or 10mm at '{text[position:]}'")
        position, sign = term.end(), "-" if term[1].count("-") % 2 else ""
        words = [word.strip() for word in body.split("*")]
        names = [word for word in words if _NAME.fullmatch(word)]
        if not names:
            constants.append(sign + body)
            continue
        if len(names) > 1:
            raise DesignError(f"'{tie}': the product {'*'.join(names)} is not affine: only one name in a term")
        factors = [word.partition("/") for word in words if word != names[0]]
        try:
            factor = math.prod(float(number) / (float(below) if slash else 1.0) for number, slash, below in factors)
        except (ValueError, ZeroDivisionError):
            factor = math.nan
        if not math.isfinite(factor):
            raise DesignError(f"'{tie}': '{body}' is not a factor times a name, such as 2*{names[0]}")
        row[find(names[0])] += -factor if sign else factor
    kinds = {dimensions[i] for i in np.flatnonzero(row).tolist()} or {dimension}
    if kinds != {dimension}:
        raise DesignError(f"'{tie}': a length and an angle can't be tied or added")
    for constant in constants:
        with refused_as(DesignError, f"'{tie}'"):
            row[-1] += (value := parse(constant, dimension))
        if value and not has_unit(constant):
            unit = "deg" if dimension is ANGLE else "mm"
            raise DesignError(f"'{tie}': '{constant}' has no unit: write it, such as {constant}{unit}")
    return row


def names_in(text: str) -> list[str]:
    """Return the names of parameters in a tie."""
    return _NAME.findall(text)


def fits(text: str, dimension: Dimension) -> bool:
    """Return whether a text may be an amount of a dimension."""
    try:
        parse(text, dimension)
    except QuantityError:
        return False
    return True
