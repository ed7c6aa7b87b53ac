"""Whole-program compilation: machine code is generated for entries only, with the helpers that they call inlined.

Numba optimises each function as a module of its own, with all that it calls linked in, and generates machine code for
it. For a function that only other kernels call, that work is thrown away: the entry links and optimises everything
again. Here, helpers keep their unoptimised code for linking, which is all that an entry needs.

It is worth its lines with numba 0.68.1 (2026-11-29, CPU time; minima of interleaved runs):

- The tick compiles in 48 s instead of 219 s, it and the four other kernels that move a robot in 86 s instead of 322 s.
- A tick takes less time, since helpers are optimised where they are called: panda 5.7 instead of 6.0 microseconds,
  delta4 15.7 instead of 16.6, gough 27.7 instead of 28.7, a biped 24.1 instead of 25.2.
- The machine code on disk has the same size, 4.6 MB.

This reaches into numba's private classes. It is only done for versions it was tested with; for others, `whole_program`
does nothing and compilation is merely slower.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import numba
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext
from numba.core.registry import cpu_target

TESTED = ("0.68",)
"""Versions of numba, without their last number."""

_NEEDED = {
    JITCodeLibrary: ("_optimize_final_module", "_finalize_final_module", "_finalize_dynamic_globals", "_finalized"),
    JITCPUCodegen: ("_library_class", "set_env"),
    CPUContext: ("create_cpython_wrapper", "create_cfunc_wrapper"),
}


class _Library(JITCodeLibrary):  # type: ignore[misc]
    """The code of a function: of an entry as usual; of a helper only what others link."""

    entries: frozenset[str] = frozenset()

    @property
    def is_helper(self) -> bool:
        return self.name not in self.entries

    def _optimize_final_module(self) -> None:
        if not self.is_helper:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        if self.is_helper:
            self._finalize_dynamic_globals()
            self._finalized = True
        else:
            super()._finalize_final_module()


def is_supported() -> bool:
    """Return whether this version of numba is one that was tested, and has what is needed."""
    tested = numba.__version__.rpartition(".")[0] in TESTED
    return tested and all(hasattr(owner, name) for owner, names in _NEEDED.items() for name in names)


@contextmanager
def whole_program(entries: Iterable[str], helpers: Iterable[Any]) -> Iterator[None]:
    """Compile only entries to machine code.

    Helpers that were compiled meanwhile are forgotten at the end, since Python must not call them: where it does, they
    are compiled again, as usual.

    Args:
        entries: their names, as `__qualname__` has them.
        helpers: numba's dispatchers of all other kernels.
    """
    from unittest.mock import patch  # brings asyncio

    with ExitStack() as stack:
        stack.enter_context(global_compiler_lock)
        codegen = cpu_target.target_context.codegen()
        if not is_supported() or codegen._library_class is _Library:  # nested
            yield
            return
        helpers = list(helpers)
        known = [set(helper.overloads) for helper in helpers]
        collecting = gc.isenabled()
        stack.enter_context(patch.object(codegen, "_library_class", _Library))
        stack.enter_context(patch.object(_Library, "entries", frozenset(entries)))
        stack.enter_context(patch.object(JITCPUCodegen, "set_env", _set_env(JITCPUCodegen.set_env)))
        for name in ("create_cpython_wrapper", "create_cfunc_wrapper"):
            stack.enter_context(patch.object(CPUContext, name, _wrapper(getattr(CPUContext, name))))
        gc.disable()  # saves a tenth of the time; what numba builds stays referenced anyway
        try:
            yield
        finally:
            if collecting:
                gc.enable()
            for helper, before in zip(helpers, known, strict=True):
                if set(helper.overloads) - before:
                    helper._make_finalizer()()
                    helper._reset_overloads()


def _wrapper(create: Callable[..., None]) -> Callable[..., None]:
    """Return what creates a function's wrapper for Python or C, unless the function is a helper."""

    def create_unless_helper(context: Any, library: Any, *arguments: Any, **options: Any) -> None:
        if not getattr(library, "is_helper", False):
            create(context, library, *arguments, **options)

    return create_unless_helper


def _set_env(set_env: Callable[[Any, str, Any], None]) -> Callable[[Any, str, Any], None]:
    """Return what sets a function's environment, unless it has no machine code."""

    def set_if_defined(codegen: Any, name: str, env: Any) -> None:
        if codegen._engine.is_symbol_defined(name):
            set_env(codegen, name, env)

    return set_if_defined
