"""A user inverts, swaps and scales the axes of a sensor in the panel."""

from tabs import READY, becomes, picture, tools

import cinegen
from cinegen.session import arrange

ARM = """RAFF arm
sensor 1 { port "tcp://127.0.0.1:0" axes "x, y, -z" }
robot arm {
  link 1 { type 2 pred 0 parameters { theta 20 } limits { -170 170 } }
  frame 2 { pred 1 name "tip" parameters { d 200 } }
  constraint { frame 2 sensor ( 1 0 ) }
}
"""


def test_axes_are_inverted_swapped_and_scaled_and_survive_a_reload(opened):
    session, page = opened(setup=arrange({"arm": cinegen.load(ARM)}))
    card = page.locator('[data-sensor="1"]')

    def row(axis):
        return card.locator(f'[data-axis="{axis}"]')

    def unfold():
        tools(page, "tasks")
        card.locator("summary").click()

    def axes():
        return next(sensor.axes for sensor in session.state.sensors if sensor.id == "1")

    def shown():
        return [
            (
                row(axis).locator("select").input_value(),
                row(axis).locator("input[type=checkbox]").is_checked(),
                row(axis).locator("input[type=number]").input_value(),
            )
            for axis in ("x", "y", "z", "rx")
        ]

    unfold()
    before = [("x", False, "1"), ("y", False, "1"), ("z", True, "1"), ("0", False, "1")]
    assert becomes(page, lambda: shown() == before)
    row("z").locator("select").select_option("y")  # which y had: they swap
    assert becomes(page, lambda: axes() == "x, z, -y, 0, 0, 0")
    row("x").get_by_label("inverted").check()
    row("rx").locator("select").select_option("rz")
    row("rx").locator("input[type=number]").fill("0.5")
    row("rx").locator("input[type=number]").press("Enter")
    assert becomes(page, lambda: axes() == "-x, z, -y, 0.5*rz, 0, 0")
    after = [("x", True, "1"), ("z", False, "1"), ("y", True, "1"), ("rz", False, "0.5")]
    assert becomes(page, lambda: shown() == after)
    picture(page, "sensor_axes")
    page.reload()
    assert becomes(page, READY)
    unfold()
    assert becomes(page, lambda: shown() == after)
    assert not page.locator('[data-sensor="gamepad"] details').is_hidden()
