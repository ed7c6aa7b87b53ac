"""`cinegen.show`: a live page in a cell."""

from __future__ import annotations

import re

import numpy as np
import pytest
from browsers import Browser, becomes, get

import cinegen

pytestmark = pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")


def test_a_cell_holds_the_live_page(robot):
    shown = cinegen.show(robot("delta4"), port=8600)
    try:
        html = shown._repr_html_()
        url = re.search(r'src="([^"]+)"', html)[1]
        assert url == shown.url
        assert get(url)[0] == 200
        assert repr(shown) == f"<r1 at {url}>"
        browser = Browser(url)
        assert becomes(lambda: browser.state is not None)
        before = shown.q["r1"]
        browser.say("start_drag", robot="r1", node="platform", point=[0, 0, 0])
        browser.say("move_drag", position=[0.1, 0.0, -2.0])
        assert becomes(lambda: np.abs(shown.q["r1"] - before).max() > 0.01)
    finally:
        shown.close()


def test_several_robots_have_names_of_their_own(robot):
    arm = robot("planar_3r")
    shown = cinegen.show([arm, arm], port=8610, follow="circle")
    try:
        assert list(shown.q) == [arm.name, f"{arm.name}'"]
    finally:
        shown.close()
    shown = cinegen.show({"<b>": arm}, port=8620)
    try:
        assert "<b>" not in shown._repr_html_()
        assert list(shown.q) == ["<b>"]
    finally:
        shown.close()


def test_the_face_says_what_it_has():
    assert "show" in cinegen.__all__
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        cinegen.nonsense  # noqa: B018
