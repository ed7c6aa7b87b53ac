"""Compile kernels, and cache their machine code on disk."""

from __future__ import annotations

import hashlib
import logging
import re
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, TypeVar, cast, get_type_hints

import numpy as np
from numba import njit, types
from numpy.typing import NDArray

from cinegen.jit.memory import Memory
from cinegen.jit.whole_program import whole_program

Array = NDArray[np.float64]
Table = NDArray[np.int64]
TABLE = types.int64[::1]
"""Numba's type of an array of integers."""

Function = TypeVar("Function", bound=Callable[..., Any])

_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    "_nrt": False,  # nothing is allocated, so nothing is counted
}


_IMPORTED = re.compile(r"^from ((?:cinegen|raff2urdf)\.[\w.]+) import", re.MULTILINE)

_ENTRIES: list[str] = []
_HELPERS: list[Any] = []


def compiled(function: Function) -> Function:
    """Compile a function at its first call, for other kernels to call; it runs without the GIL and allocates nothing.

    A division by zero gives infinity, as numpy's does: no kernel raises. Multiplication and addition may be fused.
    """
    dispatcher = njit(**_OPTIONS)(function)
    find_call_template = dispatcher.get_call_template

    def get_call_template(arguments: Any, keywords: Any) -> Any:
        return find_call_template(_as_declared(function, arguments), keywords)

    dispatcher.get_call_template = get_call_template
    _HELPERS.append(dispatcher)
    return cast(Function, dispatcher)


def _as_declared(function: Callable[..., Any], arguments: Sequence[types.Type]) -> tuple[types.Type, ...]:
    """Return the types of a call's arguments, memories replaced by the declarations in the function's annotations: it
    is compiled once for these, and not again for each subclass."""
    declared = get_type_hints(function)
    names = function.__code__.co_varnames
    return tuple(
        getattr(declared.get(name), "numba_type", given) for name, given in zip(names, arguments, strict=False)
    )


def entry(function: Function) -> Function:
    """Compile a function as `compiled` does, for Python to call; its machine code is cached on disk."""
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
    # Functions of other files are inlined: the cached code is out of date when any of these files has changed.
    kept = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if kept is not None and hasattr(kept, "_source_stamp"):
        kept._source_stamp = _stamp(Path(function.__code__.co_filename))
    return cast(Function, dispatcher)


def together() -> AbstractContextManager[None]:
    """Return a context in which several entries are prepared; the helpers that they share are compiled only once.

    No kernel may be called in it.
    """
    return whole_program(_ENTRIES, _HELPERS)


def _stamp(own: Path) -> str:
    """Return a digest of a kernel's file and of all files it may inline: those that it imports, and all of jit."""
    here, root = Path(__file__).parent, Path(__file__).parents[2]
    taken, left = set(here.glob("*.py")), [own]
    while left:
        path = left.pop()
        if path not in taken:
            taken.add(path)
            for module in _IMPORTED.findall(path.read_text()):
                left += [file for file in [root.joinpath(*module.split(".")).with_suffix(".py")] if file.exists()]
    digest = hashlib.sha256()
    for path in sorted(taken):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def prepare(function: Callable[..., Any], *arguments: types.Type | type[Memory]) -> Callable[..., Any]:
    """Compile an `entry` for arguments of these types, or load it from disk.

    Returns:
        the machine code as a function that takes a memory's `handle`. It skips numba's dispatch on argument types.
    """
    kernel: Any = function
    signature = tuple(getattr(argument, "numba_type", argument) for argument in arguments)
    if signature not in kernel.overloads:
        if not _is_kept(kernel):
            logging.getLogger("cinegen").warning("compiling %s, once: this takes a while ...", kernel.__name__)
        kernel.compile(signature)
    return cast(Callable[..., Any], kernel.overloads[signature].entry_point)


def _is_kept(function: Any) -> bool:
    """Return whether a function's machine code is cached on disk; True if that can't be known."""
    kept = getattr(getattr(function, "_cache", None), "_cache_file", None)
    try:
        return kept is None or bool(kept._load_index())
    except (AttributeError, OSError, ValueError):
        return True
