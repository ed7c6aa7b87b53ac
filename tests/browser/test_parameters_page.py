"""The page with six sliders: what it shows is Kleinfinger's transform, as Python computes it; keys alone suffice."""

from __future__ import annotations

import importlib.util
import math
import re

import numpy as np
import pytest
from tabs import IN_BROWSER

from raff2urdf.raff.kleinfinger import Kleinfinger, transform

NAMES = ("gamma", "epsilon", "alpha", "d", "theta", "r")
PATTERN = re.compile(r"(\w+) (-?\d+)")

pytestmark = IN_BROWSER


@pytest.fixture(scope="module")
def file(root, tmp_path_factory):
    spec = importlib.util.spec_from_file_location("build_site", root / "docs/site/build.py")
    builder = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(builder)
    folder = tmp_path_factory.mktemp("site")
    builder.Site(folder).parameters()
    return folder / "extra/live/six_parameters.html"


@pytest.fixture
def page(tab, file):
    return tab(file, ready="true", viewport={"width": 800, "height": 900})


def put(page, values):
    for name, value in zip(NAMES, values, strict=True):
        page.locator(f"#{name}").fill(str(value))


def matrix(values):
    """Python's transform, lengths in mm."""
    gamma, epsilon, alpha, d, theta, r = values
    return transform(Kleinfinger(math.radians(gamma), epsilon, math.radians(alpha), d, math.radians(theta), r))


def shown(page):
    cells = page.locator("table td").all_inner_texts()
    return np.array([float(cell.replace("−", "-")) for cell in cells]).reshape(4, 4)


def test_the_matrix_is_that_of_python(page):
    random = np.random.default_rng(7)
    for _ in range(8):
        values = [int(random.integers(-180, 181)) if k % 2 == 0 else int(random.integers(-200, 201)) for k in range(6)]
        put(page, values)
        off = np.abs(shown(page) - matrix(values))
        assert off[:3, :3].max() <= 0.5001e-4  # four decimals are shown
        assert off[:3, 3].max() <= 0.5001e-2  # two
        assert (off[3] == 0.0).all()
        text = page.locator("#raff").inner_text()
        written = {
            name: int(value) for name, value in PATTERN.findall(text.partition("{ parameters {")[2].partition("}")[0])
        }
        assert written == {name: value for name, value in zip(NAMES, values, strict=True) if value}


def test_the_frames_are_drawn_where_python_has_them(page):
    """Their pixels are one projection of Python's origins, which are not on a plane: 8 numbers for 2 x 4 x 3."""
    drawn, origins, directions = [], [], []
    for values in ([40, 120, -50, 180, 60, 110], [-70, 60, 110, -120, -150, -90], [10, -150, 80, 100, 0, 190]):
        put(page, values)
        circles = page.locator("circle[data-frame]")
        pixels = circles.evaluate_all("all => all.map((one) => [one.getAttribute('cx'), one.getAttribute('cy')])")
        assert circles.evaluate_all("all => all.map((one) => one.dataset.frame)") == ["F0", "F1", "F2", "F3"]
        steps = (values[:2] + 4 * [0], values[:4] + 2 * [0], values)
        points = np.array([np.zeros(3), *(matrix(step)[:3, 3] for step in steps)])
        relative = np.array(pixels, dtype=float)
        origins.append(points[1:] - points[0])
        drawn.append(relative[1:] - relative[0])
        directions.append(page.locator("#picture").evaluate("svg => [svg.dataset.azimuth, svg.dataset.elevation]"))
    azimuth, elevation = np.radians(np.array(directions[0], dtype=float))
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    eye = np.array(
        [math.cos(azimuth) * math.cos(elevation), math.sin(azimuth) * math.cos(elevation), math.sin(elevation)]
    )
    for points, pixels in zip(origins, drawn, strict=True):
        flat = np.column_stack([points @ right, -points @ np.cross(eye, right)])
        scale = np.linalg.norm(pixels) / np.linalg.norm(flat)
        assert 0.2 < scale < 1.1
        assert np.abs(pixels - scale * flat).max() < 0.02
