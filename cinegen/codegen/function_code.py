"""Code of one function while it is written: its lines and the variables that it declares."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from cinegen.codegen.context import Translated, TranslationContext
from cinegen.codegen.language import declarations, signature
from cinegen.codegen.values import Number, TranslationError

_WIDTH = 110  # of comments


class FunctionCode:
    """Lines and variables of one function.

    Args:
        context: what the functions of the translation share.
        source: kernel that is translated, which errors name.
        reserved: names that no temporary variable has.

    Attributes:
        lines: lines of the function's body.
    """

    def __init__(self, context: TranslationContext, source: Any, reserved: Collection[str]) -> None:
        self._context, self._source, self._reserved = context, source, reserved
        self.lines: list[str] = []
        self._variables: dict[str, str] = {}
        self._depth, self._count = 1, 0

    def error(self, what: str) -> TranslationError:
        """Return an error that names the kernel."""
        return TranslationError(f"{self._source.__module__}.{self._source.__name__}: {what}")

    # --- lines ---------------------------------------------------------------------------------------------------

    def emit(self, line: str) -> None:
        """Append a line."""
        self.lines.append("  " * self._depth + line)

    @contextmanager
    def indented(self) -> Iterator[None]:
        """Indent the lines that are appended within the context."""
        self._depth += 1
        yield
        self._depth -= 1

    def has_effects(self, code: str) -> bool:
        """Return whether code calls a function that writes to the heap."""
        return any(name in self._context.writing for name in re.findall(r"(\w+)\(", code))

    # --- variables -----------------------------------------------------------------------------------------------

    def declare(self, name: str, kind: str) -> str:
        """Declare a variable; return its kind, "float" of one that is declared as an integer, too.

        Raises:
            TranslationError: it is declared already, of a kind that is not converted.
        """
        before = self._variables.get(name, kind)
        kinds = {before, kind}
        if kinds == {"int", "float"}:
            kind = "float"
        elif len(kinds) > 1:
            raise self.error(f"'{name}' is of two kinds, {before} and {kind}")
        self._variables[name] = kind
        return kind

    def temporary(self, kind: str) -> str:
        """Declare a variable that the kernel does not have; return its name."""
        self._count += 1
        while f"t{self._count}" in self._reserved:
            self._count += 1
        name = f"t{self._count}"
        self.declare(name, kind)
        return name

    def in_variable(self, value: Number) -> Number:
        """Return a number in a variable of its own, unless it is a constant."""
        if value.value is not None:
            return value
        name = self.temporary(value.kind)
        self.emit(f"{name} = {value.code};")
        return Number(value.kind, name)

    # --- the whole function --------------------------------------------------------------------------------------

    def complete(self, translated: Translated, parameters: Sequence[tuple[str, str]], summary: str) -> None:
        """Write the function, with its comment and its declarations.

        Args:
            translated: function; its result is known.
            parameters: names and kinds of all numbers of the arguments.
            summary: text of the comment.
        """
        self._leave_out_unread()
        language, body = self._context.language, "\n".join(self.lines)
        translated.writes = translated.writes or self.has_effects(body)
        if translated.writes:
            self._context.writing.add(translated.name)
        translated.used = [_occurs(name, body) for name, _ in parameters]
        translated.parameters = [pair for pair, used in zip(parameters, translated.used, strict=True) if used]
        passed = {name for name, _ in parameters}
        local = {name: kind for name, kind in self._variables.items() if name not in passed and _occurs(name, body)}
        result = translated.result[0] if len(translated.result) == 1 else "none"
        comment = textwrap.wrap(summary, _WIDTH)
        unused = [heap for heap in ("I", "D") if language.is_c and not _occurs(heap, body)]
        translated.lines = [
            *(f"{'/*' if i == 0 else ' *'} {line}" for i, line in enumerate(comment)),
            *([" */"] if comment else []),
            f"{signature(translated.name, translated.parameters, result, language)} {{",
            *(f"  (void) {heap};" for heap in unused),
            *(f"  {line}" for line in declarations(local, language)),
            *self.lines,
            "}",
        ]

    def _leave_out_unread(self) -> None:
        """Leave out assignments to variables that nothing reads."""
        count = -1
        while count != len(self.lines):
            count = len(self.lines)
            for name in list(self._variables):
                begin = f"{name} = "
                stores = [line for line in self.lines if line.lstrip().startswith(begin)]
                others = [line for line in self.lines if not line.lstrip().startswith(begin)]
                code = "\n".join([*others, *(line.lstrip()[len(begin) :] for line in stores)])
                if stores and not _occurs(name, code) and not any(self.has_effects(line) for line in stores):
                    self.lines = others


def _occurs(name: str, code: str) -> bool:
    """Return whether a name occurs in code."""
    at = code.find(name)
    while at >= 0:
        before, after = code[at - 1 : at], code[at + len(name) : at + len(name) + 1]
        if not (before.isalnum() or before == "_") and not (after.isalnum() or after == "_"):
            return True
        at = code.find(name, at + 1)
    return False
