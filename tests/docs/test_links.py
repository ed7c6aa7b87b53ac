"""Every link and picture of README and docs leads somewhere, and there is a picture of every robot."""

import re
from pathlib import Path

import pytest
from pages import NAMES, ROOT, anchors, links
from PIL import Image

ROBOTS = sorted(path.stem for path in (ROOT / "robots").glob("*.raff"))


@pytest.mark.parametrize("name", NAMES)
def test_links_lead_somewhere(name):
    page = ROOT / name
    for link in links(page):
        if link.startswith(("https://", "http://")):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{name}: {link}"
        assert target.is_relative_to(ROOT), f"{name}: {link}"
        if anchor:
            assert anchor in anchors(target), f"{name}: {link}"


@pytest.mark.parametrize("name", NAMES)
def test_modules_that_a_page_names_exist(name):
    named = re.findall(r"`([\w./]+/[\w.]+\.(?:py|mjs|js))`", (ROOT / name).read_text(encoding="utf-8"))
    roots = [ROOT, ROOT / "cinegen", ROOT / "raff2urdf"]
    assert [path for path in named if not any((root / path).exists() for root in roots)] == []


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_robot_has_a_picture_in_the_gallery(robot):
    path = ROOT / "docs" / "pictures" / f"{robot}.webp"
    assert path.stat().st_size <= 60_000
    with Image.open(path) as picture:
        assert picture.size == (900, 600)
        assert len(picture.convert("RGB").getcolors(2**20) or []) > 8  # something is to be seen
    assert f"pictures/{robot}.webp" in links(ROOT / "docs" / "gallery.md")


@pytest.mark.parametrize("page", [name for name in NAMES if name.startswith("docs/howto/")])
def test_a_how_to_page_has_a_picture(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    assert re.search(r"^!\[[^]]{20,}\]\(\.\./pictures/[\w.]+\)$", text, re.MULTILINE)


def test_every_page_can_be_found_from_the_readme():
    """By links of links; the README itself has few."""
    reached: set[Path] = set()
    waiting = [ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        reached.add(page)
        paths = {(page.parent / link.partition("#")[0]).resolve() for link in links(page) if "://" not in link}
        waiting += [path for path in paths - reached if path.suffix == ".md"]
    assert {ROOT / name for name in NAMES} <= reached
