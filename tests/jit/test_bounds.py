"""Kernels with bounds checking: run by `make bounds`, which runs the kernels' tests first."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest
from numba.core import config

from cinegen.ik._kernels.local_ik import nearest_start

ROOT = Path(__file__).resolve().parents[2]
ENTRY = re.compile(r"^@entry\ndef (\w+)", re.MULTILINE)

pytestmark = pytest.mark.skipif(not config.BOUNDSCHECK, reason="make bounds runs it")


def test_a_kernel_that_reads_out_of_bounds_raises():
    features, used = np.zeros((3, 4)), np.zeros(3)
    assert nearest_start(features, np.zeros(4), used) == 0
    with pytest.raises(IndexError):
        nearest_start(features, np.zeros(3), used)
    with pytest.raises(IndexError):
        nearest_start(features, np.zeros(4), used[:2])


def test_every_entry_was_compiled_with_bounds_checking():
    kept = {path.name.split("-")[0] for path in Path(os.environ["NUMBA_CACHE_DIR"]).rglob("*.nbi")}
    entries = {
        f"{path.stem}.{name}" for path in (ROOT / "cinegen").rglob("*.py") for name in ENTRY.findall(path.read_text())
    }
    assert len(entries) > 10
    assert not entries - kept
