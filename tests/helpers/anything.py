"""A library that answers anything, and notes what it is asked: what a command does with its options, at no cost."""

from __future__ import annotations

import builtins
import dis
import inspect
import re
import sys
import types
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from raff2urdf.quantities import LENGTH, shown_scale

_FOREIGN = ("cinegen", "raff2urdf", "numpy", "pinocchio", "matplotlib", "yourdfpy")


_ASKED: list[str] = []


class Anything(str):
    """An object that has every attribute and operation: it is a text, a number, a module, a list of one.

    What it is called with is noted, with the calls' names; functions that it is given are called.
    """

    def __new__(cls, name: str = "any") -> Anything:
        instance = super().__new__(cls, "x")
        instance.__dict__["_called"] = name
        return instance

    suffix = ".x"

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return Anything(f"{self._called}.{name}".removeprefix("any."))

    def __call__(self, *args: Any, **options: Any) -> Any:
        named = {key: value for key, value in options.items() if key != "report"}
        unit = shown_scale(LENGTH)[1] if re.search("draw|_text|_lines|_task", self._called) else ""
        _ASKED.append(f"{self._called}{_plain(args)}{_plain(named)}{unit}")
        for arg in (*args, *named.values()):
            if isinstance(arg, types.FunctionType):
                arg(*(Anything() for part in inspect.signature(arg).parameters.values() if part.default is part.empty))
        return Anything()

    def __iter__(self) -> Iterator[Any]:
        frame = sys._getframe(1)
        code, at = frame.f_code.co_code, frame.f_lasti
        return iter([Anything() for _ in range(code[at + 1] if code[at] == dis.opmap["UNPACK_SEQUENCE"] else 1)])

    def items(self) -> Any:
        return [(Anything(), Anything())]

    def __getitem__(self, _: Any) -> Any:
        return Anything()

    def __format__(self, _: str) -> str:
        return "1"

    def __float__(self) -> float:
        return 1.0

    def __int__(self) -> int:
        return 1

    __index__ = __int__

    def __len__(self) -> int:
        return 1

    def __contains__(self, _: object) -> bool:
        return True

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        pass


_OPERATIONS = "add radd sub rsub mul rmul truediv rtruediv floordiv mod pow neg invert abs or and matmul round ne"
for _name in _OPERATIONS.split():
    setattr(Anything, f"__{_name}__", lambda *_: Anything())
for _name in ["lt", "le", "gt", "ge"]:
    setattr(Anything, f"__{_name}__", lambda *_: True)


def _plain(value: Any) -> str:
    """Return a text that is the same in each run."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_plain(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "(" + ", ".join(map(_plain, value)) + ")"
    return re.sub(" at 0x[0-9a-f]+", "", repr(value))


@contextmanager
def library_of_anything(modules: tuple[str, ...]) -> Iterator[list[str]]:
    """Let functions of modules import `Anything` instead of what computes; yield what they ask of it."""
    original, original_zip = builtins.__import__, zip

    def load(name: str, globals: Any = None, locals: Any = None, wanted: Any = (), level: int = 0) -> Any:
        caller = sys._getframe(1)
        inside = caller.f_code.co_name != "<module>" and (globals or {}).get("__name__", "").startswith(modules)
        if inside and name.partition(".")[0] in _FOREIGN and not name.startswith(modules):
            return Anything()
        return original(name, globals, locals, wanted, level)

    _ASKED.clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(builtins, "__import__", load)
        patch.setattr(builtins, "zip", lambda *these, strict=False: original_zip(*these))
        yield _ASKED
