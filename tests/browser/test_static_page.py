"""A real browser draws the page."""

from __future__ import annotations

import shutil
import subprocess

import ezdxf
import numpy as np
import pytest
from PIL import Image
from variants import slow

import cinegen
from cinegen.cockpit import Page, RobotScene

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


@pytest.mark.parametrize("name", ["delta4", *slow("gough", "tssm")])
def test_the_static_page_shows_the_robot_well_in_view(robot, tmp_path, name):
    page = Page()
    RobotScene(page, {name: robot(name)})
    (tmp_path / "page.html").write_text(page.html())
    picture = _picture((tmp_path / "page.html").as_uri(), tmp_path)
    assert 0.002 < _drawn(picture) < 0.3
    edge = np.concatenate([picture[40:, :5].reshape(-1, 3), picture[40:, -5:].reshape(-1, 3)])
    assert (edge.max(axis=1) - edge.min(axis=1)).max() < 60  # nothing is cut off


def test_converted_graphics_are_seen_in_their_colours(tmp_path, monkeypatch):
    """A red wall of NFF and a blue one of DXF."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    wall = "nff\nwall\n4\n200 -99 -99\n200 99 -99\n200 99 99\n200 -99 99\n1\n4 0 1 2 3 0xf00 both\n"
    (tmp_path / "wall.nff").write_text(wall)
    drawing = ezdxf.new()
    corners = [(-200, -99, -99), (-200, 99, -99), (-200, 99, 99), (-200, -99, 99)]
    drawing.modelspace().add_3dface(corners, dxfattribs={"color": 5})
    drawing.saveas(tmp_path / "wall.dxf")
    (tmp_path / "walls.raff").write_text('RAFF walls robot r { base { filename { "wall.nff" "wall.dxf" } } }')
    page = Page()
    RobotScene(page, {"walls": cinegen.load(tmp_path / "walls.raff")})
    (tmp_path / "page.html").write_text(page.html())
    red, green, blue = np.moveaxis(_picture((tmp_path / "page.html").as_uri(), tmp_path), -1, 0)
    assert np.mean((red > green + 80) & (red > blue + 80)) > 0.01
    assert np.mean((blue > green + 80) & (blue > red + 80)) > 0.01
