"""Draws the pictures of docs/howto again, from the texts of its pages: `python docs/pictures/howto.py [NAME ...]`.

Needs chromium on PATH.
"""

import io
import re
import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from cockpit import FLAGS
from figures import PICTURES, ROBOTS, save
from make import draw
from PIL import Image
from playwright.sync_api import sync_playwright
from sketch import SHADOW, Sketch

import cinegen
from cinegen.design import calibrate
from cinegen.page import build_editor
from cinegen.plotting import draw_modes
from cinegen.plotting.residuals import draw_residuals
from cinegen.plotting.sheet import FAINT, INK
from raff2urdf.quantities import show_lengths_in

SIZE = (720, 480)  # pixels


def block(page, name):
    """Return a file that a page shows."""
    text = (PICTURES.parent / "howto" / f"{page}.md").read_text(encoding="utf-8")
    return re.search(rf"^```\w+ {re.escape(name)}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)[1]


def robot(browser, path, page, file, direction):
    """Draw a robot of a page, its loops closed."""
    with TemporaryDirectory() as folder:
        there = Path(folder, file)
        there.write_text(block(page, file), encoding="utf-8")
        mechanism = cinegen.load(
            there, loops={"closing_effector": "revolute"} if "closing" in there.read_text() else None
        )
    draw(browser, path, {there.stem: (mechanism, mechanism.q_home)}, direction, size=SIZE)


def modes():
    """All assembly modes of the Gough platform, for the leg lengths at home."""
    show_lengths_in("mm")
    return draw_modes(cinegen.assembly_modes(cinegen.load(ROBOTS / "gough.raff")), name="gough")


def residuals():
    """The measurements of the page, before and after the calibration."""
    show_lengths_in("mm")
    with TemporaryDirectory() as folder:
        table = Path(folder, "measured.csv")
        table.write_text(block("calibrate", "measured.csv"), encoding="utf-8")
        return draw_residuals(calibrate(ROBOTS / "five_bar.raff", table, names=["link*.d"]), name="five_bar")


def editor(browser, path):
    """Draw the page with an editor."""
    tab = browser.new_page(viewport={"width": 1200, "height": 720}, bypass_csp=True)
    with TemporaryDirectory() as folder:
        html = Path(folder, "edited.html")
        html.write_text(build_editor((ROBOTS / "four_bar.raff").read_text(encoding="utf-8"), "four_bar.raff"), "utf-8")
        tab.goto(html.as_uri())
        tab.wait_for_function("document.documentElement.dataset.view === 'ready'", timeout=120_000)
        tab.wait_for_timeout(4000)
        shot = tab.screenshot(timeout=120_000)
    tab.close()
    with Image.open(io.BytesIO(shot)) as image:
        image.convert("RGB").save(path, quality=82, method=6)


def mouse(_, path):
    """A 3D mouse and its axes, as a user sees them."""
    sketch = Sketch(-72.0, 26.0)
    sketch.ground((-100.0, -100.0), (150.0, 150.0), 0.0, 50.0)
    turns = np.linspace(0.0, 2.0 * np.pi, 60)
    circle = np.column_stack([np.cos(turns), np.sin(turns), 0.0 * turns])
    for radius, aside in ((50.0, 6.0), (38.0, 24.0)):
        sketch.polygon(radius * circle + (1.4 * aside, aside, 0.0), SHADOW, lift=-1e6, opacity=0.12)
    sketch.cylinder((0.0, 0.0, 7.0), (0.0, 0.0, 1.0), 42.0, 14.0, FAINT)
    sketch.cylinder((0.0, 0.0, 34.0), (0.0, 0.0, 1.0), 30.0, 34.0, INK, 100.0)
    sketch.frame((0.0, 0.0, 51.0), np.eye(3), 95.0, width=3.0, lift=500.0)
    sketch.text((95.0, 0.0, 51.0), "to the right", (0.0, 0.0, -1.0), gap=16.0)
    sketch.text((0.0, 95.0, 51.0), "away from you", (1.0, 0.0, 0.0), gap=24.0)
    sketch.text((0.0, 0.0, 146.0), "up", (1.0, 0.0, 0.0), gap=16.0)
    sketch.text((0.0, -100.0, 0.0), "you are here", (0.0, 0.0, -1.0))
    path.write_text(sketch.svg("A 3D mouse and its axes", tallest=380.0), encoding="utf-8")


DRAWINGS = {
    "howto_urdf_with_loops.webp": lambda browser, path: robot(
        browser, path, "urdf-with-loops", "linkage.urdf", (-75.0, 18.0)
    ),
    "howto_from_cad.webp": lambda browser, path: robot(browser, path, "from-cad", "planar.urdf", (-72.0, 48.0)),
    "howto_all_solutions.png": lambda _, path: save(path.stem, modes()),
    "howto_calibrate.png": lambda _, path: save(path.stem, residuals()),
    "howto_web_page.webp": editor,
    "howto_spacemouse.svg": mouse,
}
"""What draws each of them, in a browser."""


def main():
    """Draw those that the command line names, or all."""
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        for name, drawing in DRAWINGS.items():
            if not sys.argv[1:] or Path(name).stem in sys.argv[1:]:
                drawing(chromium, PICTURES / name)
        chromium.close()


if __name__ == "__main__":
    main()
