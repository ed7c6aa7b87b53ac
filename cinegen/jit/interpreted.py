"""Kernels as Python functions: what runs until their machine code is there.

A kernel is Python that numba can compile, so Python can run it, too: the same algorithm, with the same results but for
rounding. It takes some hundred times longer (a tick of a robot arm 0.5 ms, of a Gough platform 7 ms): enough to drive a
robot, not for many configurations.
"""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable
from threading import RLock
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from numba.core.dispatcher import Dispatcher


def interpreted(kernel: Any) -> Callable[..., Any]:
    """Return a kernel as a Python function, in which all kernels that it calls are Python functions, too.

    Division by zero gives infinity, as in machine code. It takes memories, not their handles.
    """
    with _lock:
        if kernel not in _made:
            function, names = kernel.py_func, dict[str, Any](_BUILTINS)
            _made[kernel] = FunctionType(function.__code__, names, function.__name__, function.__defaults__)
            known = function.__globals__  # co_names are attributes, too: they may have the kernel's own name
            names.update({name: _in_python(known[name]) for name in function.__code__.co_names if name in known})
        return _made[kernel]


def _in_python(value: Any) -> Any:
    """Return what stands for a global name of a kernel."""
    if isinstance(value, Dispatcher):
        return interpreted(value)
    if value is math:
        return _MATH
    if isinstance(value, ModuleType) and value.__name__.startswith("cinegen."):
        return SimpleNamespace(**{name: _in_python(member) for name, member in vars(value).items()})
    return getattr(value, "in_python", value)


def _quiet(function: Callable[..., float]) -> Callable[..., np.float64]:
    """Return a function of `math` that returns NaN where it would raise; its numpy numbers may be divided by zero."""

    def call(*numbers: float) -> np.float64:
        try:
            return np.float64(function(*numbers))
        except (ValueError, OverflowError):
            return np.float64(math.nan)

    return call


_MATH = SimpleNamespace(
    inf=math.inf,
    nan=math.nan,
    pi=math.pi,
    isfinite=math.isfinite,
    **{name: _quiet(getattr(math, name)) for name in ("sqrt", "sin", "cos", "tan", "atan2")},
)

_made: dict[Any, FunctionType] = {}
_lock = RLock()

_BUILTINS = {"__builtins__": {**vars(builtins), "float": np.float64}}
