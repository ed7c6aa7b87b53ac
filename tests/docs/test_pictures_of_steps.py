"""Pictures of a step are drawn from the text of that very step, and those of how-to pages from blocks of their page."""

import sys

import pytest
from pages import ROOT

sys.path.insert(0, str(ROOT / "docs/pictures"))
from sources import HOWTO, PAGES, howto_blocks, mark_in, mark_of, sources

SOURCES = [source for page in PAGES for source in sources((ROOT / "docs" / page).read_text(encoding="utf-8"))]


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.picture)
def test_a_picture_is_of_the_text_above_it(source):
    path = ROOT / "docs/pictures" / source.picture
    command = f"python docs/pictures/steps.py {path.stem}"
    assert mark_in(path.read_bytes()) == source.mark, f"{path.name} is of an older text: draw it again by {command}"
    assert path.stat().st_size <= 60_000


@pytest.mark.parametrize("picture", HOWTO)
def test_a_picture_of_a_how_to_page_is_of_its_blocks(picture: str):
    path = ROOT / "docs/pictures" / picture
    command = f"python docs/pictures/howto.py {path.stem}"
    assert mark_in(path.read_bytes()) == mark_of(howto_blocks(picture)), f"{picture} is of older blocks: {command}"
    assert f"](../pictures/{picture})" in (ROOT / "docs/howto" / f"{HOWTO[picture][0]}.md").read_text(encoding="utf-8")
