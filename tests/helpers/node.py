"""Node, and the package `three` that the page's session imports there; a page has its own copy."""

import shutil
from pathlib import Path

import pytest

NODE = shutil.which("node")

needs_three = pytest.mark.skipif(
    NODE is None or not (Path(__file__).resolve().parents[2] / "node_modules" / "three").is_dir(),
    reason="NO NODE, or no three in node_modules: the page's session is not tested; `make javascript` installs it",
)
