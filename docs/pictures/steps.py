"""Draws the pictures of pages that follow the RAFF text above them: `python docs/pictures/steps.py [NAME ...]`.

Those whose text has not changed are left as they are, unless they are named.
"""

import contextlib
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from figures import exif
from joints import DRAWINGS as JOINTS
from raff_sketch import RaffSketch
from sources import DOCS, PAGES, mark_in, sources
from tutorial import DRAWINGS as TUTORIAL

PICTURES = DOCS / "pictures"
DRAWINGS = {**TUTORIAL, **JOINTS}
LARGEST = 60_000  # bytes


def namespace(source):
    """Return what the Python code of a step leaves, run in a folder with its RAFF file."""
    left = {"__name__": "page"}
    with TemporaryDirectory() as folder, contextlib.chdir(folder), open(os.devnull, "w") as nowhere:
        name = "plotter.raff"
        Path(name).write_text(source.raff, encoding="utf-8")
        with contextlib.redirect_stdout(nowhere):
            for block in source.python:
                exec(block, left)
    return left


def draw(source):
    """Write one picture."""
    path = PICTURES / source.picture
    drawn = DRAWINGS[path.stem](RaffSketch(source.raff), namespace(source))
    if path.suffix == ".svg":
        path.write_text(drawn.svg(path.stem, source.mark), encoding="utf-8")
    else:
        drawn.save(path, quality=80, method=6, exif=exif(source.mark))
    assert path.stat().st_size <= LARGEST, path
    print(f"{path.name}: {path.stat().st_size / 1000:.1f} kB")


def main():
    """Draw those that the command line names, or those whose text has changed."""
    named = set(sys.argv[1:])
    for page in PAGES:
        for source in sources((DOCS / page).read_text(encoding="utf-8")):
            path = PICTURES / source.picture
            stale = not path.exists() or mark_in(path.read_bytes()) != source.mark
            if path.stem in named or (not named and stale):
                draw(source)


if __name__ == "__main__":
    main()
