"""Expressions of kernels: names, attributes, parts of arrays, operations and calls as values of a translation."""

from __future__ import annotations

import ast
import builtins
import inspect
import math
from collections.abc import Sequence
from typing import Any, get_type_hints

import numpy as np

from cinegen.codegen.arithmetic import Arithmetic
from cinegen.codegen.context import TranslationContext
from cinegen.codegen.function_code import FunctionCode
from cinegen.codegen.heap import BEGIN, HeapArray
from cinegen.codegen.language import call
from cinegen.codegen.precision import threshold
from cinegen.codegen.values import (
    Ended,
    Known,
    Memories,
    Number,
    Rank,
    Target,
    Value,
    View,
    count_of,
    integer,
    kind_of,
    product_of,
    sum_of,
)
from cinegen.jit.foreign import frame_at
from cinegen.jit.memory import memory_at


class ExpressionTranslation:
    """Expressions of one function.

    Args:
        context: what the functions of the translation share.
        source: kernel, a function of Python.
        code: of the function; statements that an expression needs before it are appended.
    """

    def __init__(self, context: TranslationContext, source: Any, code: FunctionCode) -> None:
        self._context, self._source, self._code = context, source, code
        self._language, self._heap = context.language, context.heap
        self._arithmetic = Arithmetic(context.language)
        self._names: dict[str, Value] = {}

    def _number(self, node: ast.expr) -> Number:
        value = self._value(node)
        if isinstance(value, bool | int | float):
            return self._arithmetic.constant(value)
        if not isinstance(value, Number):
            raise self._code.error(f"{ast.unparse(node)!r} is not a number")
        return value

    def _unconditional(self, node: ast.expr) -> Number:
        """Return a number that may not be computed, or more than once: without statements before it."""
        count, number = len(self._code.lines), self._number(node)
        if len(self._code.lines) != count:
            raise self._code.error(f"{ast.unparse(node)!r} needs statements of its own: assign its parts before")
        return number

    def _value(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant(value=bool() | int() | float() as value):
                return self._threshold(value)
            case ast.Name(id=name):
                return self._named(name)
            case ast.Tuple(elts=elements):
                return tuple(self._value(element) for element in elements)
            case ast.Attribute(value=owner, attr=attribute):
                return self._attribute(self._value(owner), attribute)
            case ast.Subscript(value=owner, slice=index):
                return self._part(self._value(owner), index)
            case ast.BinOp(left=left, op=op, right=right):
                return self._arithmetic.binary(op, self._number(left), self._number(right))
            case ast.UnaryOp(op=ast.USub() | ast.Not() as op, operand=operand):
                return self._arithmetic.unary(op, self._number(operand))
            case ast.BoolOp(op=op, values=values):
                return self._junction(isinstance(op, ast.And), values)
            case ast.Compare(left=left, ops=ops, comparators=others):
                return self._comparison(left, ops, others)
            case ast.IfExp():
                return self._choice(node)
            case ast.Call(func=called, args=arguments):
                return self._call(self._value(called), arguments)
        raise self._code.error(f"no counterpart of {ast.unparse(node)!r}")

    def _named(self, name: str) -> Value:
        value = self._names.get(name)
        if isinstance(value, Ended):
            raise self._code.error(f"'{name}' is read after its loop")
        if value is not None:
            return value
        return self._object(self._source.__globals__.get(name, getattr(builtins, name, None)), name)

    def _choice(self, node: ast.IfExp) -> Value:
        chosen = self._number(node.test)
        if chosen.value is not None:
            return self._value(node.body if chosen.value else node.orelse)
        return self._arithmetic.choice(chosen, self._unconditional(node.body), self._unconditional(node.orelse))

    def _object(self, value: Any, name: str) -> Value:
        if value is None:
            raise self._code.error(f"'{name}' is unknown")
        return self._threshold(value, name) if isinstance(value, bool | int | float) else value

    def _threshold(self, value: float, name: str = "") -> Number:
        """Return a constant of the kernels."""
        if self._language.is_single and isinstance(value, float):
            value = threshold(value, name, self._source.__name__)
        return self._arithmetic.constant(value)

    def _attribute(self, owner: Value, name: str) -> Value:
        if isinstance(owner, View):
            assert name == "shape"
            return owner.shape
        if not isinstance(owner, Memories):
            return self._object(getattr(owner, name, None), name)
        if name == "target" and "own_target" in owner.all[0].fields:
            return Target(owner)
        return self._field(owner, name)

    # --- memories and arrays -------------------------------------------------------------------------------------

    def _field(self, owner: Memories, name: str) -> Value:
        """Return a field of a memory."""
        first = owner.all[0]
        declared = first.fields[name]
        if declared.shape is None:
            place = self._heap.number(owner.all, name)
            if not isinstance(place, HeapArray):
                return self._arithmetic.constant(place)
            return Number(kind_of(place.table), self._state(owner, name))
        places = [self._heap.array(each, name) for each in owner.all]
        self._context.arrays.add(name)
        if len(places) == 1:
            (only,), numbers = places, self._heap.known(first, name)
            known = None if numbers is None else Known(numbers)
            return View(only.table, integer(only.begin), tuple(map(integer, only.shape)), name, known)
        begin = self._heap.allocate((tuple(map(id, owner.all)), name, BEGIN), np.array([each.begin for each in places]))
        shape = []
        for i, _ in enumerate(places[0].shape):
            sizes = [each.shape[i] for each in places]
            if len(set(sizes)) == 1:
                shape.append(integer(sizes[0]))
                continue
            table = self._heap.allocate((tuple(map(id, owner.all)), name, i), np.array(sizes))
            shape.append(Number("int", _element(table, owner.index)))
        index = Number("int", _element(begin, owner.index))
        return View(places[0].table, index, tuple(shape), name)

    def _state(self, owner: Memories, name: str) -> str:
        """Return the code of a state of a memory."""
        place = self._heap.number(owner.all, name)
        if not isinstance(place, HeapArray):
            raise self._code.error(f"'{name}' is a constant")
        return _element(place, owner.index)

    def _part(self, owner: Value, index: ast.expr, is_read: bool = True) -> Value:
        """Return a number or a view of an array."""
        if isinstance(owner, tuple):
            return owner[int(self._number(index).value or 0)]
        assert isinstance(owner, View)
        begin, shape, least = owner.begin, list[Number](), None
        indices = list(index.elts) if isinstance(index, ast.Tuple) else [index]
        known, is_joint = owner.known, owner.field.startswith("joint_")
        for i, size in enumerate(owner.shape):
            width = count_of(owner.shape[i + 1 :])
            if i >= len(indices):
                shape.append(size)
            elif isinstance(part := indices[i], ast.Slice):
                if part.step is not None:
                    raise self._code.error(f"a step in {ast.unparse(index)!r}")
                low = integer(0) if part.lower is None else self._number(part.lower)
                high = size if part.upper is None else self._number(part.upper)
                begin = sum_of(begin, product_of(low, width))
                shape.append(sum_of(high, low, -1))
                known = None
            else:
                at = self._number(part)
                if at.value is not None and at.value < 0:
                    raise self._code.error(f"index {ast.unparse(part)} counts from the end")
                if known is not None and known.numbers.ndim == 1 and (entry := known.number(at, is_joint)) is not None:
                    return entry if entry.value is None else self._arithmetic.constant(entry.value)
                least = known.least(is_joint) if known is not None else None
                known = known.at(at, is_joint) if known is not None else None
                is_joint = False
                begin = sum_of(begin, product_of(at, width))
        if shape:
            return View(owner.table, begin, tuple(shape), owner.field, known)
        if is_read:
            self._context.read.add(owner.field)
        return Number(owner.kind, f"{owner.table}[{begin.code}]", least=least)

    # --- operations ----------------------------------------------------------------------------------------------

    def _junction(self, is_and: bool, values: Sequence[ast.expr]) -> Number:
        terms = list[Number]()
        for node in values:
            term = self._unconditional(node) if terms else self._number(node)
            if term.value is None:
                terms.append(term)
            elif bool(term.value) is not is_and:  # decides
                if not terms:
                    return self._arithmetic.constant(not is_and)
                terms.append(self._arithmetic.constant(bool(term.value)))
                break
        if not terms:
            return self._arithmetic.constant(is_and)
        rank, sign = (Rank.AND, " && ") if is_and else (Rank.OR, " || ")
        if len(terms) == 1:
            return terms[0]
        inner = rank + 1 if is_and else Rank.AND + 1  # `a && b || c` is written with parentheses
        return Number("bool", sign.join(term.at(inner) for term in terms), rank)

    def _comparison(self, left: ast.expr, ops: Sequence[ast.cmpop], others: Sequence[ast.expr]) -> Number:
        numbers = [self._number(left), *map(self._number, others)]
        if len(ops) > 1:
            numbers[1:-1] = [
                self._code.in_variable(number) if "(" in number.code else number for number in numbers[1:-1]
            ]
        return self._arithmetic.comparison(ops, numbers)

    # --- calls ---------------------------------------------------------------------------------------------------

    def _call(self, called: Any, arguments: Sequence[ast.expr]) -> Value:
        if called in (float, int, bool):
            return self._arithmetic.converted(called, self._number(arguments[0]))
        if called in (min, max):
            return self._arithmetic.extreme(called, [self._number(argument) for argument in arguments])
        if called is len:
            return self._value(arguments[0]).shape[0]
        if called is abs:
            return self._arithmetic.absolute(self._number(arguments[0]))
        if called is np.floor:
            return self._arithmetic.mathematics("floor", [self._number(arguments[0])])
        name = getattr(called, "__name__", "")
        if getattr(math, name, None) is called:
            return self._arithmetic.mathematics(name, [self._number(argument) for argument in arguments])
        if called is frame_at or getattr(called, "py_func", None) is getattr(frame_at, "py_func", 0):
            target = self._value(arguments[0])
            assert isinstance(target, Target)
            return self._attribute(target.of, "own_target")
        if hasattr(called, "in_python"):
            return self._memory_of(arguments[0])
        return self._kernel(called, [self._value(argument) for argument in arguments])

    def _memory_of(self, handle: ast.expr) -> Memories:
        """Return the memory that an element of a table of handles stands for."""
        assert isinstance(handle, ast.Subscript)
        assert isinstance(handle.value, ast.Attribute)
        owner, index = self._value(handle.value.value), self._number(handle.slice)
        assert isinstance(owner, Memories)
        handles = getattr(owner.all[0], handle.value.attr)
        return Memories(tuple(memory_at(each) for each in handles), index if len(handles) > 1 else integer(0))

    def _kernel(self, kernel: Any, arguments: list[Value]) -> Value:
        source = getattr(kernel, "py_func", None)
        if source is None:
            raise self._code.error(f"it calls {kernel!r}")
        constant = self._arithmetic.constant
        arguments = [
            constant(argument) if isinstance(argument, bool | int | float) else argument for argument in arguments
        ]
        translated = self._context.function(kernel, arguments)
        numbers = list[str]()
        hints = {name: "float" for name, kind in get_type_hints(source).items() if kind is float}
        for name, argument in zip(inspect.signature(source).parameters, arguments, strict=True):
            match argument:
                case Number():
                    numbers.append(
                        self._arithmetic.as_kind(hints[name], argument).code if name in hints else argument.code
                    )
                case View():
                    self._context.read.add(argument.field)
                    numbers += [argument.begin.code, *(size.code for size in argument.shape)]
                case Memories() if len(argument.all) > 1:
                    numbers.append(argument.index.code)
        used = [code for code, is_used in zip(numbers, translated.used, strict=True) if is_used]
        for unread in set(numbers) - set(used):
            if self._code.has_effects(unread):
                self._code.emit(f"{unread};")
        code = call(translated.name, used, self._language)
        if len(translated.result) < 2:
            return Number(translated.result[0] if translated.result else "none", code)
        self._code.emit(f"{code};")
        results = list[Number]()
        for i, kind in enumerate(translated.result):
            number = Number("float", f"D[{self._context.returned + i}]")
            if kind == "bool":
                number = Number("bool", f"{number.code} != 0", Rank.EQUALITY)
            elif kind == "int":
                number = self._arithmetic.converted(int, number)
            results.append(self._code.in_variable(number))
        return tuple(results)


def _element(place: HeapArray, index: Number) -> str:
    """Return the code of an element of an array of one dimension."""
    return f"{place.table}[{sum_of(integer(place.begin), index).code}]"
