"""Kernels with bounds checking: run by `make bounds`, which runs the kernels' tests first."""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from numba.core import config

from cinegen.hexapod._kernels.taylor import polish, tracking_scratch

ROOT = Path(__file__).resolve().parents[2]
ENTRY = re.compile(r"^@entry\ndef (\w+)", re.MULTILINE)

pytestmark = pytest.mark.skipif(not config.BOUNDSCHECK, reason="make bounds runs it")


def test_a_kernel_that_reads_out_of_bounds_raises():
    equations, solutions = np.ones((6, 16), dtype=complex), np.ones((2, 8), dtype=complex)
    polish(equations, solutions, np.zeros(2), tracking_scratch())
    with pytest.raises(IndexError):
        polish(equations, solutions, np.zeros(1), tracking_scratch())


def test_every_entry_was_compiled_with_bounds_checking():
    kept = {path.name.split("-")[0] for path in Path(os.environ["NUMBA_CACHE_DIR"]).rglob("*.nbi")}
    entries = {
        f"{path.stem}.{name}" for path in (ROOT / "cinegen").rglob("*.py") for name in ENTRY.findall(path.read_text())
    }
    assert len(entries) > 10
    assert not entries - kept
