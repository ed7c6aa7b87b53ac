"""Compile kernels, and cache their machine code on disk."""

from __future__ import annotations

import hashlib
import logging
import re
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, TypeVar, cast, get_type_hints

from filelock import FileLock
from numba import njit, types
from numba.core.registry import cpu_target

from cinegen.arrays import Array as Array  # kernels take it with their decorators
from cinegen.arrays import Integers
from cinegen.jit.memory import Memory
from cinegen.jit.private_cache import check_private
from cinegen.jit.whole_program import whole_program

Table = Integers
TABLE = types.int64[::1]
"""Numba's type of an array of integers."""

Function = TypeVar("Function", bound=Callable[..., Any])

_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    "_nrt": False,  # nothing is allocated, so nothing is counted
    "forceinline": False,  # unless it is given: what is called would inherit it
}


_IMPORTED = re.compile(r"^from (cinegen[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)

_ENTRIES: list[str] = []
_HELPERS: list[Any] = []


def compiled(function: Function) -> Function:
    """Compile a function at its first call, for other kernels to call; it runs without the GIL and allocates nothing.

    A division by zero gives infinity, as numpy's does: no kernel raises. Multiplication and addition may be fused.
    """
    return _helper(function, _OPTIONS)


def inlined(function: Function) -> Function:
    """Compile a function as `compiled` does, and put its code wherever it is called: a part of one that is called
    often, which has a name of its own."""
    return _helper(function, {**_OPTIONS, "forceinline": True})


def _helper(function: Function, options: dict[str, Any]) -> Function:
    dispatcher = njit(**options)(function)
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
        getattr(declared.get(name), "numba_type", argument) for name, argument in zip(names, arguments, strict=False)
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


def _stamp(source: Path) -> str:
    """Return a digest of a kernel's file and of all that it may inline."""
    digest = hashlib.sha256()
    for path in sorted(_stamp_files(source)):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _stamp_files(source: Path) -> set[Path]:
    """Return a kernel's file and all files of the package that it imports, directly or through others."""
    root = Path(__file__).parents[2]
    taken, left = set[Path](), [source]
    while left:
        path = left.pop()
        if path not in taken:
            taken.add(path)
            for package, names in _IMPORTED.findall(path.read_text()):
                folder = root.joinpath(*package.split("."))
                modules = [folder, *(folder / name for name in re.findall(r"\w+", names))]
                left += [file for module in modules if (file := module.with_suffix(".py")).exists()]
    return taken


def prepare(function: Callable[..., Any], *arguments: types.Type | type[Memory]) -> Callable[..., Any]:
    """Compile an `entry` for arguments of these types, or load it from disk.

    While another process compiles a kernel of the same folder, it waits.

    Returns:
        the machine code as a function that takes a memory's `handle`. It skips numba's dispatch on argument types.

    Raises:
        CinegenError: other users may write the cache.
    """
    kernel: Any = function
    signature = _signature(arguments)
    if signature not in kernel.overloads:
        if is_cached(function, *arguments):
            kernel.compile(signature)
        else:
            with _one_at_a_time(kernel):
                if not is_cached(function, *arguments):
                    logging.getLogger("cinegen").warning("compiling %s, once: this takes a while ...", kernel.__name__)
                kernel.compile(signature)
    return cast(Callable[..., Any], kernel.overloads[signature].entry_point)


def is_cached(function: Callable[..., Any], *arguments: types.Type | type[Memory]) -> bool:
    """Return whether the machine code is on disk; True if it can't be written: no other process can compile it.

    Raises:
        CinegenError: other users may write the cache.
    """
    cache: Any = getattr(function, "_cache", None)
    if getattr(cache, "_cache_file", None) is None:
        return True
    source = Path(function.__code__.co_filename)
    for path in (cache.cache_path, getattr(cache._cache_file, "_index_path", cache.cache_path)):
        check_private(Path(path), source)
    try:
        key = cache._index_key(_signature(arguments), cpu_target.target_context.codegen())
        name = cache._cache_file._load_index().get(key)
        data = None if name is None else Path(cache._cache_file._data_path(name))
    except (AttributeError, OSError, ValueError):  # another numba: it knows better
        return True
    if data is not None:
        check_private(data, source)
    return data is not None and data.exists()


def _signature(arguments: Sequence[types.Type | type[Memory]]) -> tuple[types.Type, ...]:
    return tuple(getattr(argument, "numba_type", argument) for argument in arguments)


def _one_at_a_time(kernel: Any) -> AbstractContextManager[Any]:
    """Return a lock that one process at a time holds while it compiles a kernel of this kernel's folder."""
    cache: Any = getattr(kernel, "_cache", None)
    if getattr(cache, "_cache_file", None) is None:
        return nullcontext()
    folder = Path(cache.cache_path)
    folder.mkdir(parents=True, exist_ok=True)
    return FileLock(folder / "compiling.lock", is_singleton=True)
