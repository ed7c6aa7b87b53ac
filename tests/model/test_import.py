"""`import cinegen` loads no more than a first robot needs."""

from __future__ import annotations

import subprocess
import sys

SLOW = [
    "trimesh",
    "yourdfpy",
    "networkx",
    "scipy.linalg",
    "scipy.optimize",
    "matplotlib",
    "mujoco",
    "tornado",
    "dask",
    "distributed",
    "xarray",
]


def test_import_leaves_slow_packages_alone():
    code = "import sys, cinegen; print(*(name for name in sys.argv[1:] if name in sys.modules))"
    found = subprocess.run([sys.executable, "-c", code, *SLOW], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []
