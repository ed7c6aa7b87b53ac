"""The report of a synthesis: complete, escaped, without anything to load, and readable in a browser and on paper."""

import os
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import sync_playwright

from cinegen.design import synthesize
from cinegen.plotting import synthesis_report
from cinegen.plotting.sheet import new_figure
from cinegen.plotting.synthesis.levels import RegionField, draw_field
from cinegen.plotting.synthesis.page import drawing, page_of

CHROMIUM = shutil.which("chromium")
PICTURES = os.environ.get("CINEGEN_PICTURES")

FILE, PATTERN, NODE = r"<script>alert('1')&amp;$\frac$.raff", "link[0-9<img src=x:y>&$^_$]*.d", "_tool"
HOSTILE = '</h1><script>alert("1")</script>&lt;\'-->$\\frac$'
VOID = {"meta", "img", "br", "link"}
TASK = {
    "parameters": {"link2.d": "209..500mm", "link5.d": "200..600mm"},
    "ties": ["link2.d = link4.d", "link5.d = frame20.d"],
    "reach": {"x": "-150..150mm", "y": "400mm"},
    "objective": [{"minimise": "condition"}, {"minimise": "size", "of": [PATTERN]}],
    "constraints": {"joint_limits": False},
    "front": 2,
    "starts": 1,
}


class Read(HTMLParser):
    """Elements of a page that is checked for being closed, and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags, self.identifiers, self.open = list[str](), list[str](), list[str]()
        self.attributes, self.text = list[tuple[str, str]](), ""
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]
        self.identifiers += [value for name, value in attrs if name == "id"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"style", "svg"} & set(self.open):
            self.text += data


@pytest.fixture(scope="module")
def synthesis(tmp_path_factory):
    path = tmp_path_factory.mktemp("hostile") / FILE
    text = Path("robots/five_bar.raff").read_text(encoding="utf-8")
    path.write_text(text.replace('"tool"', f'"{NODE}"'), encoding="utf-8")
    return synthesize(path, TASK)


@pytest.fixture(scope="module")
def report(synthesis):
    return synthesis_report(synthesis)


def test_a_report_is_complete_and_escaped(synthesis, report):
    page = Read(report)
    assert page.tags.count("figure") == 4
    assert FILE.removesuffix(".raff") not in page.tags
    assert page.text.count(PATTERN) == 4  # title (twice), text, the task
    assert f"node {NODE}" in page.text.lower()
    assert not {"script", "img", "link", "iframe", "a", "image"} & set(page.tags)
    assert all(value.startswith("#") for name, value in page.attributes if name in ("href", "src", "xlink:href"))
    assert not [value for _, value in page.attributes if "http" in value.lower()]
    assert not [name for name, _ in page.attributes if name.startswith("on")]
    assert len(page.identifiers) == len(set(page.identifiers))
    used = {value[1:] for name, value in page.attributes if name == "href"}
    used |= {identifier for _, value in page.attributes for identifier in re.findall(r"url\(#([^)]*)\)", value)}
    assert used <= set(page.identifiers)


def test_a_report_has_the_text_of_the_result_and_the_task(synthesis, report):
    text = Read(report).text
    assert synthesis.text in text
    assert "Nothing is proved between the points" in text
    assert '"link2.d": "209..500mm"' in text
    assert 'class="status fails"' not in report
    assert 'class="status fails"' in synthesis_report(replace(synthesis, check=replace(synthesis.check, reached=500)))


def test_every_text_of_a_page_is_escaped():
    with drawing():
        figure = new_figure()
        figure.text(0.5, 0.5, HOSTILE)
        read = Read(page_of(HOSTILE, HOSTILE, [(figure, HOSTILE)], HOSTILE, HOSTILE, good=False))
    assert "script" not in read.tags
    assert read.text.count(HOSTILE) == 6
    assert ("aria-label", HOSTILE) in read.attributes


# --- pictures ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("axes", "is_region"), [(0, False), (1, True), (3, True), (2, False)])
def test_fields_of_any_dimension_are_drawn(axes, is_region):
    lines = [np.linspace(0.1, 0.3, 5) if k < axes else np.array([0.2]) for k in range(3)]
    targets = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 3)
    values = np.stack([1.0 + targets.sum(axis=1), 2.0 * targets.sum(axis=1)])
    values[0, 0] = np.nan
    field = RegionField("condition", ("x", "y", "z"), targets, values, False, targets[:2])
    with drawing():
        figure = draw_field(field, is_region)
        Read(page_of("fields", "", [(figure, "a picture")], "", good=True))
    assert len(figure.axes) == 1
    assert field.varying == list(range(axes))
    assert field.worst(1) == len(targets) - 1


# --- in a browser ------------------------------------------------------------------------------------------------


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="NO CHROMIUM: the report is not tested in a real browser")
def test_a_report_in_a_browser_and_on_paper(report, tmp_path):
    wide = 420
    path = tmp_path / "report.html"
    path.write_text(report, encoding="utf-8")
    folder = Path(PICTURES or tmp_path)
    wrong = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM)
        page = browser.new_page(viewport={"width": wide, "height": 900})
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda message: wrong.append(message.text))
        page.on("request", lambda request: wrong.append(request.url) if request.url != path.as_uri() else None)
        page.goto(path.as_uri())
        page.screenshot(path=folder / f"synthesis_report_{wide}.png", full_page=True)
        assert page.evaluate("document.documentElement.scrollWidth") <= wide
        assert page.locator("h1").inner_text().startswith("linkage: minimise condition")
        boxes = page.locator("figure svg").evaluate_all("all => all.map(one => one.getBoundingClientRect().height)")
        assert len(boxes) == 4
        assert min(boxes) > 60
        pdf = page.pdf(path=folder / f"synthesis_report_{wide}.pdf", prefer_css_page_size=True)
        browser.close()
    assert not wrong
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 5
    width, height = (float(x) for x in re.search(rb"/MediaBox\s*\[\s*0 0 ([\d.]+) ([\d.]+)", pdf).groups())
    np.testing.assert_allclose([width, height], np.array([210.0, 297.0]) / 25.4 * 72.0, atol=1.0)
