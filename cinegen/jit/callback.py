"""Calls from kernels to Python: slow (about 10 us), so for what kernels cannot compute."""

from __future__ import annotations

import ctypes
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

CALLBACK = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 4)
"""Wrap a Python function (operation, first, second, third) -> None for kernels. The last three are addresses of arrays.
It must not raise, and lives as long as this object."""


def address_of(callback: Any) -> int:
    """Return the address of a `CALLBACK`."""
    return int(ctypes.cast(callback, ctypes.c_void_p).value or 0)


@intrinsic  # type: ignore[untyped-decorator]
def call_python(_typing: Any, _address: Any, _operation: Any, first: Any, second: Any, third: Any) -> Any:
    """For kernels: call the `CALLBACK` at an address with an operation and three arrays. It takes Python's lock."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        function = builder.inttoptr(arguments[0], ir.FunctionType(ir.VoidType(), [word] * 4).as_pointer())
        views = zip(signature.args[2:], arguments[2:], strict=True)
        pointers = [
            builder.ptrtoint(context.make_array(kind)(context, builder, view).data, word) for kind, view in views
        ]
        builder.call(function, [arguments[1], *pointers])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, first, second, third), generate


def _call(address: int, operation: int, *arrays: Any) -> None:
    CALLBACK(address)(operation, *[array.ctypes.data for array in arrays])


call_python.in_python = _call
