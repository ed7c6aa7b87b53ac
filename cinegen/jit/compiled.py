"""How the kernels are compiled, and how they see memory that Pinocchio owns."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array
from numpy.typing import NDArray

from cinegen.jit.whole_program import whole_program

Array = NDArray[np.float64]
Table = NDArray[np.int64]
TABLE = types.int64[::1]
"""Numba's type of a table."""

Function = TypeVar("Function", bound=Callable[..., Any])

_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    "_nrt": False,  # nothing is allocated, so nothing is counted
}


_ENTRIES: list[str] = []
_HELPERS: list[Any] = []


def compiled(function: Function) -> Function:
    """Compiles at the first call, for other kernels to call; runs without Python's lock and allocates nothing.

    A division by zero gives infinity, as numpy's does: no kernel raises. Multiplication and addition may be fused.
    """
    dispatcher = njit(**_OPTIONS)(function)
    _HELPERS.append(dispatcher)
    return cast(Function, dispatcher)


def entry(function: Function) -> Function:
    """As `compiled`, for Python to call: compiled once for all processes, what comes of it is kept on disk."""
    try:
        dispatcher = njit(cache=True, **_OPTIONS)(function)
    except RuntimeError:  # nowhere to write
        dispatcher = njit(**_OPTIONS)(function)
    _ENTRIES.append(function.__qualname__)
    compile_entry = dispatcher.compile

    def compile_with_helpers(signature: Any) -> Any:
        with together():
            return compile_entry(signature)

    dispatcher.compile = compile_with_helpers
    # What is kept is inlined from other files too: it is out of date when any of them has changed.
    kept = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if kept is not None and hasattr(kept, "_source_stamp"):
        kept._source_stamp = _stamp(Path(function.__code__.co_filename))
    return cast(Function, dispatcher)


def together() -> AbstractContextManager[None]:
    """Return a context in which entries are prepared that share helpers: these are then compiled only once.

    No kernel may be called in it.
    """
    return whole_program(_ENTRIES, _HELPERS)


def _stamp(own: Path) -> str:
    """Return a digest of a kernel's own file and of all that it may have inlined: the files here, the kernels of loops,
    and those of its own package."""
    here = Path(__file__).parent
    package, loops = here.parent, here.parent / "loops"
    taken = [*here.glob("*.py"), loops / "thresholds.py", *(loops / "_kernels").glob("*.py")]
    if own.is_relative_to(package):
        own_package = package / own.relative_to(package).parts[0]
        taken += [*own_package.rglob("_kernels/*.py"), *own_package.glob("thresholds.py")]
    digest = hashlib.sha256()
    for path in (own, *sorted(taken)):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def prepare(function: Any, *arguments: types.Type) -> None:
    """Compiles an `entry` for arguments of these types, or loads it from disk, so that no tick has to wait for that."""
    if not getattr(function, "signatures", ()):
        if not _is_kept(function):
            logging.getLogger("cinegen").warning("compiling %s, once: this takes a while ...", function.__name__)
        function.compile(arguments)


def _is_kept(function: Any) -> bool:
    """Whether a compiled function's result lies on disk already; True where that can't be known."""
    kept = getattr(getattr(function, "_cache", None), "_cache_file", None)
    try:
        return kept is None or bool(kept._load_index())
    except (AttributeError, OSError, ValueError):
        return True


def _view(dimensions: int) -> Any:
    """An intrinsic (address, *sizes) that returns an array over memory that others own."""

    def typed(_context: Any, address: Any, *sizes: Any) -> Any:
        kind = types.Array(types.float64, dimensions, "C")

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            bytes_each = context.get_constant(types.intp, 8)
            shape, stride = list(arguments[1:]), bytes_each
            strides: list[Any] = []
            for size in reversed(shape):
                strides.insert(0, stride)
                stride = builder.mul(stride, size)
            view = context.make_array(kind)(context, builder)
            data = builder.inttoptr(arguments[0], view.data.type)
            populate_array(view, data=data, shape=shape, strides=strides, itemsize=bytes_each, meminfo=None)
            return view._getvalue()

        return kind(types.int64, *[types.intp] * dimensions), generate

    return typed


@intrinsic  # type: ignore[untyped-decorator]
def vector(context: Any, address: Any, size: Any) -> Any:
    """(size,) doubles at an address."""
    return _view(1)(context, address, size)


@intrinsic  # type: ignore[untyped-decorator]
def matrix(context: Any, address: Any, rows: Any, columns: Any) -> Any:
    """(rows, columns) doubles at an address, row after row."""
    return _view(2)(context, address, rows, columns)


@intrinsic  # type: ignore[untyped-decorator]
def matrices(context: Any, address: Any, count: Any, rows: Any, columns: Any) -> Any:
    """(count, rows, columns) doubles at an address."""
    return _view(3)(context, address, count, rows, columns)
