"""Node, and the package `three` that the page's session imports there; a page has its own copy."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from cinegen.page.kernels_module import module

NODE = shutil.which("node")

needs_three = pytest.mark.skipif(
    NODE is None or not (Path(__file__).resolve().parents[2] / "node_modules" / "three").is_dir(),
    reason="NO NODE, or no three in node_modules: the page's session is not tested; `make javascript` installs it",
)


def run(name, folder, **inputs):
    """What a script of tests/javascript prints for the page's kernels and what else is given."""
    (folder / "kernels.mjs").write_text(module())
    (folder / "given.json").write_text(json.dumps({"module": str(folder / "kernels.mjs"), **inputs}))
    path = Path(__file__).parents[1] / "javascript" / name
    command = [NODE, "--no-warnings", path, folder / "given.json"]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
