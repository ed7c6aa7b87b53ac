"""Differences of C and JavaScript in translated kernels: literals, a few operators, and declarations."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from enum import Enum

import numpy as np

_WORDS = frozenset(
    """auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool true false
    arguments await class debugger delete eval export extends finally function import in instanceof interface let new
    null package private protected public super this throw try typeof var with yield D I least most floor sqrt sin cos
    tan pow fabs atan2 hypot isfinite sqrtf sinf cosf tanf powf fabsf atan2f hypotf floorf""".split()  # noqa: SIM905
)
_C_MATH = {"abs": "fabs"}


class Language(Enum):
    """Language of generated code."""

    C = "c"
    C_FLOAT = "c-float"
    """C in single precision."""
    JAVASCRIPT = "js"

    @property
    def is_c(self) -> bool:
        """True for C."""
        return self is not Language.JAVASCRIPT

    @property
    def is_single(self) -> bool:
        """True where numbers are floats."""
        return self is Language.C_FLOAT

    @property
    def real(self) -> str:
        """Name of C's type of numbers."""
        return "float" if self.is_single else "double"


def identifier(name: str) -> str:
    """Return a name of Python as one of both languages."""
    return f"{name}_" if name in _WORDS else name


def name_of(text: str) -> str:
    """Return a text, such as a file's name, as a name of both languages: compilers differ in letters beyond ASCII."""
    return identifier(re.sub(r"\W|^(?=\d)", "_", text, flags=re.ASCII))


def literal(value: float, language: Language) -> str:
    """Return a number as it is written."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if math.isinf(value):
        infinite = f"({language.real}) INFINITY" if language.is_c else "Infinity"
        return infinite if value > 0.0 else f"-{infinite}"
    if math.isnan(value):
        return f"({language.real}) NAN" if language.is_c else "NaN"
    return single(value) if language.is_single else repr(float(value))


def single(value: float) -> str:
    """Return a number as C's float."""
    text = str(np.float32(value))
    return f"{text}f" if "." in text or "e" in text else f"{text}.0f"


def function(name: str, language: Language) -> str:
    """Return the name of a function of `math`."""
    if not language.is_c:
        return f"Math.{name}"
    return _C_MATH.get(name, name) + "f" * (language.is_single and name != "isfinite")


def quotient(a: str, b: str, language: Language) -> str:
    """Return the quotient of two integers not below 0, rounded down; operands are atoms."""
    return f"({a} / {b})" if language.is_c else f"Math.trunc({a} / {b})"


def declarations(variables: Mapping[str, str], language: Language) -> list[str]:
    """Return the lines that declare a function's variables, by name and kind."""
    if not variables:
        return []
    if not language.is_c:
        kinds = {"float": "0.0", "int": "0", "bool": "false"}
        return ["let " + ", ".join(f"{name} = {kinds[kind]}" for name, kind in variables.items()) + ";"]
    lines = []
    real = (language.real, literal(0.0, language))
    for kind, word, zero in (("float", *real), ("int", "int", "0"), ("bool", "bool", "false")):
        names = [name for name, declared in variables.items() if declared == kind]
        if names:
            lines.append(f"{word} " + ", ".join(f"{name} = {zero}" for name in names) + ";")
    return lines


def signature(name: str, parameters: Sequence[tuple[str, str]], result: str, language: Language) -> str:
    """Return the first line of a function, without its brace.

    Args:
        name: its name.
        parameters: names and kinds.
        result: kind, or "none".
        language: of it.
    """
    if not language.is_c:
        return f"function {name}({', '.join(parameter for parameter, _ in parameters)})"
    words = {"float": language.real, "int": "int", "bool": "bool", "none": "void"}
    typed = [f"{language.real} *D", "int *I", *(f"{words[kind]} {parameter}" for parameter, kind in parameters)]
    return f"static {words[result]} {name}({', '.join(typed)})"


def call(name: str, arguments: Sequence[str], language: Language) -> str:
    """Return a call of a translated function."""
    heap = ["D", "I"] if language.is_c else []
    return f"{name}({', '.join([*heap, *arguments])})"
