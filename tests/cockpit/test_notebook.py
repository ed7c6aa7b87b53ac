"""`cinegen.show`: a live page in a cell."""

import re

import numpy as np
import pytest
from browsers import Browser, becomes, get

import cinegen

pytestmark = pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")


def test_a_cell_holds_the_live_page(robot):
    with cinegen.show(robot("delta4"), port=0) as shown:
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
