"""The page's GIFs, read by Pillow."""

from __future__ import annotations

import json
import shutil
import subprocess

import numpy as np
import pytest

NODE = shutil.which("node")
Image = pytest.importorskip("PIL.Image", reason="NO PILLOW: nothing reads the page's GIFs")

pytestmark = pytest.mark.skipif(NODE is None, reason="NO NODE: the page's GIFs are not tested")


def decoded(frames, root, folder, delay=8):
    """The frames of a GIF of frames (count, height, width, 3), as Pillow reads them, and the GIF."""
    count, height, width, _ = frames.shape
    options = {"width": width, "height": height, "delay": delay, "count": count}
    (folder / "frames.json").write_text(json.dumps(options))
    for number, frame in enumerate(frames):
        opaque = np.dstack([frame, np.full((height, width), 255, np.uint8)])
        (folder / f"{number}.rgba").write_bytes(opaque.tobytes())
    subprocess.run([NODE, "--no-warnings", root / "tests" / "javascript" / "write_gif.js", folder], check=True)
    gif = Image.open(folder / "out.gif")
    read = []
    for number in range(gif.n_frames):
        gif.seek(number)
        assert gif.info["duration"] == 10 * delay
        read.append(np.asarray(gif.convert("RGB")))
    return np.array(read), gif


def test_few_colours_come_back_as_they_are_and_what_does_not_change_costs_little(root, tmp_path):
    random = np.random.default_rng(3)
    colours = random.integers(0, 256, (200, 3), dtype=np.uint8)
    colours = colours[np.unique(colours >> 3, axis=0, return_index=True)[1]]  # the encoder tells them apart
    background = colours[random.integers(0, len(colours), (90, 120))]
    frames = np.repeat(background[None], 6, axis=0)
    for number in range(6):
        frames[number, 20:40, 10 * number : 10 * number + 20] = colours[0]
    read, gif = decoded(frames, root, tmp_path)
    assert np.array_equal(read, frames)
    assert gif.info["loop"] == 0
    assert (tmp_path / "out.gif").stat().st_size < 2.5 * 90 * 120


def test_many_colours_come_back_nearly(root, tmp_path):
    """Gradients, as of shaded parts, and noise: the worst case for the compression."""
    y, x = np.mgrid[0:200, 0:260]
    gradient = np.dstack([x * 255 // 259, y * 255 // 199, (x + y) // 2]).astype(np.uint8)
    noise = np.random.default_rng(5).integers(0, 256, gradient.shape, dtype=np.uint8)
    read, _ = decoded(np.array([gradient, noise, gradient]), root, tmp_path)
    error = np.abs(read.astype(int) - np.array([gradient, noise, gradient]).astype(int))
    assert error[0].mean() < 8.0
    assert error[2].mean() < 8.0
    assert error[1].mean() < 25.0
    assert len(read) == 3


def test_a_single_pixel_and_frames_without_any_change(root, tmp_path):
    frames = np.full((3, 1, 1, 3), 77, np.uint8)
    read, _ = decoded(frames, root, tmp_path)
    assert np.array_equal(read[0], frames[0])
