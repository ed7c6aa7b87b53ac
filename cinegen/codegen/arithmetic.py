"""Arithmetic of a translation: operations on numbers as code of a language, or their results if these are constants."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

from cinegen.codegen.language import Language, function, literal, quotient
from cinegen.codegen.values import KINDS, Number, Rank, constant_of, integer, product_of, sum_of

_OPERATORS: dict[type, tuple[str, int, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", Rank.SUM, operator.add),
    ast.Sub: ("-", Rank.SUM, operator.sub),
    ast.Mult: ("*", Rank.PRODUCT, operator.mul),
    ast.Div: ("/", Rank.PRODUCT, operator.truediv),
    ast.Mod: ("%", Rank.PRODUCT, operator.mod),
    ast.LShift: ("<<", Rank.SHIFT, operator.lshift),
    ast.BitOr: ("|", Rank.BITS, operator.or_),
}
_COMPARISONS: dict[type, tuple[str, int, Callable[[Any, Any], Any]]] = {
    ast.Lt: ("<", Rank.COMPARISON, operator.lt),
    ast.LtE: ("<=", Rank.COMPARISON, operator.le),
    ast.Gt: (">", Rank.COMPARISON, operator.gt),
    ast.GtE: (">=", Rank.COMPARISON, operator.ge),
    ast.Eq: ("==", Rank.EQUALITY, operator.eq),
    ast.NotEq: ("!=", Rank.EQUALITY, operator.ne),
}


class Arithmetic:
    """Operations of one language.

    Args:
        language: language.
    """

    def __init__(self, language: Language) -> None:
        self._language = language

    def constant(self, value: float) -> Number:
        """Return a constant as it is written."""
        kind = "bool" if isinstance(value, bool) else "int" if isinstance(value, int) else "float"
        negative = not isinstance(value, bool) and (value < 0 or (value == 0 and math.copysign(1.0, value) < 0))
        return Number(kind, literal(value, self._language), Rank.UNARY if negative else Rank.ATOM, value)

    def real(self, number: Number) -> Number:
        """Return a number as one that is no integer, where C needs that."""
        if number.kind != "int" or not self._language.is_c:
            return number
        if number.value is not None:
            return self.constant(float(number.value))
        return Number("float", f"({self._language.real}) {number.at(Rank.UNARY)}", Rank.UNARY)

    def as_kind(self, kind: str, number: Number) -> Number:
        """Return a number of a kind: C converts integers to doubles by itself, but only some of them to floats."""
        return self.real(number) if kind == "float" and self._language.is_single else number

    def converted(self, to: type, number: Number) -> Number:
        """Return a number as `float`, `int` or `bool` converts it."""
        kind = KINDS[to]
        if number.value is not None:
            return self.constant(to(number.value))
        if number.kind == kind or (kind == "float" and number.kind == "int"):
            return Number(kind, number.code, number.rank)
        if kind == "int":
            code = f"(int) {number.at(Rank.UNARY)}" if self._language.is_c else f"Math.trunc({number.code})"
            return Number("int", code, Rank.UNARY if self._language.is_c else Rank.ATOM)
        return Number("bool", f"{number.at(Rank.EQUALITY + 1)} != 0", Rank.EQUALITY)

    def unary(self, op: ast.Not | ast.USub, number: Number) -> Number:
        """Return the negation of a truth value, or a number with the other sign."""
        if number.value is not None:
            return self.constant(not number.value if isinstance(op, ast.Not) else -number.value)
        return Number("bool", f"!{number.at(Rank.UNARY)}", Rank.UNARY) if isinstance(op, ast.Not) else _minus(number)

    def binary(self, op: ast.operator, a: Number, b: Number) -> Number:
        """Return a sum, product or other operation of two numbers."""
        if isinstance(op, ast.Pow):
            return self.mathematics("pow", [a, b])
        if isinstance(op, ast.FloorDiv):
            if a.value is not None and b.value is not None:
                return integer(int(a.value // b.value))
            return Number("int", quotient(a.at(Rank.ATOM), b.at(Rank.ATOM), self._language))
        sign, rank, compute = _OPERATORS[type(op)]
        if a.kind == b.kind == "int":
            if isinstance(op, ast.Add | ast.Sub):
                return sum_of(a, b, 1 if isinstance(op, ast.Add) else -1)
            if isinstance(op, ast.Mult):
                return product_of(a, b)
        if a.value is not None and b.value is not None:
            return self.constant(compute(a.value, b.value))
        kind = "int" if a.kind == b.kind == "int" and not isinstance(op, ast.Div) else "float"
        if kind == "float" and (simplified := _simplified(op, a, b)) is not None:
            return simplified if simplified.value is None else self.constant(simplified.value)
        left = self.real(a).at(rank) if kind == "float" and self._language.is_c else a.at(rank)
        right = self.real(b) if kind == "float" and self._language.is_single else b
        return Number(kind, f"{left} {sign} {right.at(rank + 1)}", rank)

    def comparison(self, ops: Sequence[ast.cmpop], numbers: Sequence[Number]) -> Number:
        """Return whether each number compares with the next one as its operator asks."""
        terms = list[Number]()
        for op, a, b in zip(ops, numbers, numbers[1:], strict=False):
            sign, rank, compute = _COMPARISONS[type(op)]
            if a.value is not None and b.value is not None:
                if not compute(a.value, b.value):
                    return self.constant(False)
                continue
            if a.least is not None and b.value is not None and a.least >= b.value:
                if isinstance(op, ast.Lt):
                    return self.constant(False)
                if isinstance(op, ast.GtE):
                    continue
            terms.append(Number("bool", f"{a.at(rank + 1)} {sign} {b.at(rank + 1)}", rank))
        if not terms:
            return self.constant(True)
        if len(terms) == 1:
            return terms[0]
        return Number("bool", " && ".join(term.at(Rank.AND + 1) for term in terms), Rank.AND)

    def choice(self, test: Number, a: Number, b: Number) -> Number:
        """Return the first number if a test is true, else the second."""
        kind = a.kind if a.kind == b.kind else "float"
        a, b = self.as_kind(kind, a), self.as_kind(kind, b)
        return Number(kind, f"{test.at(Rank.CHOICE + 1)} ? {a.at(Rank.CHOICE + 1)} : {b.at(Rank.CHOICE)}", Rank.CHOICE)

    def mathematics(self, name: str, numbers: Sequence[Number]) -> Number:
        """Return the result of a function of `math`."""
        code = (
            f"{function(name, self._language)}({', '.join(self.as_kind('float', number).code for number in numbers)})"
        )
        if name == "isfinite":
            return Number("bool", code if self._language.is_c else f"Number.isFinite({numbers[0].code})")
        return Number("float", code)

    def absolute(self, number: Number) -> Number:
        """Return the absolute value of a number."""
        return (
            self.mathematics("abs", [number]) if number.kind == "float" else self.extreme(max, [number, _minus(number)])
        )

    def extreme(self, which: Any, numbers: Sequence[Number]) -> Number:
        """Return the smallest or largest of numbers as Python does: a NaN behind the first is left out."""
        name, result = "least" if which is min else "most", numbers[0]
        for number in numbers[1:]:
            if result.value is not None and number.value is not None:
                result = self.constant(which(result.value, number.value))
                continue
            kind = "int" if result.kind == number.kind == "int" else "float"
            suffix = "_int" if kind == "int" and self._language.is_c else ""
            result = Number(
                kind, f"{name}{suffix}({self.as_kind(kind, result).code}, {self.as_kind(kind, number).code})"
            )
        return result


def _simplified(op: ast.operator, a: Number, b: Number) -> Number | None:
    """Return a product with 0 or 1, or a sum with 0, without the operation; None of others."""
    if isinstance(op, ast.Mult):
        for factor, other in ((a, b), (b, a)):
            if factor.value == 0.0:
                return constant_of(0.0)
            if factor.value == 1.0 and other.kind == "float":
                return other
    if isinstance(op, ast.Add) and a.value == 0.0 and b.kind == "float":
        return b
    if isinstance(op, ast.Add | ast.Sub) and b.value == 0.0 and a.kind == "float":
        return a
    if isinstance(op, ast.Div) and b.value == 1.0 and a.kind == "float":
        return a
    return None


def _minus(number: Number) -> Number:
    return Number(number.kind, f"-{number.at(Rank.UNARY + 1)}", Rank.UNARY)
