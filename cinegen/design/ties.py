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
        term = _TERM.match(stripped, position)
        body = term[2].strip() if term else ""
        if term is None or not body or (position and not term[1]):
            raise DesignError(f"'{stripped}': expected a term such as 2*link2.d or 10mm at '{stripped[position:]}'")
        position, sign = term.end(), "-" if term[1].count("-") % 2 else ""
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
    constant = sum(_constant(text, next(iter(kinds), None), stripped) for text in constants)
    return Expression(constant, coefficients)


def _constant(text: str, dimension: Dimension | None, whole: str) -> float:
    """Return a constant in m or rad; of an expression without names, of the dimension that its unit has."""
    with refused_as(DesignError, f"'{whole}'"):
        if dimension is None:
            dimension = next((known for known in (LENGTH, ANGLE) if fits(text, known) and has_unit(text)), LENGTH)
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
    rules = _Rules(find, names, dimensions)
    for text in texts:
        rules.add(text)
    values = [rules.value(index) for index in range(len(names))]
    free = tuple(index for index in range(len(names)) if rules.is_free(index))
    column = {index: k for k, index in enumerate(free)}
    matrix, constant = np.zeros((len(names), len(free))), np.array([value.constant for value in values])
    for row, value in zip(matrix, values, strict=True):
        for index, coefficient in value.coefficients.items():
            row[column[index]] = coefficient
    return Ties(free, matrix, constant)


class _Rules:
    """Ties: parameters that are equal, and rules by which others determine one of them.

    Args: see `resolve`.
    """

    def __init__(self, find: Callable[[str], int], names: Sequence[str], dimensions: Sequence[Dimension]) -> None:
        self._find, self._names, self._dimensions = find, names, dimensions
        self._same = list(range(len(names)))  # of each parameter, one to which it is equal
        self._rules: dict[int, tuple[Expression, str]] = {}
        self._equal: list[tuple[int, str]] = []  # a parameter of each tie of bare names, and its text
        self._values: dict[int, Expression] = {}

    def _root(self, index: int) -> int:
        while self._same[index] != index:
            index = self._same[index]
        return index

    def is_free(self, index: int) -> bool:
        """Return whether no tie determines a parameter."""
        return self._root(index) == index and index not in self._rules

    def add(self, text: str) -> None:
        """Add a tie.

        Raises:
            DesignError: it is none, or contradicts another one.
        """
        sides = text.split("=")
        if len(sides) < 2 or not all(side.strip() for side in sides):
            raise DesignError(f"'{text}' is no tie: write link2.d = link7.d, or link3.d = 2*link2.d + 10mm")
        parsed = [expression(side, self._find, self._dimensions) for side in sides]
        bares = [side.bare for side in parsed]
        first, *others = (bare for bare in bares if bare is not None) if None not in bares[:-1] else (None,)
        if first is None:
            wrong = sides[bares.index(None)].strip()
            raise DesignError(f"'{text}': '{wrong}' on the left is not a single parameter: solve the tie for one")
        if len({self._dimensions[index] for side in parsed for index in side.coefficients}) > 1:
            raise DesignError(f"'{text}' equates a length and an angle: tie parameters of one dimension only")
        for other in others:
            self._equate(first, other, text)
        if bares[-1] is None:
            self._determine(first, parsed[-1], sides[-1].strip(), text)

    def _equate(self, parameter: int, other: int, text: str) -> None:
        """Note that two parameters are equal."""
        first, second = self._root(parameter), self._root(other)
        if first == second:
            names = f"{self._names[parameter]} and {self._names[other]}"
            raise DesignError(f"'{text}': {names} are tied already: circular ties; remove one")
        if first in self._rules and second in self._rules:
            raise DesignError(_twice(self._names[other], self._rules[second][1], text))
        if second in self._rules:
            self._rules[first] = self._rules.pop(second)
        self._same[second] = first
        self._equal.append((first, text))

    def _determine(self, parameter: int, value: Expression, written: str, text: str) -> None:
        """Note that a parameter has a value, whose text is `written`."""
        target = self._root(parameter)
        if target in self._rules:
            raise DesignError(_twice(self._names[parameter], self._rules[target][1], text))
        if not value.coefficients and value.constant and not fits(written, self._dimensions[target]):
            raise DesignError(f"'{text}': {written} is not {self._dimensions[target].name}")
        self._rules[target] = value, text

    def value(self, index: int, above: tuple[int, ...] = ()) -> Expression:
        """Return a parameter as an expression of free ones; `above` are those whose values need it.

        Raises:
            DesignError: its value needs itself.
        """
        index = self._root(index)
        if index in above:
            circle = above[above.index(index) :]
            texts = [text for parameter, text in self._equal if self._root(parameter) in circle]
            texts += [self._rules[parameter][1] for parameter in circle]
            listed = " and ".join(f"'{text.strip()}'" for text in dict.fromkeys(texts))
            path = " -> ".join(self._names[parameter] for parameter in (*circle, index))
            raise DesignError(f"contradictory or circular ties ({path}): {listed}: remove one")
        if index not in self._values:
            rule = self._rules[index][0] if index in self._rules else None
            if rule is None:
                self._values[index] = Expression(0.0, {index: 1.0})
            else:
                constant, coefficients = rule.constant, dict[int, float]()
                for other, factor in rule.coefficients.items():
                    value = self.value(other, (*above, index))
                    constant += factor * value.constant
                    for key, coefficient in value.coefficients.items():
                        coefficients[key] = coefficients.get(key, 0.0) + factor * coefficient
                self._values[index] = Expression(constant, coefficients)
        return self._values[index]


def _twice(name: str, first: str, second: str) -> str:
    return f"contradictory ties: '{first.strip()}' and '{second.strip()}' both determine {name}: remove one"
