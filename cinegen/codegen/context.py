"""Context of a translation: what its functions share, and what they call."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cinegen.codegen.heap import Heap
from cinegen.codegen.language import Language
from cinegen.codegen.values import Value

_RETURNED = 8  # numbers that a function may return


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


class TranslationContext(ABC):
    """State that the functions of a translation share.

    Args:
        language: language.
        heap: heap.

    Attributes:
        returned: index of the first number of the heap in which functions return several numbers.
        writing: names of functions that write to the heap.
        changing: keys of states that functions change.
        arrays: names of arrays that functions use.
        read: names of arrays that functions read.
    """

    def __init__(self, language: Language, heap: Heap) -> None:
        self.language, self.heap = language, heap
        self.returned = heap.allocate(("returned",), np.zeros(_RETURNED)).begin
        self.writing, self.changing = set[str](), set[tuple[object, ...]]()
        self.arrays, self.read = set[str](), set[str]()

    @abstractmethod
    def function(self, kernel: Any, arguments: Sequence[Value]) -> Translated:
        """Return the translation of a kernel for arguments of these kinds."""
