"""A map in the real page: cells are seen, pointed at and clicked, and the robot goes there."""

import json

import numpy as np
from tabs import becomes, picture, tools

from cinegen.session import map_setup
from cinegen.workspace import GridAxis, MapSpecification, Region, make_map

SLICE = Region((GridAxis("x", -0.45, 0.45, 15), GridAxis("y", -0.1, 0.65, 12)))
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


def seen(tab):
    return tab.evaluate("cockpit.field.seen.length")


def point(tab):
    """Move the pointer to a cell; return its pixels, and the cell's number in the map."""
    cell = []

    def is_met():
        cell[:] = tab.evaluate(CELL) or []
        if not cell:  # the first picture is not drawn yet
            return False
        tab.mouse.move(cell[0] - 1, cell[1])
        tab.mouse.move(cell[0], cell[1])
        tab.wait_for_timeout(150)
        return tab.get_attribute("html", "data-cell") == str(cell[2])

    assert becomes(tab, is_met), "no cell can be pointed at"
    return cell


def test_a_click_on_a_tile_brings_the_robot_there_with_its_loops_closed(robot, cockpit, tab, tmp_path):
    path = tmp_path / "five_bar.zarr"
    make_map(MapSpecification(robot("five_bar"), SLICE, ("sigma_1", "margin")), path, workers=1)
    session = cockpit(setup=map_setup(path))
    page, shown = tab(session), session.map
    cloud = shown.cells()
    assert seen(page) == len(cloud.arrays["numbers"])
    x, y, number = point(page)
    value = cloud.arrays["value sigma_1"][cloud.arrays["numbers"].tolist().index(number)]
    assert f"sigma_1{float(f'{value:.3g}'):g}" in page.text_content("#legend .cell")
    picture(page, "map_of_linkage")
    goal, states = json.loads(shown.cell(number))["q"], [session.state.robots["linkage"]]
    page.mouse.click(x, y)

    def arrived():
        states.append(session.state.robots["linkage"])
        return states[-1].q.tolist() == goal

    assert becomes(page, arrived)
    assert max(state.closure for state in states) < 1e-9
    passed = {tuple(state.q.tolist()) for state in states} - {tuple(states[0].q.tolist()), tuple(goal)}
    assert passed  # it was led there
    assert session.state.notices == ()
    assert becomes(page, lambda: session.state.moving is None)
    page.keyboard.press("Control+z")
    assert becomes(page, lambda: np.allclose(session.state.robots["linkage"].q, states[0].q, atol=1e-6))
    # coloured, cut and hidden as is wished
    assert page.text_content("#map-note") == f"{len(cloud.arrays['numbers']):,} of 180 cells reached"
    tools(page, "analyse")
    page.select_option("#map-quantity", "margin")
    assert "joint-limit margin" in page.text_content("#legend .name")
    assert page.text_content("#legend .high").endswith(f"{float(f'{cloud.description.quantities[1].high:.3g}'):g}")
    page.select_option("#map-axis", "y")
    page.fill("#map-cut", "3")
    assert seen(page) == (cloud.arrays["indices"][:, 1] <= 3).sum()
    page.check("#map-layer")
    assert seen(page) == (cloud.arrays["indices"][:, 1] == 3).sum()
    page.uncheck("#map-shown")
    assert seen(page) == 0
    assert page.is_hidden("#legend")
