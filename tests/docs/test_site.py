"""The source of the site, before Sphinx: `make docs` builds it, and has no warning."""

import re
from pathlib import Path

import pytest
from pages import blocks
from repository import module_of

import cinegen

LINK = re.compile(r"\]\(([^)#\s]+)[#)]")


@pytest.fixture(scope="module")
def builder():
    return module_of("docs/site/build.py")


@pytest.fixture(scope="module")
def source(builder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    builder.fill(builder.Site(folder))
    return folder


def test_every_link_leads_to_a_page_of_the_site(source):
    checked = 0
    for page in source.rglob("*.md"):
        text = re.sub(r"^(`{3,}).*?^\1$", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
        for target in LINK.findall(re.sub(r"`[^`]*`", "", text)):
            if "://" not in target:
                assert (page.parent / target).exists(), (page, target)
                checked += 1
    assert checked > 500


def test_every_public_name_is_in_the_reference(source):
    text = (source / "reference/api.md").read_text()
    missing = {name for name in cinegen.__all__ if f"**{name}**" not in text}
    assert missing == {"CinegenError", "CinegenWarning", "ClosureError", "__version__"}  # of no package


def test_every_robot_of_the_gallery_can_be_dragged(builder, source, root):
    names = builder.PICTURE.findall((source / "gallery.md").read_text())
    assert set(names) == {path.stem for path in (root / "robots").glob("*.raff")}
    assert all(f'href="live/{name}.html"' in (source / "gallery.md").read_text() for name in names)
    assert 'data-src="live/delta4.html"' in (source / "index.md").read_text()


def test_the_program_of_the_home_page_prints_what_it_says(root, capsys):
    shown = [block for block in blocks(root / "docs/site/index.md") if block.language in ("python", "text")]
    assert [block.language for block in shown] == ["python", "text"]
    exec(compile(shown[0].text, "index.md", "exec"), {})
    assert capsys.readouterr().out == shown[1].text


def test_every_example_has_a_card_with_a_picture(root, source):
    cards = re.findall(
        r"^- !\[([^]]+)\]\(([^)]+)\) \[[^]]+\]\(([^)]+)\) \S", (source / "examples.md").read_text(), re.M
    )
    assert {Path(page).name for *_, page in cards} == {f"{path.name}.md" for path in (root / "examples").glob("*.py")}
    texts, pictures, _ = zip(*cards, strict=True)
    assert len(set(texts)) == len(set(pictures)) == len(cards)
    assert min(map(len, texts)) > 20
    assert all((source / picture).is_file() for picture in pictures)


def test_a_link_to_a_file_that_is_missing_is_an_error(builder, tmp_path, monkeypatch):
    (tmp_path / "docs/pictures").mkdir(parents=True)
    (tmp_path / "docs/page.md").write_text("[there](nowhere.md)")
    monkeypatch.setattr(builder, "ROOT", tmp_path)
    with pytest.raises(SystemExit, match=r"docs/page\.md: no file nowhere\.md"):
        builder.Site(tmp_path / "site").copy("docs/page.md", "page")
