"""Ties between parameters as people type them: `link2.d = link7.d = link13.d`, `link3.d = 2*link2.d + 10mm`.

A tie makes parameters affine functions of those that remain free: x = A p + b. A chain of bare names makes them equal,
and its first name stays free; in any other tie the name on the left follows the expression on the right.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array
from cinegen.design.errors import DesignError
from raff2urdf.quantities import ANGLE, LENGTH, Dimension, QuantityError, has_unit, parse, refused_as

_TERM = re.compile(r"\s*([+-]?(?:\s*-)?)\s*((?:[eE][+-]?\d|[^+-])*)")
_FACTOR = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_NAME = re.compile(r"[^\W\d][^\s+*/=]*\.\w+")


class Expression(NamedTuple):
    """An affine expression: a constant (m or rad), and a coefficient for each parameter, by index."""

    constant: float
    coefficients: dict[int, float]

    @property
    def bare(self) -> int | None:
        """The parameter that the expression is, if it is nothing else."""
        if self.constant == 0.0 and list(self.coefficients.values()) == [1.0]:
            return next(iter(self.coefficients))
        return None


def expression(text: str, find: Callable[[str], int], dimensions: Sequence[Dimension]) -> Expression:
    """Parse `2*link2.d + 10mm`.

    Args:
        text: what was typed.
        find: returns the index of a parameter's name.
        dimensions: of all parameters.

    Raises:
        DesignError: it is no affine expression of parameters of one dimension; a constant has no unit, or a wrong one.
    """
    coefficients, constants, position = dict[int, float](), list[str](), 0
    stripped = text.strip()
    while position < len(stripped):
        found = _TERM.match(stripped, position)
        body = found[2].strip() if found else ""
        if found is None or not body or (position and not found[1]):
            raise DesignError(f"'{stripped}': expected a term such as 2*link2.d or 10mm at '{stripped[position:]}'")
        position, sign = found.end(), "-" if found[1].count("-") % 2 else ""
        words = [word.strip() for word in body.split("*")]
        names = [word for word in words if _NAME.fullmatch(word)]
        if not names:
            constants.append(sign + body)
            continue
        factor, divisor = -1.0 if sign == "-" else 1.0, "1"
        for word in words:
            if word in names:
                continue
            number, slash, below = (part.strip() for part in word.partition("/"))
            divisor = below if slash else "1"
            if not _FACTOR.fullmatch(number) or not _FACTOR.fullmatch(divisor) or float(divisor) == 0.0:
                raise DesignError(f"'{stripped}': '{word}' is not a factor: write a number, such as 2*{names[0]}")
            factor *= float(number) / float(divisor)
        if len(names) > 1:
            raise DesignError(f"'{stripped}': the product {'*'.join(names)} is not affine: only one name in a term")
        index = find(names[0])
        coefficients[index] = coefficients.get(index, 0.0) + factor
    kinds = {dimensions[index] for index in coefficients}
    if len(kinds) > 1:
        raise DesignError(f"'{stripped}' adds a length and an angle: tie parameters of one dimension only")
    constant = sum(_constant(one, next(iter(kinds), None), stripped) for one in constants)
    return Expression(constant, coefficients)


def _constant(text: str, dimension: Dimension | None, whole: str) -> float:
    """Return a constant in m or rad; of an expression without names, of the dimension that its unit has."""
    with refused_as(DesignError, f"'{whole}'"):
        if dimension is None:
            dimension = next((one for one in (LENGTH, ANGLE) if fits(text, one) and has_unit(text)), LENGTH)
        value = parse(text, dimension)
    if value != 0.0 and not has_unit(text):
        raise DesignError(f"'{whole}': '{text}' has no unit: write it, such as {text}{_example(dimension)}")
    return value


def fits(text: str, dimension: Dimension) -> bool:
    """Return whether a text may be an amount of a dimension."""
    try:
        parse(text, dimension)
    except QuantityError:
        return False
    return True


def _example(dimension: Dimension) -> str:
    return "deg" if dimension is ANGLE else "mm"


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


def resolve(
    texts: Sequence[str], find: Callable[[str], int], names: Sequence[str], dimensions: Sequence[Dimension]
) -> Ties:
    """Return parameters as functions of those that no tie determines.

    Args:
        texts: the ties.
        find: returns the index of a parameter's name.
        names: of all parameters.
        dimensions: of all parameters.

    Raises:
        DesignError: a text is no tie; ties contradict each other, repeat each other or are circular.
    """
    same = list(range(len(names)))  # of each parameter, one to which it is equal
    rules: dict[int, tuple[Expression, str]] = {}
    equal: list[tuple[int, str]] = []  # a parameter of each tie of bare names, and its text

    def root(index: int) -> int:
        while same[index] != index:
            index = same[index]
        return index

    for text in texts:
        sides = text.split("=")
        if len(sides) < 2 or not all(side.strip() for side in sides):
            raise DesignError(f"'{text}' is no tie: write link2.d = link7.d, or link3.d = 2*link2.d + 10mm")
        parsed = [expression(side, find, dimensions) for side in sides]
        bares = [one.bare for one in parsed]
        left = [bare for bare in bares if bare is not None]
        if any(bare is None for bare in bares[:-1]):
            wrong = sides[bares.index(None)].strip()
            raise DesignError(f"'{text}': '{wrong}' on the left is not a single parameter: solve the tie for one")
        kinds = {dimensions[index] for one in parsed for index in one.coefficients}
        if len(kinds) > 1:
            raise DesignError(f"'{text}' equates a length and an angle: tie parameters of one dimension only")
        for other in left[1:]:
            if root(other) == root(left[0]):
                raise DesignError(
                    f"'{text}': {names[left[0]]} and {names[other]} are tied already: circular ties; remove one"
                )
            first, second = root(left[0]), root(other)
            if first in rules and second in rules:
                raise DesignError(_twice(names[other], rules[second][1], text))
            if second in rules:
                rules[first] = rules.pop(second)
            same[second] = first
            equal.append((first, text))
        if bares[-1] is None:
            target = root(left[0])
            if target in rules:
                raise DesignError(_twice(names[left[0]], rules[target][1], text))
            if not parsed[-1].coefficients and parsed[-1].constant and not fits(sides[-1].strip(), dimensions[target]):
                raise DesignError(f"'{text}': {sides[-1].strip()} is not {dimensions[target].name}")
            rules[target] = parsed[-1], text
    values: dict[int, Expression] = {}

    def value(index: int, above: tuple[int, ...]) -> Expression:
        index = root(index)
        if index in above:
            circle = above[above.index(index) :]
            texts = [text for one, text in equal if root(one) in circle] + [rules[one][1] for one in circle]
            listed = " and ".join(f"'{text.strip()}'" for text in dict.fromkeys(texts))
            path = " -> ".join(names[one] for one in (*circle, index))
            raise DesignError(f"contradictory or circular ties ({path}): {listed}: remove one")
        if index not in values:
            values[index] = Expression(0.0, {index: 1.0})
            if index in rules:
                own, found = rules[index][0], dict[int, float]()
                constant = own.constant
                for other, factor in own.coefficients.items():
                    there = value(other, (*above, index))
                    constant += factor * there.constant
                    for key, coefficient in there.coefficients.items():
                        found[key] = found.get(key, 0.0) + factor * coefficient
                values[index] = Expression(constant, found)
        return values[index]

    known = [value(index, ()) for index in range(len(names))]
    free = tuple(index for index in range(len(names)) if root(index) == index and index not in rules)
    place = {index: k for k, index in enumerate(free)}
    matrix, constant = np.zeros((len(names), len(free))), np.array([one.constant for one in known])
    for row, one in zip(matrix, known, strict=True):
        for index, coefficient in one.coefficients.items():
            row[place[index]] = coefficient
    return Ties(free, matrix, constant)


def _twice(name: str, first: str, second: str) -> str:
    return f"contradictory ties: '{first.strip()}' and '{second.strip()}' both determine {name}: remove one"
