"""A real browser draws the page."""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image

from cinegen.show import Page, Scene

CHROMIUM = shutil.which("chromium")
FLAGS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update"),
    *("--disable-sync", "--window-size=900,600"),
]

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="NO CHROMIUM: the page is not tested in a real browser"),
]


def _picture(url, folder):
    picture = folder / "page.png"
    subprocess.run(
        [
            CHROMIUM,
            *FLAGS,
            f"--user-data-dir={folder / 'profile'}",
            "--virtual-time-budget=8000",
            f"--screenshot={picture}",
            url,
        ],
        check=True,
        capture_output=True,
        timeout=120,
    )
    return np.asarray(Image.open(picture).convert("RGB")).astype(int)


def _drawn(picture):
    """How much of the picture has colour: neither sky nor grid."""
    return float(np.mean(picture.max(axis=2) - picture.min(axis=2) > 60))


@pytest.mark.parametrize("name", ["delta4", "gough", "tssm"])
def test_the_static_page_shows_the_robot_well_in_view(robot, tmp_path, name):
    page = Page()
    Scene(page, {name: robot(name)})
    (tmp_path / "page.html").write_text(page.html())
    picture = _picture((tmp_path / "page.html").as_uri(), tmp_path)
    assert 0.002 < _drawn(picture) < 0.3
    edge = np.concatenate([picture[40:, :5].reshape(-1, 3), picture[40:, -5:].reshape(-1, 3)])
    assert (edge.max(axis=1) - edge.min(axis=1)).max() < 60  # nothing is cut off


def test_the_served_page_shows_the_same(robot, tmp_path):
    page = Page()
    scene = Scene(page, {"delta": robot("delta4")})
    url = page.serve(port=7800)
    first = _picture(url, tmp_path)
    assert _drawn(first) > 0.002
    scene.show("delta", robot("delta4").random_closed(3)[-1])
    assert np.abs(_picture(url, tmp_path) - first).max() > 60  # it has moved
