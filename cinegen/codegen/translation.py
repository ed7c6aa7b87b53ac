"""Translation of compiled kernels to C and JavaScript.

Kernels are written in a small part of Python: numbers, arrays of a memory and views of them, loops, calls of each
other; nothing is allocated. So each statement has a counterpart in both languages. An array is an index into a table of
numbers, with its dimensions; a memory is known when the code is generated, so sizes and tables of a mechanism become
constants, and branches that it does not need are left out. A function is translated once for each kind of its
arguments.

The kernels themselves are what is translated: there is no second form of their mathematics.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import operator
import re
import textwrap
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Any, get_type_hints

import numpy as np

from cinegen.codegen.heap import BEGIN, Heap, HeapArray, key_of
from cinegen.codegen.language import Language, call, declarations, function, identifier, literal, quotient, signature
from cinegen.codegen.precision import threshold
from cinegen.errors import CinegenError
from cinegen.jit.foreign import frame_at
from cinegen.jit.memory import Memory, memory_at

ATOM, UNARY, PRODUCT, SUM, SHIFT, COMPARISON, EQUALITY, BITS, AND, OR, CHOICE = range(11, 0, -1)
"""Precedence of operators in both languages, the highest first."""

_OPERATORS: dict[type, tuple[str, int, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", SUM, operator.add),
    ast.Sub: ("-", SUM, operator.sub),
    ast.Mult: ("*", PRODUCT, operator.mul),
    ast.Div: ("/", PRODUCT, operator.truediv),
    ast.Mod: ("%", PRODUCT, operator.mod),
    ast.LShift: ("<<", SHIFT, operator.lshift),
    ast.BitOr: ("|", BITS, operator.or_),
}
_COMPARISONS: dict[type, tuple[str, int, Callable[[Any, Any], Any]]] = {
    ast.Lt: ("<", COMPARISON, operator.lt),
    ast.LtE: ("<=", COMPARISON, operator.le),
    ast.Gt: (">", COMPARISON, operator.gt),
    ast.GtE: (">=", COMPARISON, operator.ge),
    ast.Eq: ("==", EQUALITY, operator.eq),
    ast.NotEq: ("!=", EQUALITY, operator.ne),
}
_RETURNED = 8  # numbers that a function may return
_UNROLLED = 4  # turns of a loop that is written out in JavaScript, whose compilers don't


class TranslationError(CinegenError):
    """A kernel uses what the translation does not know; the message names it."""


@dataclass(frozen=True)
class Number:
    """A number: of kind "float", "int" or "bool"; `value` if it is a constant, `least` if it is never less."""

    kind: str
    code: str
    rank: int = ATOM
    value: float | None = None
    least: float | None = None

    def at(self, rank: int) -> str:
        """Return the code as an operand of an operator of a precedence."""
        return self.code if self.rank >= rank else f"({self.code})"


@dataclass(frozen=True)
class Known:
    """Numbers of an array that are constants."""

    numbers: Any  # of numpy

    def at(self, index: Number, is_joint: bool) -> Known | None:
        """Return those of a part, if they are the same at every index; joint 0 is the world, which has none."""
        if index.value is not None:
            return Known(self.numbers[int(index.value)])
        rows = self.numbers[1:] if is_joint else self.numbers
        return Known(rows[0]) if len(rows) and (rows == rows[0]).all() else None

    def number(self, index: Number, is_joint: bool) -> Number | None:
        """Return a number of a list if it is a constant, or the index and a constant."""
        one = self.at(index, is_joint)
        if one is not None:
            return None if one.numbers.ndim else _constant_of(one.numbers.item())
        rows = self.numbers[1:] if is_joint else self.numbers
        if rows.dtype.kind != "i" or len(rows) == 0 or (np.diff(rows) != 1).any():
            return None
        found = _sum(index, _integer(int(rows[0]) - is_joint))
        return Number(found.kind, found.code, found.rank, least=float(rows[0]))

    def least(self, is_joint: bool) -> float | None:
        """Return the least of them."""
        rows = self.numbers[1:] if is_joint else self.numbers
        return float(rows.min()) if rows.size else None

    @property
    def is_plain(self) -> bool:
        """True of few numbers 0 and 1: functions are translated for them."""
        return bool(self.numbers.size <= 3 and np.isin(self.numbers, (0.0, 1.0)).all())


@dataclass(frozen=True)
class View:
    """An array: the table it is in, the index of its first number, its dimensions, the name of the field that it is a
    part of, and its numbers if they are constants."""

    table: str
    begin: Number
    shape: tuple[Number, ...]
    field: str = ""
    known: Known | None = None

    @property
    def kind(self) -> str:
        """Kind of its numbers."""
        return "float" if self.table == "D" else "int"


@dataclass(frozen=True)
class Memories:
    """One of some memories, or the only one."""

    all: tuple[Memory, ...]
    index: Number


@dataclass(frozen=True)
class Target:
    """The address of a task's target: its own one here."""

    of: Memories


@dataclass(frozen=True)
class _Ended:
    """The variable of a loop that has ended: Python keeps its last value, the other languages the one behind it."""

    name: str


Value = Any
"""A `Number`, a `View`, `Memories`, a `Target`, a tuple of these, or an object of Python."""


