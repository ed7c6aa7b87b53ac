"""Kernels that no entry keeps on disk, for tests that would compile them: seconds each."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba.core import config

from cinegen.jit.interpreted import interpreted


def quick(kernel: Any) -> Callable[..., Any]:
    """Return a kernel as a Python function, which does what machine code does; `make bounds` tests machine code."""
    if config.BOUNDSCHECK:
        return kernel
    python = interpreted(kernel)

    def call(*arguments: Any, **named: Any) -> Any:
        with np.errstate(all="ignore"):
            return python(*arguments, **named)

    return call
