"""A real browser draws the page."""

import io

import ezdxf
import numpy as np
from PIL import Image

import cinegen
from cinegen.cockpit import Page, RobotScene


def test_converted_graphics_are_seen_in_their_colours(tab, tmp_path, monkeypatch):
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
    shown = tab(tmp_path / "page.html", ready="document.readyState === 'complete'", drawn=True)
    pixels = np.asarray(Image.open(io.BytesIO(shown.screenshot())).convert("RGB")).astype(int)
    red, green, blue = np.moveaxis(pixels, -1, 0)
    assert np.mean((red > green + 80) & (red > blue + 80)) > 0.01
    assert np.mean((blue > green + 80) & (blue > red + 80)) > 0.01