@dataclass
class Translated:
    """A function that is translated.

    Attributes:
        name: its name.
        parameters: names and kinds of those that are used.
        used: for each number of the arguments, whether it is used.
        result: kinds of what it returns.
        writes: whether it writes to the heap.
        lines: its code.
    """

    name: str
    parameters: list[tuple[str, str]] = field(default_factory=list)
    used: list[bool] = field(default_factory=list)
    result: tuple[str, ...] = ()
    writes: bool = False
    lines: list[str] = field(default_factory=list)


class KernelTranslation:
    """Functions in one language that share a heap.

    Args:
        language: language.
        heap: heap.
        body: translation of one function; of another class where fields of memories are found elsewhere.

    Attributes:
        functions: those translated so far, callees first.
    """

    def __init__(self, language: Language, heap: Heap, body: type[FunctionTranslation] | None = None) -> None:
        self.language, self.heap, self.functions = language, heap, list[Translated]()
        self._body = body or FunctionTranslation
        self.returned = heap.allocate(("returned",), np.zeros(_RETURNED)).begin
        self._known: dict[tuple[object, ...], Translated] = {}
        self._texts: dict[str, Translated] = {}
        self.names, self.writing = set[str](), set[str]()
        self.changing, self.arrays, self.read = set[tuple[object, ...]](), set[str](), set[str]()

    def function(self, kernel: Any, arguments: Sequence[Value]) -> Translated:
        """Return the translation of a kernel for arguments of these kinds."""
        source = getattr(kernel, "py_func", kernel)
        key = (source, *(_kind_of(one, not self.language.is_c) for one in arguments))
        if key not in self._known:
            stem = _stem(source)
            name, count = stem, 1
            while name in self.names:
                count += 1
                name = f"{stem}_{count}"
            self.names.add(name)
            found = self._body(self, source, arguments, Translated(name)).translated
            text = "\n".join(found.lines).replace(f"{name}(", f"{stem}(")
            if text not in self._texts:  # else it does not depend on the arguments' sizes
                self._texts[text] = found
                self.functions.append(found)
            self._known[key] = self._texts[text]
        return self._known[key]

    def leave_out_uncalled(self, entries: Sequence[Any]) -> None:
        """Leave out functions that none of some kernels needs."""
        called = {_stem(kernel) for kernel in entries}
        for one in reversed(self.functions):
            if one.name in called:
                called |= set(re.findall(r"(\w+)\(", "\n".join(one.lines[1:])))
        self.functions = [one for one in self.functions if one.name in called]

    def name_of(self, kernel: Any) -> str:
        """Return the name of a translated kernel that is called from outside."""
        return _stem(kernel)

    def view(self, place: HeapArray) -> View:
        """Return an array by its address."""
        return View(place.table, _integer(place.begin), tuple(map(_integer, place.shape)))


def translated(
    language: Language,
    memory: Memory,
    entries: Sequence[Any],
    fields: Sequence[str],
    free: Collection[str],
    structure: Collection[str] = (),
) -> KernelTranslation:
    """Return the translation of kernels of one memory.

    Args:
        language: language.
        memory: their argument.
        entries: kernels that are called from outside.
        fields: arrays that are used from outside.
        free: names of parameters that are no constants.
        structure: names of arrays that nothing writes, whose numbers are constants where they are alike. If there are
            any, states that no kernel changes are constants, too, and arrays that nothing reads are not written.
    """
    heap, memories = Heap(free, structure), Memories((memory,), Number("int", "0", value=0))
    changing: frozenset[tuple[object, ...]] | None = None
    unread, stable = frozenset[str](), 0
    while stable < 2:  # now it is known what is needed
        heap = heap.sorted(changing, unread)
        for field_ in fields:
            heap.place(memory, field_)
        translation = KernelTranslation(language, heap)
        for kernel in entries:
            translation.function(kernel, [memories])
        translation.leave_out_uncalled(entries)
        before = changing, unread
        if structure:
            changing = frozenset(translation.changing) | {key_of((memory,), name) for name in fields}
            unread = frozenset(translation.arrays - translation.read - set(fields))
        stable = stable + 1 if before == (changing, unread) else 0
    return translation


def _constant_of(value: float) -> Number:
    """Return a constant that a function may be translated for."""
    return Number("float" if isinstance(value, float) else "int", str(value), ATOM, value)


def _stem(kernel: Any) -> str:
    return f"{kernel.__module__.rpartition('.')[2].strip('_')}_{kernel.__name__.strip('_')}"


def _kind_of(value: Value, with_sizes: bool) -> object:
    """Return the kind of an argument; with the sizes of arrays where functions are translated for these: that is faster
    and longer."""
    match value:
        case Number():
            return value.kind
        case View(known=known) if known is not None and known.is_plain:
            return value.table, len(value.shape), tuple(known.numbers.ravel().tolist())
        case View() if with_sizes:
            return value.table, tuple(size.value for size in value.shape)
        case View():
            return value.table, len(value.shape)
        case Memories():
            return tuple(map(id, value.all))
    raise TranslationError(f"a kernel is called with {value!r}")


def _integer(value: int) -> Number:
    return Number("int", str(value), ATOM if value >= 0 else UNARY, int(value))


