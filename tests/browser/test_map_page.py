"""A map in the real page: cells are seen, pointed at and clicked, and the robot goes there."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from playwright.sync_api import sync_playwright
from test_cockpit_page import FLAGS, READY, SIZE, becomes, picture

from cinegen.cockpit import Cockpit
from cinegen.session import map_setup
from cinegen.workspace import GridAxis, MapSpecification, Region, make_map

CHROMIUM = shutil.which("chromium")
BOX = Region((GridAxis("x", -1.2, 1.2, 13), GridAxis("y", -1.2, 1.2, 13), GridAxis("z", -2.6, -1.2, 8)))
SLICE = Region((GridAxis("x", -0.45, 0.45, 30), GridAxis("y", -0.1, 0.65, 25)))
# A cell that the pointer meets: pixels, and its number in the map. The nearest to the middle of the canvas.
CELL = """() => {
  const box = cockpit.viewer.renderer.domElement.getBoundingClientRect();
  for (let r = 0; r < 0.45; r += 0.02) for (let turn = 0; turn < 6.2; turn += 0.5) {
    const event = {
      clientX: Math.round(box.left + box.width * (0.5 + r * Math.cos(turn))),
      clientY: Math.round(box.top + box.height * (0.5 + r * Math.sin(turn))),
    };
    const met = cockpit.cells.met(cockpit.pick.aim(event));
    if (met !== null && cockpit.pick.near(event) === null) {
      return [event.clientX, event.clientY, cockpit.field.array("numbers")[met.cell]];
    }
  }
  return null;
}"""

pytestmark = [
    pytest.mark.browser,
    pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning"),
    pytest.mark.skipif(CHROMIUM is None, reason="NO CHROMIUM: maps are not tested in a real browser"),
]


@pytest.fixture(scope="module")
def browser():
    with sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)


@pytest.fixture
def opened(browser, robot, tmp_path):
    """`opened(robot, region, *quantities)`: a cockpit on a map, a page that shows it, and the map."""
    ends, wrong = [], []

    def open_map(name, region, *quantities):
        path = tmp_path / f"{name}.zarr"
        make_map(MapSpecification(robot(name), region, quantities), path, workers=1)
        cockpit = Cockpit(map_setup(path), port=8300, own_process=False)
        page = browser.new_page(viewport=SIZE, bypass_csp=True)
        ends.extend([page.close, cockpit.close])
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto(cockpit.url, timeout=60_000)
        page.wait_for_function(READY, polling=100, timeout=60_000)
        return cockpit, page, cockpit.map

    yield open_map
    for end in ends:
        end()
    assert wrong == []


def seen(tab):
    return tab.evaluate("cockpit.field.seen.length")


def point(tab):
    """Move the pointer to a cell; return its pixels, and the cell's number in the map."""
    found = []

    def is_met():
        found[:] = tab.evaluate(CELL) or []
        if not found:  # the first picture is not drawn yet
            return False
        tab.mouse.move(found[0] - 1, found[1])
        tab.mouse.move(found[0], found[1])
        tab.wait_for_timeout(150)
        return tab.get_attribute("html", "data-cell") == str(found[2])

    assert becomes(tab, is_met), "no cell can be pointed at"
    return found


def goes_there(tab, cockpit, shown, called):
    """A click on a cell; what is said of it, and undone."""
    x, y, number = point(tab)
    cloud = shown.cells()
    value = cloud.arrays["value sigma_1"][cloud.arrays["numbers"].tolist().index(number)]
    assert f"sigma_1{float(f'{value:.3g}'):g}" in tab.text_content("#legend .cell")
    picture(tab, f"map_of_{called}")
    goal, states = json.loads(shown.cell(number))["q"], [cockpit.state.robots[called]]
    tab.mouse.click(x, y)

    def there():
        states.append(cockpit.state.robots[called])
        return states[-1].q.tolist() == goal

    assert becomes(tab, there)
    assert max(state.closure for state in states) < 1e-9
    passed = {tuple(state.q.tolist()) for state in states} - {tuple(states[0].q.tolist()), tuple(goal)}
    assert passed  # it was led there
    assert cockpit.state.notices == ()
    assert becomes(tab, lambda: cockpit.state.moving is None)
    tab.keyboard.press("Control+z")
    assert becomes(tab, lambda: np.allclose(cockpit.state.robots[called].q, states[0].q, atol=1e-6))


def test_a_click_on_a_tile_brings_the_robot_there_with_its_loops_closed(opened):
    cockpit, tab, shown = opened("five_bar", SLICE, "sigma_1")
    assert seen(tab) == len(shown.cells().arrays["numbers"])
    goes_there(tab, cockpit, shown, "linkage")


@pytest.mark.slow
def test_cells_in_space_are_clicked_coloured_cut_and_hidden_as_is_wished(opened):
    cockpit, tab, shown = opened("delta4", BOX, "sigma_1", "margin")
    goes_there(tab, cockpit, shown, "r1")
    cloud = shown.cells()
    assert tab.text_content("#map-note") == f"{len(cloud.arrays['numbers']):,} of 1,352 cells reached"
    tab.select_option("#map-quantity", "margin")
    assert "joint-limit margin" in tab.text_content("#legend .name")
    assert tab.text_content("#legend .high").endswith(f"{float(f'{cloud.description.quantities[1].high:.3g}'):g}")
    tab.select_option("#map-axis", "z")
    tab.fill("#map-cut", "3")
    assert seen(tab) == (cloud.arrays["indices"][:, 2] <= 3).sum()
    tab.check("#map-layer")
    assert seen(tab) == (cloud.arrays["indices"][:, 2] == 3).sum()
    x, y, number = point(tab)
    assert np.unravel_index(number, BOX.shape)[2] == 3
    picture(tab, "map_layer")
    tab.uncheck("#map-shown")
    assert seen(tab) == 0
    assert tab.is_hidden("#legend")
    before = cockpit.state.answered
    tab.mouse.click(x, y)
    tab.wait_for_timeout(300)
    assert cockpit.state.answered == before
