"""Writes figures as the small pictures that pages of this documentation show."""

import io
import sys
from pathlib import Path

from PIL import Image
from PIL.PngImagePlugin import PngInfo

PICTURES = Path(__file__).resolve().parent
ROBOTS = PICTURES.parent.parent / "robots"
LARGEST = 250_000  # bytes
_DESCRIPTION = 0x010E  # a tag of Exif


def write(figures):
    """Draw those that the command line names, or all: functions that make a matplotlib figure, by name."""
    for name in sys.argv[1:] or figures:
        save(name, figures[name]())


def exif(text):
    """Return Exif with a description."""
    found = Image.Exif()
    found[_DESCRIPTION] = text
    return found


def save(name, figure, description=""):
    """Write a matplotlib figure as a picture of few colours."""
    drawn, path = io.BytesIO(), PICTURES / f"{name}.png"
    figure.savefig(drawn, format="png", dpi=110)
    with Image.open(drawn) as image:
        few = image.convert("RGB").quantize(160, Image.Quantize.MEDIANCUT, kmeans=3, dither=Image.Dither.NONE)
        info = PngInfo()
        if description:
            info.add_text("Description", description)
        few.save(path, optimize=True, pnginfo=info)
    assert path.stat().st_size < LARGEST, path