def _sum(a: Number, b: Number, sign: int = 1) -> Number:
    """Return a sum or a difference of integers, constants added up."""
    if a.value is not None and b.value is not None:
        return _integer(int(a.value + sign * b.value))
    if b.value == 0:
        return a
    if a.value == 0 and sign > 0:
        return b
    return Number("int", f"{a.at(SUM)} {'+' if sign > 0 else '-'} {b.at(SUM + 1)}", SUM)


def _simple(op: ast.operator, a: Number, b: Number) -> Number | None:
    """Return a product with 0 or 1, or a sum with 0, without the operation; None of others."""
    if isinstance(op, ast.Mult):
        for one, other in ((a, b), (b, a)):
            if one.value == 0.0:
                return _constant_of(0.0)
            if one.value == 1.0 and other.kind == "float":
                return other
    if isinstance(op, ast.Add) and a.value == 0.0 and b.kind == "float":
        return b
    if isinstance(op, ast.Add | ast.Sub) and b.value == 0.0 and a.kind == "float":
        return a
    if isinstance(op, ast.Div) and b.value == 1.0 and a.kind == "float":
        return a
    return None


def _minus(one: Number) -> Number:
    return Number(one.kind, f"-{one.at(UNARY + 1)}", UNARY)


def _product(a: Number, b: Number) -> Number:
    if a.value is not None and b.value is not None:
        return _integer(int(a.value * b.value))
    for one, other in ((a, b), (b, a)):
        if one.value == 0:
            return _integer(0)
        if one.value == 1:
            return other
    return Number("int", f"{a.at(PRODUCT)} * {b.at(PRODUCT + 1)}", PRODUCT)


