"""Kernels that can be called at once: Python functions, until another process has compiled them.

On a machine that has never compiled a kernel, `start` returns the kernel as a Python function (see `interpreted`), and
starts a process that compiles all kernels, the one of a tick first. Their machine code is loaded by a thread, and takes
over between two calls. Both compute the same, so that nothing jumps.
"""

from __future__ import annotations

import logging
import multiprocessing
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numba import types

from cinegen.jit.compiled import is_cached, prepare
from cinegen.jit.interpreted import interpreted
from cinegen.jit.memory import Memory, memory_at

COMPILER = "cinegen.kernels"
"""The module that compiles all kernels, and prints a line after each: how many are done, and how many there are."""

Declared: TypeAlias = types.Type | type[Memory]


def start(function: Callable[..., Any], *arguments: Declared, install: Callable[[Callable[..., Any]], None]) -> Any:
    """Return a kernel for Python to call, compiled or not.

    Args:
        function: an `entry`.
        arguments: types of its arguments; memories are passed as their handles.
        install: is called with the machine code, in a later call of what was returned, if that is interpreted.
    """
    if is_cached(function, *arguments):
        return prepare(function, *arguments)
    return InterpretedKernel(function, arguments, install)


class InterpretedKernel:
    """A kernel that is interpreted until its machine code is loaded."""

    def __init__(
        self, function: Any, arguments: tuple[Declared, ...], install: Callable[[Callable[..., Any]], None]
    ) -> None:
        self.function, self.arguments = function, arguments
        self.machine_code: Callable[..., Any] | None = None
        self._install = install
        self._python = interpreted(function)
        self._is_memory = [isinstance(argument, type) for argument in arguments]
        COMPILATION.add(self)

    def __call__(self, *arguments: Any) -> Any:
        """Run the kernel; pass its machine code on if that is loaded by now."""
        if self.machine_code is not None:
            self._install(self.machine_code)
            return self.machine_code(*arguments)
        pairs = zip(arguments, self._is_memory, strict=True)
        with np.errstate(all="ignore"):
            return self._python(*(memory_at(value) if is_memory else value for value, is_memory in pairs))


class Compilation:
    """The process that compiles the kernels for this one, and the thread that loads them.

    Attributes:
        done: how many kernels are compiled; None if no process was started.
        count: how many there are, 0 until that is known.
        error: why the process failed; "" unless it did. Kernels stay interpreted then.
    """

    def __init__(self) -> None:
        self.done: int | None = None
        self.count = 0
        self.error = ""
        self._waiting: list[InterpretedKernel] = []
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None

    @property
    def fraction(self) -> float:
        """Fraction of the kernels that are compiled, 0 to 1."""
        return (self.done or 0) / self.count if self.count else 0.0

    @property
    def is_running(self) -> bool:
        """True while kernels are being compiled."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def is_awaited(self) -> bool:
        """True while kernels of this process are interpreted until their machine code is loaded."""
        return bool(self._waiting)

    def add(self, kernel: InterpretedKernel) -> None:
        """Load a kernel as soon as it is compiled; start the process if there is none."""
        with self._lock:
            self._waiting.append(kernel)
            if self._thread is None:
                if multiprocessing.parent_process() is None:
                    logging.getLogger("cinegen").warning(
                        "compiling kernels, once, in the background: until then Python computes, some hundred times "
                        "slower (`cinegen compile` does it ahead of time)"
                    )
                self.done = 0
                self._thread = threading.Thread(target=self._run, name="compilation of kernels", daemon=True)
                self._thread.start()

    def wait(self) -> None:
        """Wait until all kernels are compiled and loaded."""
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        # in a session of its own: it goes on if this process ends, so that the next one finds the kernels
        command = [sys.executable, "-m", COMPILER]
        with (
            tempfile.TemporaryFile("w+", encoding="utf-8") as errors,
            subprocess.Popen(
                command,
                text=True,
                start_new_session=True,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=errors,
            ) as process,
        ):
            assert process.stdout is not None
            for line in process.stdout:
                self.done, self.count = map(int, line.split())
                self._load()
            errors.seek(0)
            self.error = errors.read().strip()
        self._load()
        if process.returncode:
            reason = self.error.rpartition("\n")[2] or f"exit code {process.returncode}"
            logging.getLogger("cinegen").warning("kernels were not compiled, Python computes: %s", reason)

    def _load(self) -> None:
        with self._lock:
            ready = [kernel for kernel in self._waiting if is_cached(kernel.function, *kernel.arguments)]
        for kernel in ready:
            kernel.machine_code = prepare(kernel.function, *kernel.arguments)
        with self._lock:
            self._waiting = [kernel for kernel in self._waiting if kernel.machine_code is None]


COMPILATION = Compilation()
