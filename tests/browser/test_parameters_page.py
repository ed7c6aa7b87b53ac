"""The page with six sliders: what it shows is Kleinfinger's transform, as Python computes it; keys alone suffice."""

import math
import re

import numpy as np

from raff2urdf.raff.kleinfinger import Kleinfinger, transform

NAMES = ("gamma", "epsilon", "alpha", "d", "theta", "r")
PATTERN = re.compile(r"(\w+) (-?\d+)")


def shown(page):
    cells = page.locator("table td").all_inner_texts()
    return np.array([float(cell.replace("−", "-")) for cell in cells]).reshape(4, 4)


def test_the_matrix_is_that_of_python(tab, site_builder, tmp_path):
    site_builder.Site(tmp_path).parameters()
    page = tab(tmp_path / "extra/live/six_parameters.html", ready="true", viewport={"width": 800, "height": 900})
    random = np.random.default_rng(7)
    for _ in range(8):
        values = [int(random.integers(-180, 181)) if k % 2 == 0 else int(random.integers(-200, 201)) for k in range(6)]
        for name, value in zip(NAMES, values, strict=True):
            page.locator(f"#{name}").fill(str(value))
        python = transform(Kleinfinger(*[math.radians(x) if k % 2 == 0 else x for k, x in enumerate(values)]))
        off = np.abs(shown(page) - python)  # lengths in mm
        assert off[:3, :3].max() <= 0.5001e-4  # four decimals are shown
        assert off[:3, 3].max() <= 0.5001e-2  # two
        assert (off[3] == 0.0).all()
        text = page.locator("#raff").inner_text()
        pairs = PATTERN.findall(text.partition("{ parameters {")[2].partition("}")[0])
        written = {name: int(value) for name, value in pairs}
        assert written == {name: value for name, value in zip(NAMES, values, strict=True) if value}
