"""Pages of the built site: names lead to the reference, the reference to its source; code can be copied; nothing is
wider than the window."""

import re

import pytest

pytestmark = pytest.mark.slow
LINK = re.compile(r'<a class="reference internal" href="([^"#]*)#([^"]+)"[^>]*><code')


@pytest.fixture(scope="module")
def site(root):
    folder = root / "build" / "site" / "html"
    if not (folder / "index.html").is_file():
        pytest.skip("the site is not built: `make docs` builds it")
    return folder


def test_names_in_code_font_lead_to_entries_of_the_reference(site):
    count = 0
    for page in [*site.glob("*.html"), *site.glob("howto/*.html")]:
        for path, anchor in LINK.findall(page.read_text(encoding="utf-8")):
            if "reference/api/" in path:
                text = (page.parent / path).read_text(encoding="utf-8")
                assert f'id="{anchor}"' in text, (page.name, anchor)
                count += 1
    assert count > 100


def test_entries_of_the_reference_lead_to_their_source(site):
    page = (site / "reference/api/ik.html").read_text(encoding="utf-8")
    (link,) = re.findall(r'href="([^"#]*_modules/[^"#]*)#Solver"', page)
    source = (site / "reference/api" / link).read_text(encoding="utf-8")
    assert '<span class="k">class</span><span class="w"> </span><span class="nc">Solver</span>' in source


def test_code_is_copied_without_prompts_and_output(site, browser):
    context = browser.new_context(permissions=["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto((site / "howto/urdf-with-loops.html").as_uri())
    block = page.locator("div.highlight-console").first
    block.locator("button.copy").focus()
    page.keyboard.press("Enter")
    block.get_by_text("Copied").wait_for(timeout=60_000)
    copied = page.evaluate("navigator.clipboard.readText()")
    assert copied == "cinegen info linkage.urdf\necho '{\"drive\": 0.5}' | cinegen close linkage.urdf\n"
    assert page.locator("div.highlight-text button.copy").count() == 0
    context.close()


@pytest.mark.parametrize("width", [320, 1020, 1320])
def test_no_page_is_wider_than_the_window(site, browser, width):
    page = browser.new_page(viewport={"width": width, "height": 800})
    for name in ("index", "examples", "gallery", "howto/all-solutions", "reference/api/ik"):
        page.goto((site / f"{name}.html").as_uri())
        assert page.evaluate("document.documentElement.scrollWidth - window.innerWidth") <= 0, name
    page.close()
