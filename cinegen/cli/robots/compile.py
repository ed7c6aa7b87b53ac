"""`cinegen compile`: machine code ahead of time."""

from __future__ import annotations

from cinegen.cli.progress import Progress
from cinegen.errors import CinegenError


def run() -> int:
    """Compile the kernels ahead of time.

    Kernels are what solvers compute with. They are compiled once, at the first use, in the background; until then
    Python computes, some hundred times slower. After this command they are there from the start.
    """
    from cinegen.kernels import compile_kernels

    try:
        with Progress() as progress:
            for name, done, count in compile_kernels():
                progress.steps(f"compiling '{name}'", done, count)
    except OSError as error:
        raise CinegenError(
            f"the compiled kernels can't be written: {error.strerror}: free some space, or name another folder by the "
            "environment variable NUMBA_CACHE_DIR"
        ) from None
    print("all kernels are compiled")
    return 0