class FunctionTranslation:
    """One function while it is translated."""

    def __init__(self, to: KernelTranslation, source: Any, arguments: Sequence[Value], translated: Translated) -> None:
        self._to, self._source, self.translated = to, source, translated
        self._language, self._heap = to.language, to.heap
        self._names: dict[str, Value] = {}
        self._variables: dict[str, str] = {}
        self._lines: list[str] = []
        self._depth, self._count = 1, 0
        tree = ast.parse(textwrap.dedent(inspect.getsource(source))).body[0]
        assert isinstance(tree, ast.FunctionDef)
        stored = [one.id for one in ast.walk(tree) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)]
        given = [one.arg for one in tree.args.args]
        self._own = {*stored, *given}
        self._changing = {name for name in stored if stored.count(name) > 1 or name in given}
        hints, offered = get_type_hints(source), list[tuple[str, str]]()
        for one, value in zip(tree.args.args, arguments, strict=True):
            kind = {float: "float", int: "int", bool: "bool"}.get(hints.get(one.arg, object))
            self._names[one.arg] = self._parameter(identifier(one.arg), value, kind, offered)
        doc = (ast.get_docstring(tree) or "").partition("\n\n")[0]
        self._run(tree.body)
        self._leave_out_unread()
        body = "\n".join(self._lines)
        translated.writes = translated.writes or self._calls(body)
        if translated.writes:
            to.writing.add(translated.name)
        translated.used = [_occurs(name, body) for name, _ in offered]
        translated.parameters = [one for one, used in zip(offered, translated.used, strict=True) if used]
        for name, _ in offered:
            self._variables.pop(name, None)
        result = translated.result[0] if len(translated.result) == 1 else "none"
        begin = signature(translated.name, translated.parameters, result, self._language)
        comment = textwrap.wrap(doc, 110)
        local = {name: kind for name, kind in self._variables.items() if _occurs(name, body)}
        translated.lines = [
            *(f"{'/*' if i == 0 else ' *'} {line}" for i, line in enumerate(comment)),
            *([" */"] if comment else []),
            f"{begin} {{",
            *(f"  {line}" for line in declarations(local, self._language)),
            *self._lines,
            "}",
        ]
        if self._language.is_c:
            for heap in ("D", "I"):
                if not _occurs(heap, body):
                    at = 1 + sum(1 for line in comment) + bool(comment)
                    translated.lines.insert(at, f"  (void) {heap};")

    def _leave_out_unread(self) -> None:
        """Leave out assignments to variables that nothing reads."""
        count = -1
        while count != len(self._lines):
            count = len(self._lines)
            for name in list(self._variables):
                begin = f"{name} = "
                own = [line for line in self._lines if line.lstrip().startswith(begin)]
                others = [line for line in self._lines if not line.lstrip().startswith(begin)]
                code = "\n".join([*others, *(line.lstrip()[len(begin) :] for line in own)])
                if own and not _occurs(name, code) and not any(self._calls(line) for line in own):
                    self._lines = others

    def _calls(self, code: str) -> bool:
        """Return whether code calls a kernel that writes."""
        return any(one in self._to.writing for one in re.findall(r"(\w+)\(", code))

    # --- what names stand for ------------------------------------------------------------------------------------

    def _parameter(self, name: str, value: Value, kind: str | None, offered: list[tuple[str, str]]) -> Value:
        match value:
            case Number():
                offered.append((name, kind or value.kind))
                return Number(kind or value.kind, name)
            case View():
                offered += [(name, "int"), *((f"{name}_{i}", "int") for i in range(len(value.shape)))]
                shape = tuple(
                    size if size.value is not None and not self._language.is_c else Number("int", f"{name}_{i}")
                    for i, size in enumerate(value.shape)
                )
                known = value.known if value.known is not None and value.known.is_plain else None
                return View(value.table, Number("int", name), shape, "", known)
            case Memories() if len(value.all) > 1:
                offered.append((name, "int"))
                return Memories(value.all, Number("int", name))
        return value

    def _variable(self, name: str, kind: str) -> str:
        """Declare a variable; return its name."""
        before = self._variables.get(name, kind)
        kinds = {before, kind}
        if kinds == {"int", "float"}:
            kind = "float"
        elif len(kinds) > 1:
            raise self._error(f"'{name}' is of two kinds, {before} and {kind}")
        self._variables[name] = kind
        return name

    def _temporary(self, kind: str) -> str:
        self._count += 1
        while f"t{self._count}" in self._own:
            self._count += 1
        return self._variable(f"t{self._count}", kind)

    def _error(self, what: str) -> TranslationError:
        return TranslationError(f"{self._source.__module__}.{self._source.__name__}: {what}")

    def _emit(self, line: str) -> None:
        self._lines.append("  " * self._depth + line)

    # --- statements ----------------------------------------------------------------------------------------------

    def _block(self, statements: Sequence[ast.stmt]) -> None:
        self._depth += 1
        self._run(statements)
        self._depth -= 1

    def _run(self, statements: Sequence[ast.stmt]) -> bool:
        """Translate statements; those behind one that leaves the block are left out. Return whether there is one."""
        return any(self._statement(one) for one in statements)

    def _statement(self, node: ast.stmt) -> bool:
        """Translate a statement; return whether those behind it are never reached."""
        match node:
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                pass
            case ast.Expr(value=value):
                found = self._value(value)
                if isinstance(found, Number) and found.code:
                    self._emit(f"{found.code};")
            case ast.Assign(targets=targets, value=value):
                self._assign(targets, value)
            case ast.AugAssign(target=target, op=op, value=value):
                self._assign([target], ast.BinOp(left=_loaded(target), op=op, right=value))
            case ast.For(orelse=[]):
                self._loop(node)
            case ast.While(test=test, body=body, orelse=[]):
                self._emit(f"while ({self._unconditional(test).code}) {{")
                self._block(body)
                self._emit("}")
            case ast.If():
                return self._branch(node)
            case ast.Continue():
                self._emit("continue;")
                return True
            case ast.Break():
                self._emit("break;")
                return True
            case ast.Return(value=value):
                self._return(value)
                return True
            case _:
                raise self._error(f"no counterpart of {ast.unparse(node)!r}")
        return False

    def _branch(self, node: ast.If) -> bool:
        test = self._number(node.test)
        if test.value is not None:
            return self._run(node.body if test.value else node.orelse)
        begin = len(self._lines)
        self._emit(f"if ({test.code}) {{")
        self._block(node.body)
        if node.orelse:
            between = len(self._lines)
            self._emit("} else {")
            self._block(node.orelse)
            if len(self._lines) == between + 1:
                self._lines.pop()
        self._emit("}")
        if len(self._lines) == begin + 2 and not self._calls(test.code):
            del self._lines[begin:]
        return False

    def _loop(self, node: ast.For) -> None:
        assert isinstance(node.target, ast.Name)
        assert isinstance(node.iter, ast.Call)
        given = [self._number(one) for one in node.iter.args]
        step = int(given[2].value or 0) if len(given) == 3 else 1
        begin, end = (given[0], given[1]) if len(given) > 1 else (_integer(0), given[0])
        if begin.value is not None and end.value is not None:
            turns = range(int(begin.value), int(end.value), step)
            leaves = any(isinstance(one, ast.Continue | ast.Break) for one in ast.walk(node))
            if not turns or (len(turns) <= _UNROLLED and not self._language.is_c and not leaves):
                for turn in turns:
                    self._names[node.target.id] = _integer(turn)
                    self._run(node.body)
                self._names[node.target.id] = _Ended(node.target.id)
                return
        if end.value is None:
            last = self._temporary("int")
            self._emit(f"{last} = {end.code};")
            end = Number("int", last)
        name = self._variable(identifier(node.target.id), "int")
        self._names[node.target.id] = Number("int", name)
        change = {1: f"{name}++", -1: f"{name}--"}.get(step, f"{name} += {step}")
        first = len(self._lines)
        self._emit(
            f"for ({name} = {begin.code}; {name} {'<' if step > 0 else '>'} {end.at(COMPARISON + 1)}; {change}) {{"
        )
        self._block(node.body)
        self._emit("}")
        if len(self._lines) == first + 2:
            del self._lines[first:]
        self._names[node.target.id] = _Ended(node.target.id)

    def _return(self, value: ast.expr | None) -> None:
        if value is None:
            self._emit("return;")
            return
        found = self._value(value)
        if isinstance(found, tuple):
            numbers, self.translated.writes = [self._held(one) for one in found], True
            for i, one in enumerate(numbers):
                self._emit(f"D[{self._to.returned + i}] = {self._as('float', one).code};")
            self.translated.result = tuple(one.kind for one in numbers)
            self._emit("return;")
            return
        if not isinstance(found, Number):
            raise self._error(f"it returns {ast.unparse(value)!r}")
        before = self.translated.result[0] if self.translated.result else found.kind
        kind = "float" if {before, found.kind} == {"int", "float"} else before
        self.translated.result = (kind,)
        self._emit(f"return {self._as(kind, found).code};")

    def _held(self, value: Number) -> Number:
        """Return a number in a variable of its own."""
        if value.value is not None:
            return value
        name = self._temporary(value.kind)
        self._emit(f"{name} = {value.code};")
        return Number(value.kind, name)

    # --- assignments ---------------------------------------------------------------------------------------------

    def _assign(self, targets: list[ast.expr], value: ast.expr) -> None:
        found = self._value(value)
        if len(targets) > 1 and isinstance(found, Number):
            found = self._held(found)
        for target in targets:
            if not isinstance(target, ast.Tuple):
                self._store(target, found)
                continue
            parts, clash = list(found), self._clash(target, value)
            if clash and not all(isinstance(one, Number) for one in parts):
                raise self._error(f"arrays exchange their names in {ast.unparse(target)!r}")
            if clash or not all(isinstance(one, ast.Name) for one in target.elts):  # an array may have two names
                parts = [self._held(one) if isinstance(one, Number) else one for one in parts]
            for one, part in zip(target.elts, parts, strict=True):
                self._store(one, part)

    @staticmethod
    def _clash(target: ast.Tuple, value: ast.expr) -> bool:
        """Return whether a value is read after a target before it was written."""
        if not isinstance(value, ast.Tuple):
            return False
        written = set[str]()
        for one, part in zip(target.elts, value.elts, strict=True):
            read = {node.id for node in ast.walk(part) if isinstance(node, ast.Name)}
            if written & read:
                return True
            base: ast.expr = one
            while isinstance(base, ast.Subscript | ast.Attribute):
                base = base.value
            assert isinstance(base, ast.Name)
            written.add(base.id)
        return False

    def _store(self, target: ast.expr, value: Value) -> None:
        match target:
            case ast.Name(id=name):
                self._names[name] = self._bound(identifier(name), value)
            case ast.Attribute(value=owner, attr=attribute):
                self.translated.writes = True
                self._set(self._value(owner), attribute, value)
            case ast.Subscript(value=owner, slice=index):
                array, self.translated.writes = self._value(owner), True
                assert isinstance(array, View)
                if array.field in self._heap.unread and not self._calls(getattr(value, "code", "")):
                    return
                place = self._part(array, index, is_read=False)
                if isinstance(place, View):
                    self._fill(place, value)
                else:
                    self._emit(f"{place.code} = {self._as(place.kind, value).code};")
            case _:
                raise self._error(f"nothing is assigned to {ast.unparse(target)!r}")

    def _set(self, owner: Memories, name: str, value: Number) -> None:
        """Set a state."""
        field_ = type(owner.all[0]).fields[name]
        before = [getattr(one, name) for one in owner.all]
        if value.value is None or any(one != value.value for one in before):
            self._to.changing.add(key_of(owner.all, name))
        if not field_.is_invariant and not isinstance(self._heap.number(owner.all, name), HeapArray):
            return  # it never changes
        state = self._state(owner, name)
        self._emit(f"{state} = {self._as('float' if state[0] == 'D' else 'int', value).code};")

    def _bound(self, name: str, value: Value) -> Value:
        """Return what a name stands for after an assignment."""
        is_constant = name.removesuffix("_") not in self._changing and name not in self._changing
        match value:
            case Number() if value.value is not None and is_constant:
                return value
            case Number():
                self._variable(name, value.kind)
                self._emit(f"{name} = {self._as(self._variables[name], value).code};")
                return Number(self._variables[name], name, least=value.least if is_constant else None)
            case View():
                begin = self._fixed(name, value.begin, is_constant)
                sizes = enumerate(value.shape)
                shape = tuple(self._fixed(f"{name}_{i}", one, is_constant) for i, one in sizes)
                return View(value.table, begin, shape, value.field, value.known if is_constant else None)
            case Memories():
                return Memories(value.all, self._fixed(name, value.index, is_constant))
        return value

    def _fixed(self, name: str, value: Number, is_constant: bool) -> Number:
        """Return an integer, kept in a variable unless it is a constant."""
        if value.value is not None and is_constant:
            return value
        self._variable(name, "int")
        if value.code != name:
            self._emit(f"{name} = {value.code};")
        return Number("int", name)

    def _fill(self, place: View, value: Value) -> None:
        """Write a number, or the numbers of another array, to all of an array."""
        count = _integer(1)
        for size in place.shape:
            count = _product(count, size)
        if isinstance(value, View):
            self._to.read.add(value.field)
        name = self._temporary("int")
        self._emit(f"for ({name} = 0; {name} < {count.at(COMPARISON + 1)}; {name}++) {{")
        k = Number("int", name)
        source = f"{value.table}[{_sum(value.begin, k).code}]" if isinstance(value, View) else value.code
        self._emit(f"  {place.table}[{_sum(place.begin, k).code}] = {source};")
        self._emit("}")

    # --- values --------------------------------------------------------------------------------------------------

    def _number(self, node: ast.expr) -> Number:
        found = self._value(node)
        if isinstance(found, bool | int | float):
            return self._constant(found)
        if not isinstance(found, Number):
            raise self._error(f"{ast.unparse(node)!r} is not a number")
        return found

    def _unconditional(self, node: ast.expr) -> Number:
        """Return a number that may not be computed, or more than once: without statements before it."""
        count, found = len(self._lines), self._number(node)
        if len(self._lines) != count:
            raise self._error(f"{ast.unparse(node)!r} needs statements of its own: assign its parts before")
        return found

    def _constant(self, value: float) -> Number:
        kind = "bool" if isinstance(value, bool) else "int" if isinstance(value, int) else "float"
        negative = not isinstance(value, bool) and (value < 0 or (value == 0 and math.copysign(1.0, value) < 0))
        return Number(kind, literal(value, self._language), UNARY if negative else ATOM, value)

    def _value(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant(value=bool() | int() | float() as value):
                return self._threshold(value)
            case ast.Name(id=name):
                found = self._names.get(name)
                if isinstance(found, _Ended):
                    raise self._error(f"'{name}' is read after its loop")
                if found is not None:
                    return found
                return self._object(self._source.__globals__.get(name, getattr(builtins, name, None)), name)
            case ast.Tuple(elts=elements):
                return tuple(self._value(one) for one in elements)
            case ast.Attribute(value=owner, attr=attribute):
                return self._attribute(self._value(owner), attribute)
            case ast.Subscript(value=owner, slice=index):
                return self._part(self._value(owner), index)
            case ast.BinOp(left=left, op=op, right=right):
                return self._operation(op, self._number(left), self._number(right))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                found = self._number(operand)
                return _minus(found) if found.value is None else self._constant(-found.value)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                found = self._number(operand)
                if found.value is not None:
                    return self._constant(not found.value)
                return Number("bool", f"!{found.at(UNARY)}", UNARY)
            case ast.BoolOp(op=op, values=values):
                return self._junction(isinstance(op, ast.And), values)
            case ast.Compare(left=left, ops=ops, comparators=others):
                return self._comparison(left, ops, others)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                chosen = self._number(test)
                if chosen.value is not None:
                    return self._value(body if chosen.value else orelse)
                a, b = self._unconditional(body), self._unconditional(orelse)
                kind = a.kind if a.kind == b.kind else "float"
                a, b = self._as(kind, a), self._as(kind, b)
                return Number(kind, f"{chosen.at(CHOICE + 1)} ? {a.at(CHOICE + 1)} : {b.at(CHOICE)}", CHOICE)
            case ast.Call(func=called, args=arguments):
                return self._call(self._value(called), arguments)
        raise self._error(f"no counterpart of {ast.unparse(node)!r}")

    def _object(self, found: Any, name: str) -> Value:
        if found is None:
            raise self._error(f"'{name}' is unknown")
        return self._threshold(found, name) if isinstance(found, bool | int | float) else found

    def _threshold(self, value: float, name: str = "") -> Number:
        """Return a constant of the kernels."""
        if self._language.is_single and isinstance(value, float):
            value = threshold(value, name, self._source.__name__)
        return self._constant(value)

    def _attribute(self, owner: Value, name: str) -> Value:
        if isinstance(owner, View):
            assert name == "shape"
            return owner.shape
        if not isinstance(owner, Memories):
            return self._object(getattr(owner, name, None), name)
        if name == "target" and "own_target" in owner.all[0].fields:
            return Target(owner)
        return self._field(owner, name)

    def _field(self, owner: Memories, name: str) -> Value:
        """Return a field of a memory."""
        first = owner.all[0]
        declared = first.fields[name]
        if declared.shape is None:
            place = self._heap.number(owner.all, name)
            if not isinstance(place, HeapArray):
                return self._constant(place)
            return Number("float" if place.table == "D" else "int", self._state(owner, name))
        places = [self._heap.array(one, name) for one in owner.all]
        self._to.arrays.add(name)
        if len(places) == 1:
            view, numbers = self._to.view(places[0]), self._heap.known(first, name)
            return View(view.table, view.begin, view.shape, name, None if numbers is None else Known(numbers))
        begin = self._heap.allocate((tuple(map(id, owner.all)), name, BEGIN), np.array([one.begin for one in places]))
        shape = []
        for i, _ in enumerate(places[0].shape):
            sizes = [one.shape[i] for one in places]
            if len(set(sizes)) == 1:
                shape.append(_integer(sizes[0]))
                continue
            table = self._heap.allocate((tuple(map(id, owner.all)), name, i), np.array(sizes))
            shape.append(Number("int", f"I[{_sum(_integer(table.begin), owner.index).code}]"))
        index = Number("int", f"I[{_sum(_integer(begin.begin), owner.index).code}]")
        return View(places[0].table, index, tuple(shape), name)

    def _state(self, owner: Memories, name: str) -> str:
        place = self._heap.number(owner.all, name)
        if not isinstance(place, HeapArray):
            raise self._error(f"'{name}' is a constant")
        return f"{place.table}[{_sum(_integer(place.begin), owner.index).code}]"

    def _part(self, owner: Value, index: ast.expr, is_read: bool = True) -> Value:
        """Return a number or a view of an array."""
        if isinstance(owner, tuple):
            return owner[int(self._number(index).value or 0)]
        assert isinstance(owner, View)
        begin, shape, least = owner.begin, list[Number](), None
        given = list(index.elts) if isinstance(index, ast.Tuple) else [index]
        known, is_joint = owner.known, owner.field.startswith("joint_")
        for i, size in enumerate(owner.shape):
            width = _integer(1)
            for inner in owner.shape[i + 1 :]:
                width = _product(width, inner)
            if i >= len(given):
                shape.append(size)
            elif isinstance(one := given[i], ast.Slice):
                if one.step is not None:
                    raise self._error(f"a step in {ast.unparse(index)!r}")
                low = _integer(0) if one.lower is None else self._number(one.lower)
                high = size if one.upper is None else self._number(one.upper)
                begin = _sum(begin, _product(low, width))
                shape.append(_sum(high, low, -1))
                known = None
            else:
                at = self._number(one)
                if at.value is not None and at.value < 0:
                    raise self._error(f"index {ast.unparse(one)} counts from the end")
                if known is not None and known.numbers.ndim == 1 and (found := known.number(at, is_joint)) is not None:
                    return found if found.value is None else self._constant(found.value)
                least = known.least(is_joint) if known is not None else None
                known = known.at(at, is_joint) if known is not None else None
                is_joint = False
                begin = _sum(begin, _product(at, width))
        if shape:
            return View(owner.table, begin, tuple(shape), owner.field, known)
        if is_read:
            self._to.read.add(owner.field)
        return Number(owner.kind, f"{owner.table}[{begin.code}]", least=least)

    def _operation(self, op: ast.operator, a: Number, b: Number) -> Number:
        if isinstance(op, ast.Pow):
            return self._mathematics("pow", [a, b])
        if isinstance(op, ast.FloorDiv):
            if a.value is not None and b.value is not None:
                return _integer(int(a.value // b.value))
            return Number("int", quotient(a.at(ATOM), b.at(ATOM), self._language))
        sign, rank, compute = _OPERATORS[type(op)]
        if a.kind == b.kind == "int":
            if isinstance(op, ast.Add | ast.Sub):
                return _sum(a, b, 1 if isinstance(op, ast.Add) else -1)
            if isinstance(op, ast.Mult):
                return _product(a, b)
        if a.value is not None and b.value is not None:
            return self._constant(compute(a.value, b.value))
        kind = "int" if a.kind == b.kind == "int" and not isinstance(op, ast.Div) else "float"
        if kind == "float" and (found := _simple(op, a, b)) is not None:
            return found if found.value is None else self._constant(found.value)
        left = self._real(a).at(rank) if kind == "float" and self._language.is_c else a.at(rank)
        right = self._real(b) if kind == "float" and self._language.is_single else b
        return Number(kind, f"{left} {sign} {right.at(rank + 1)}", rank)

    def _real(self, one: Number) -> Number:
        """Return a number as one that is no integer, where C needs that."""
        if one.kind != "int" or not self._language.is_c:
            return one
        if one.value is not None:
            return self._constant(float(one.value))
        return Number("float", f"({self._language.real}) {one.at(UNARY)}", UNARY)

    def _as(self, kind: str, one: Number) -> Number:
        """Return a number of a kind: C converts integers to doubles by itself, but only some of them to floats."""
        return self._real(one) if kind == "float" and self._language.is_single else one

    def _junction(self, is_and: bool, values: Sequence[ast.expr]) -> Number:
        found = list[Number]()
        for node in values:
            one = self._unconditional(node) if found else self._number(node)
            if one.value is None:
                found.append(one)
            elif bool(one.value) is not is_and:  # decides
                if not found:
                    return self._constant(not is_and)
                found.append(self._constant(bool(one.value)))
                break
        if not found:
            return self._constant(is_and)
        rank, sign = (AND, " && ") if is_and else (OR, " || ")
        if len(found) == 1:
            return found[0]
        inner = rank + 1 if is_and else AND + 1  # `a && b || c` is written with parentheses
        return Number("bool", sign.join(one.at(inner) for one in found), rank)

    def _comparison(self, left: ast.expr, ops: Sequence[ast.cmpop], others: Sequence[ast.expr]) -> Number:
        numbers, found = [self._number(left), *map(self._number, others)], list[Number]()
        if len(ops) > 1:
            numbers[1:-1] = [self._held(one) if "(" in one.code else one for one in numbers[1:-1]]
        for op, a, b in zip(ops, numbers, numbers[1:], strict=False):
            sign, rank, compute = _COMPARISONS[type(op)]
            if a.value is not None and b.value is not None:
                if not compute(a.value, b.value):
                    return self._constant(False)
                continue
            if a.least is not None and b.value is not None and a.least >= b.value:
                if isinstance(op, ast.Lt):
                    return self._constant(False)
                if isinstance(op, ast.GtE):
                    continue
            found.append(Number("bool", f"{a.at(rank + 1)} {sign} {b.at(rank + 1)}", rank))
        if not found:
            return self._constant(True)
        if len(found) == 1:
            return found[0]
        return Number("bool", " && ".join(one.at(AND + 1) for one in found), AND)

    # --- calls ---------------------------------------------------------------------------------------------------

    def _call(self, called: Any, arguments: Sequence[ast.expr]) -> Value:
        if called in (float, int, bool):
            return self._converted(called, self._number(arguments[0]))
        if called in (min, max):
            return self._extreme(called, [self._number(one) for one in arguments])
        if called is len:
            return self._value(arguments[0]).shape[0]
        if called is abs:
            one = self._number(arguments[0])
            return self._mathematics("abs", [one]) if one.kind == "float" else self._extreme(max, [one, _minus(one)])
        if called is np.floor:
            return self._mathematics("floor", [self._number(arguments[0])])
        name = getattr(called, "__name__", "")
        if getattr(math, name, None) is called:
            return self._mathematics(name, [self._number(one) for one in arguments])
        if called is frame_at or getattr(called, "py_func", None) is getattr(frame_at, "py_func", 0):
            target = self._value(arguments[0])
            assert isinstance(target, Target)
            return self._attribute(target.of, "own_target")
        if hasattr(called, "in_python"):
            return self._memory_of(arguments[0])
        return self._kernel(called, [self._value(one) for one in arguments])

    def _memory_of(self, handle: ast.expr) -> Memories:
        """Return the memory that an element of a table of handles stands for."""
        assert isinstance(handle, ast.Subscript)
        assert isinstance(handle.value, ast.Attribute)
        owner, index = self._value(handle.value.value), self._number(handle.slice)
        assert isinstance(owner, Memories)
        handles = getattr(owner.all[0], handle.value.attr)
        return Memories(tuple(memory_at(one) for one in handles), index if len(handles) > 1 else _integer(0))

    def _mathematics(self, name: str, given: list[Number]) -> Number:
        code = f"{function(name, self._language)}({', '.join(self._as('float', one).code for one in given)})"
        if name == "isfinite":
            return Number("bool", code if self._language.is_c else f"Number.isFinite({given[0].code})")
        return Number("float", code)

    def _converted(self, to: type, given: Number) -> Number:
        kind = {float: "float", int: "int", bool: "bool"}[to]
        if given.value is not None:
            return self._constant(to(given.value))
        if given.kind == kind or (kind == "float" and given.kind == "int"):
            return Number(kind, given.code, given.rank)
        if kind == "int":
            code = f"(int) {given.at(UNARY)}" if self._language.is_c else f"Math.trunc({given.code})"
            return Number("int", code, UNARY if self._language.is_c else ATOM)
        return Number("bool", f"{given.at(EQUALITY + 1)} != 0", EQUALITY)

    def _extreme(self, which: Any, given: list[Number]) -> Number:
        """Return the smallest or largest of numbers as Python does: a NaN behind the first is left out."""
        name, found = "least" if which is min else "most", given[0]
        for one in given[1:]:
            if found.value is not None and one.value is not None:
                found = self._constant(which(found.value, one.value))
                continue
            kind = "int" if found.kind == one.kind == "int" else "float"
            suffix = "_int" if kind == "int" and self._language.is_c else ""
            found = Number(kind, f"{name}{suffix}({self._as(kind, found).code}, {self._as(kind, one).code})")
        return found

    def _kernel(self, kernel: Any, arguments: list[Value]) -> Value:
        source = getattr(kernel, "py_func", None)
        if source is None:
            raise self._error(f"it calls {kernel!r}")
        arguments = [self._constant(one) if isinstance(one, bool | int | float) else one for one in arguments]
        translated = self._to.function(kernel, arguments)
        numbers = list[str]()
        hints = {name: "float" for name, kind in get_type_hints(source).items() if kind is float}
        for name, one in zip(inspect.signature(source).parameters, arguments, strict=True):
            match one:
                case Number():
                    numbers.append(self._as(hints[name], one).code if name in hints else one.code)
                case View():
                    self._to.read.add(one.field)
                    numbers += [one.begin.code, *(size.code for size in one.shape)]
                case Memories() if len(one.all) > 1:
                    numbers.append(one.index.code)
        used = [code for code, is_used in zip(numbers, translated.used, strict=True) if is_used]
        for unread in set(numbers) - set(used):
            if self._calls(unread):
                self._emit(f"{unread};")
        code = call(translated.name, used, self._language)
        if len(translated.result) < 2:
            return Number(translated.result[0] if translated.result else "none", code)
        self._emit(f"{code};")
        found = list[Number]()
        for i, kind in enumerate(translated.result):
            number = Number("float", f"D[{self._to.returned + i}]")
            if kind == "bool":
                number = Number("bool", f"{number.code} != 0", EQUALITY)
            elif kind == "int":
                number = self._converted(int, number)
            found.append(self._held(number))
        return tuple(found)


def _occurs(name: str, code: str) -> bool:
    """Return whether a name occurs in code."""
    at = code.find(name)
    while at >= 0:
        before, after = code[at - 1 : at], code[at + len(name) : at + len(name) + 1]
        if not (before.isalnum() or before == "_") and not (after.isalnum() or after == "_"):
            return True
        at = code.find(name, at + 1)
    return False


def _loaded(target: ast.expr) -> ast.expr:
    """Return a target of an assignment as a value."""
    return ast.parse(ast.unparse(target), mode="eval").body
