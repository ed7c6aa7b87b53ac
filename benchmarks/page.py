"""Random drags in the session of a page without a server: does anything fail, and what does a frame cost?

    python benchmarks/page.py [DRAGS] [ROBOT ...]

Each drag takes a random node, pulls it up to a characteristic length or 4 m away for three frames of four ticks, and
lets go. Printed: the largest gap of the loops after any tick, and the time of a frame (ticks, states and every sixth
time a report) in node, without drawing.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import cinegen
from cinegen.page.build import RATE, content_of
from cinegen.page.kernels_module import module
from cinegen.session import Setup

ROOT = Path(__file__).resolve().parents[1]


def main(drags: int = 100_000, *names: str) -> None:
    node = shutil.which("node")
    if node is None:
        sys.exit("node is not installed")
    for name in names or ("gough", "delta4", "five_bar", "arm7"):
        mechanism = cinegen.load(ROOT / "robots" / f"{name}.raff")
        content = content_of(Setup({name: mechanism}, rate=RATE), "")
        with tempfile.TemporaryDirectory() as folder:
            kernels, settings = Path(folder, "kernels.mjs"), Path(folder, "given.json")
            kernels.write_text(module())
            settings.write_text(json.dumps({"content": content, "module": str(kernels), "drags": drags, "seed": 1}))
            command = [node, "--no-warnings", ROOT / "benchmarks" / "page_session.mjs", settings]
            result = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
        frames = f"{result['frames']} frames of {result['mean']:.3f} ms (longest {result['longest']:.1f} ms)"
        print(f"{name}: {drags} drags, {frames}; loops open by {result['worst']:.1e} at most; {result['statuses']}")


if __name__ == "__main__":
    main(*(int(word) if word.isdigit() else word for word in sys.argv[1:]))
