"""Writes figures as the small pictures that pages of this documentation show."""

import io
import sys
from pathlib import Path

from PIL import Image

PICTURES = Path(__file__).resolve().parent
ROBOTS = PICTURES.parent.parent / "robots"
LARGEST = 250_000  # bytes


def write(figures):
    """Draw those that the command line names, or all: functions that make a matplotlib figure, by name."""
    for name in sys.argv[1:] or figures:
        save(name, figures[name]())


def save(name, figure):
    """Write a matplotlib figure as a picture of few colours."""
    drawn, path = io.BytesIO(), PICTURES / f"{name}.png"
    figure.savefig(drawn, format="png", dpi=110)
    with Image.open(drawn) as image:
        few = image.convert("RGB").quantize(160, Image.Quantize.MEDIANCUT, kmeans=3, dither=Image.Dither.NONE)
        few.save(path, optimize=True)
    assert path.stat().st_size < LARGEST, path
