"""`cinegen compile`: machine code ahead of time."""

from __future__ import annotations

from cinegen.cli.progress import Progress


def run() -> int:
    """Compile the kernels ahead of time.

    Kernels are what solvers compute with. They are compiled once, at the first use, in the background; until then
    Python computes, some hundred times slower. After this command they are there from the start.
    """
    from cinegen.kernels import compile_kernels

    with Progress() as progress:
        for name, done, count in compile_kernels():
            progress.steps(f"compiling '{name}'", done, count)
    print("all kernels are compiled")
    return 0
