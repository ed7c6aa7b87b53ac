"""Writes figures as the small pictures that pages of this documentation show."""

import contextlib
import io
import shutil
import sys
from pathlib import Path

from PIL import Image
from PIL.PngImagePlugin import PngInfo

PICTURES = Path(__file__).resolve().parent
ROBOTS = PICTURES.parent.parent / "robots"
LARGEST = 250_000  # bytes
_FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run")
_READY = "document.documentElement.dataset.view === 'ready'"
_DESCRIPTION = 0x010E  # a tag of Exif


def write(figures):
    """Draw those that the command line names, or all: functions that make a matplotlib figure, by name."""
    for name in sys.argv[1:] or figures:
        save(name, figures[name]())


@contextlib.contextmanager
def chromium():
    """Yield a browser without a window."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=list(_FLAGS))
        yield browser
        browser.close()


def tab_of(browser, width, height):
    """Return a tab in which more than the page's own code may be evaluated."""
    return browser.new_page(viewport={"width": width, "height": height}, bypass_csp=True)


def show(tab, url):
    """Open a page, and wait until its robots are drawn."""
    tab.goto(url)
    tab.wait_for_function(_READY, timeout=120_000)


def shot(tab):
    """Return what a tab shows, and close it."""
    picture = Image.open(io.BytesIO(tab.screenshot(timeout=120_000))).convert("RGB")
    tab.close()
    return picture


def exif(text):
    """Return Exif with a description."""
    tags = Image.Exif()
    tags[_DESCRIPTION] = text
    return tags


def save(name, figure, description=""):
    """Write a matplotlib figure as a picture of few colours."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=110)
    with Image.open(drawn) as image:
        save_image(name, image.convert("RGB"), 160, description)


def save_image(name, image, colours, description=""):
    """Write an image as a picture of few colours."""
    path, info = PICTURES / f"{name}.png", PngInfo()
    if description:
        info.add_text("Description", description)
    few = image.quantize(colours, Image.Quantize.MEDIANCUT, kmeans=3, dither=Image.Dither.NONE)
    few.save(path, optimize=True, pnginfo=info)
    assert path.stat().st_size < LARGEST, path
