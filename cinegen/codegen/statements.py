"""Statements of kernels: the translation of one function, from its parameters to its last line."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Sequence
from typing import Any, get_type_hints

from cinegen.codegen.context import Translated, TranslationContext
from cinegen.codegen.expressions import ExpressionTranslation
from cinegen.codegen.function_code import FunctionCode
from cinegen.codegen.heap import HeapArray, key_of
from cinegen.codegen.language import identifier
from cinegen.codegen.values import KINDS, Ended, Memories, Number, Rank, Value, View, count_of, integer, kind_of, sum_of

_UNROLLED = 4  # turns of a loop that is written out in JavaScript, whose compilers don't


class FunctionTranslation(ExpressionTranslation):
    """One function while it is translated.

    Args:
        context: what the functions of the translation share.
        source: kernel, a function of Python.
        arguments: its arguments.
        translated: what is completed.
    """

    def __init__(
        self, context: TranslationContext, source: Any, arguments: Sequence[Value], translated: Translated
    ) -> None:
        tree = ast.parse(textwrap.dedent(inspect.getsource(source))).body[0]
        assert isinstance(tree, ast.FunctionDef)
        stored = [node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
        parameters = [node.arg for node in tree.args.args]
        super().__init__(context, source, FunctionCode(context, source, {*stored, *parameters}))
        self.translated = translated
        self._changing = {name for name in stored if stored.count(name) > 1 or name in parameters}
        hints, offered = get_type_hints(source), list[tuple[str, str]]()
        for name, value in zip(parameters, arguments, strict=True):
            self._names[name] = self._parameter(identifier(name), value, KINDS.get(hints.get(name)), offered)
        self._run(tree.body)
        self._code.complete(translated, offered, (ast.get_docstring(tree) or "").partition("\n\n")[0])

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

    # --- statements ----------------------------------------------------------------------------------------------

    def _block(self, statements: Sequence[ast.stmt]) -> None:
        with self._code.indented():
            self._run(statements)

    def _run(self, statements: Sequence[ast.stmt]) -> bool:
        """Translate statements; those behind one that leaves the block are left out. Return whether there is one."""
        return any(self._statement(statement) for statement in statements)

    def _statement(self, node: ast.stmt) -> bool:
        """Translate a statement; return whether those behind it are never reached."""
        match node:
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                pass
            case ast.Expr(value=value):
                expression = self._value(value)
                if isinstance(expression, Number) and expression.code:
                    self._code.emit(f"{expression.code};")
            case ast.Assign(targets=targets, value=value):
                self._assign(targets, value)
            case ast.AugAssign(target=target, op=op, value=value):
                self._assign([target], ast.BinOp(left=_loaded(target), op=op, right=value))
            case ast.For(orelse=[]):
                self._loop(node)
            case ast.While(test=test, body=body, orelse=[]):
                self._code.emit(f"while ({self._unconditional(test).code}) {{")
                self._block(body)
                self._code.emit("}")
            case ast.If():
                return self._branch(node)
            case ast.Continue():
                self._code.emit("continue;")
                return True
            case ast.Break():
                self._code.emit("break;")
                return True
            case ast.Return(value=value):
                self._return(value)
                return True
            case _:
                raise self._code.error(f"no counterpart of {ast.unparse(node)!r}")
        return False

    def _branch(self, node: ast.If) -> bool:
        test = self._number(node.test)
        if test.value is not None:
            return self._run(node.body if test.value else node.orelse)
        begin = len(self._code.lines)
        self._code.emit(f"if ({test.code}) {{")
        self._block(node.body)
        if node.orelse:
            between = len(self._code.lines)
            self._code.emit("} else {")
            self._block(node.orelse)
            if len(self._code.lines) == between + 1:
                self._code.lines.pop()
        self._code.emit("}")
        if len(self._code.lines) == begin + 2 and not self._code.has_effects(test.code):
            del self._code.lines[begin:]
        return False

    def _loop(self, node: ast.For) -> None:
        assert isinstance(node.target, ast.Name)
        assert isinstance(node.iter, ast.Call)
        bounds = [self._number(each) for each in node.iter.args]
        step = int(bounds[2].value or 0) if len(bounds) == 3 else 1
        begin, end = (bounds[0], bounds[1]) if len(bounds) > 1 else (integer(0), bounds[0])
        if begin.value is not None and end.value is not None:
            turns = range(int(begin.value), int(end.value), step)
            leaves = any(isinstance(each, ast.Continue | ast.Break) for each in ast.walk(node))
            if not turns or (len(turns) <= _UNROLLED and not self._language.is_c and not leaves):
                for turn in turns:
                    self._names[node.target.id] = integer(turn)
                    self._run(node.body)
                self._names[node.target.id] = Ended(node.target.id)
                return
        end, name = self._code.in_variable(end), identifier(node.target.id)
        self._code.declare(name, "int")
        self._names[node.target.id] = Number("int", name)
        change = {1: f"{name}++", -1: f"{name}--"}.get(step, f"{name} += {step}")
        first = len(self._code.lines)
        self._code.emit(
            f"for ({name} = {begin.code}; {name} {'<' if step > 0 else '>'} {end.at(Rank.COMPARISON + 1)}; {change}) {{"
        )
        self._block(node.body)
        self._code.emit("}")
        if len(self._code.lines) == first + 2:
            del self._code.lines[first:]
        self._names[node.target.id] = Ended(node.target.id)

    def _return(self, value: ast.expr | None) -> None:
        if value is None:
            self._code.emit("return;")
            return
        result = self._value(value)
        if isinstance(result, tuple):
            numbers, self.translated.writes = [self._code.in_variable(number) for number in result], True
            for i, number in enumerate(numbers):
                self._code.emit(f"D[{self._context.returned + i}] = {self._arithmetic.as_kind('float', number).code};")
            self.translated.result = tuple(number.kind for number in numbers)
            self._code.emit("return;")
            return
        if not isinstance(result, Number):
            raise self._code.error(f"it returns {ast.unparse(value)!r}")
        before = self.translated.result[0] if self.translated.result else result.kind
        kind = "float" if {before, result.kind} == {"int", "float"} else before
        self.translated.result = (kind,)
        self._code.emit(f"return {self._arithmetic.as_kind(kind, result).code};")

    # --- assignments ---------------------------------------------------------------------------------------------

    def _assign(self, targets: list[ast.expr], value: ast.expr) -> None:
        translated = self._value(value)
        if len(targets) > 1 and isinstance(translated, Number):
            translated = self._code.in_variable(translated)
        for target in targets:
            if not isinstance(target, ast.Tuple):
                self._store(target, translated)
                continue
            parts, clash = list(translated), self._clash(target, value)
            if clash and not all(isinstance(each, Number) for each in parts):
                raise self._code.error(f"arrays exchange their names in {ast.unparse(target)!r}")
            if clash or not all(isinstance(each, ast.Name) for each in target.elts):  # an array may have two names
                parts = [self._code.in_variable(each) if isinstance(each, Number) else each for each in parts]
            for each, part in zip(target.elts, parts, strict=True):
                self._store(each, part)

    @staticmethod
    def _clash(target: ast.Tuple, value: ast.expr) -> bool:
        """Return whether a value is read after a target before it was written."""
        if not isinstance(value, ast.Tuple):
            return False
        written = set[str]()
        for element, part in zip(target.elts, value.elts, strict=True):
            read = {node.id for node in ast.walk(part) if isinstance(node, ast.Name)}
            if written & read:
                return True
            base: ast.expr = element
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
                if array.field in self._heap.unread and not self._code.has_effects(getattr(value, "code", "")):
                    return
                place = self._part(array, index, is_read=False)
                if isinstance(place, View):
                    self._fill(place, value)
                else:
                    self._code.emit(f"{place.code} = {self._arithmetic.as_kind(place.kind, value).code};")
            case _:
                raise self._code.error(f"nothing is assigned to {ast.unparse(target)!r}")

    def _set(self, owner: Memories, name: str, value: Number) -> None:
        """Set a state."""
        field_ = type(owner.all[0]).fields[name]
        before = [getattr(each, name) for each in owner.all]
        if value.value is None or any(each != value.value for each in before):
            self._context.changing.add(key_of(owner.all, name))
        if not field_.is_invariant and not isinstance(self._heap.number(owner.all, name), HeapArray):
            return  # it never changes
        state = self._state(owner, name)
        self._code.emit(f"{state} = {self._arithmetic.as_kind(kind_of(state[0]), value).code};")

    def _bound(self, name: str, value: Value) -> Value:
        """Return what a name stands for after an assignment."""
        is_constant = name.removesuffix("_") not in self._changing and name not in self._changing
        match value:
            case Number() if value.value is not None and is_constant:
                return value
            case Number():
                kind = self._code.declare(name, value.kind)
                self._code.emit(f"{name} = {self._arithmetic.as_kind(kind, value).code};")
                return Number(kind, name, least=value.least if is_constant else None)
            case View():
                begin = self._fixed(name, value.begin, is_constant)
                sizes = enumerate(value.shape)
                shape = tuple(self._fixed(f"{name}_{i}", size, is_constant) for i, size in sizes)
                return View(value.table, begin, shape, value.field, value.known if is_constant else None)
            case Memories():
                return Memories(value.all, self._fixed(name, value.index, is_constant))
        return value

    def _fixed(self, name: str, value: Number, is_constant: bool) -> Number:
        """Return an integer, kept in a variable unless it is a constant."""
        if value.value is not None and is_constant:
            return value
        self._code.declare(name, "int")
        if value.code != name:
            self._code.emit(f"{name} = {value.code};")
        return Number("int", name)

    def _fill(self, place: View, value: Value) -> None:
        """Write a number, or the numbers of another array, to all of an array."""
        if isinstance(value, View):
            self._context.read.add(value.field)
        count, k = count_of(place.shape), Number("int", self._code.temporary("int"))
        source = f"{value.table}[{sum_of(value.begin, k).code}]" if isinstance(value, View) else value.code
        self._code.emit(f"for ({k.code} = 0; {k.code} < {count.at(Rank.COMPARISON + 1)}; {k.code}++) {{")
        with self._code.indented():
            self._code.emit(f"{place.table}[{sum_of(place.begin, k).code}] = {source};")
        self._code.emit("}")


def _loaded(target: ast.expr) -> ast.expr:
    """Return a target of an assignment as a value."""
    return ast.parse(ast.unparse(target), mode="eval").body
