"""Translation of compiled kernels to C and JavaScript.

Kernels are written in a small part of Python: numbers, arrays of a memory and views of them, loops, calls of each
other; nothing is allocated. So each statement has a counterpart in both languages. An array is an index into a table of
numbers, with its dimensions; a memory is known when the code is generated, so sizes and tables of a mechanism become
constants, and branches that it does not need are left out. A function is translated once for each kind of its
arguments.

The kernels themselves are what is translated: there is no second form of their mathematics.

`statements` translates one function, with `expressions`, whose results are `values`; this module translates all
functions that some kernels need.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from typing import Any

from cinegen.codegen.context import Translated, TranslationContext
from cinegen.codegen.heap import Heap, key_of
from cinegen.codegen.language import Language
from cinegen.codegen.statements import FunctionTranslation
from cinegen.codegen.values import Memories, Number, TranslationError, Value, View
from cinegen.jit.memory import Memory


class KernelTranslation(TranslationContext):
    """Functions in one language that share a heap.

    Args:
        language: language.
        heap: heap.
        body: translation of one function; of another class where fields of memories are found elsewhere.

    Attributes:
        functions: those translated so far, callees first.
    """

    def __init__(self, language: Language, heap: Heap, body: type[FunctionTranslation] = FunctionTranslation) -> None:
        super().__init__(language, heap)
        self.functions = list[Translated]()
        self._body = body
        self._known: dict[tuple[object, ...], Translated] = {}
        self._texts: dict[str, Translated] = {}
        self._names = set[str]()

    def function(self, kernel: Any, arguments: Sequence[Value]) -> Translated:
        """Return the translation of a kernel for arguments of these kinds."""
        source = getattr(kernel, "py_func", kernel)
        key = (source, *(_kind_of(argument, not self.language.is_c) for argument in arguments))
        if key not in self._known:
            stem = _stem(source)
            name, count = stem, 1
            while name in self._names:
                count += 1
                name = f"{stem}_{count}"
            self._names.add(name)
            body = self._body(self, source, arguments, Translated(name)).translated
            text = "\n".join(body.lines).replace(f"{name}(", f"{stem}(")
            if text not in self._texts:  # else it does not depend on the arguments' sizes
                self._texts[text] = body
                self.functions.append(body)
            self._known[key] = self._texts[text]
        return self._known[key]

    def leave_out_uncalled(self, entries: Sequence[Any]) -> None:
        """Leave out functions that none of some kernels needs."""
        called = {_stem(kernel) for kernel in entries}
        for function in reversed(self.functions):
            if function.name in called:
                called |= set(re.findall(r"(\w+)\(", "\n".join(function.lines[1:])))
        self.functions = [function for function in self.functions if function.name in called]

    def name_of(self, kernel: Any) -> str:
        """Return the name of a translated kernel that is called from outside."""
        return _stem(kernel)


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
