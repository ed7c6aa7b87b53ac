"""Draws docs/pictures/hero.webp again, the moving picture of the README: `python docs/pictures/hero.py`.

Three robots follow a circle, each in a film of `cinegen drive --video`. Needs what `pip install "cinegen[film]"`
brings, chromium on PATH, and Pillow.
"""

import subprocess
import sys
import tempfile

from figures import PICTURES, ROBOTS
from PIL import Image

NAMES = "delta4", "gough", "sr400"
FILMED, SIZE, CROP = "480x440", (300, 275), (0, 35, 300, 245)  # pixels: of the film, of one robot, and its part
BEGIN, END, EVERY = 46, 226, 2  # frames, 30 per second: one revolution, after the path has grown
LARGEST = 1_000_000  # bytes


def main():
    """Film the robots and join the films."""
    with tempfile.TemporaryDirectory() as folder:
        for name in NAMES:
            command = [sys.executable, "-m", "cinegen", "drive", ROBOTS / f"{name}.raff", "--seconds", "7.5"]
            subprocess.run([*command, "--video", f"{folder}/{name}", "--size", FILMED], check=True)
        frames = []
        for number in range(BEGIN, END, EVERY):
            frame = Image.new("RGB", ((CROP[2] - CROP[0]) * len(NAMES), CROP[3] - CROP[1]))
            for k, name in enumerate(NAMES):
                with Image.open(f"{folder}/{name}/{number:05d}.png") as image:
                    part = image.convert("RGB").resize(SIZE, Image.Resampling.LANCZOS).crop(CROP)
                frame.paste(part, (k * (CROP[2] - CROP[0]), 0))
            frames.append(frame)
    path = PICTURES / "hero.webp"
    options = {"duration": 1000 * EVERY // 30, "loop": 0, "quality": 75, "method": 6}
    frames[0].save(path, save_all=True, append_images=frames[1:], **options)
    assert path.stat().st_size < LARGEST, path


if __name__ == "__main__":
    main()
