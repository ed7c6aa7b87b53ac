"""What goes wrong is told in one sentence, with what to do; and the axes of a sensor, which a user sets right."""

import pytest
from hostile_names import urdf
from tabs import READY, becomes, picture, tools
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.session import arrange

MESH = '<visual><geometry><mesh filename="lost.stl"/></geometry></visual>'
LOST_MESH = urdf_text([UrdfJoint("j", "base", "upper")], {"upper": MESH})
COVER = "document.getElementById('cover')"


def cover(page, text):
    return becomes(page, f"!{COVER}.hidden && {COVER}.textContent.includes({text!r})")


def test_a_session_that_has_ended_one_with_another_token_and_one_of_another_robot(cockpit, tab):
    session = cockpit("five_bar", token="first")
    page = tab(session, strict=False)
    port = session.server.port
    session.close()
    assert cover(page, "start cinegen drive again, and open the address that it prints")
    with cockpit("five_bar", port=port, token="second"):
        assert cover(page, "open the address that cinegen drive printed last")
        picture(page, "wrong_token")
        answer = page.goto(f"http://127.0.0.1:{port}/?token=first")
        assert answer.status == 403
        refused = "This address lacks the session's token: open the one that cinegen drive printed."
        assert page.inner_text("p") == refused
        picture(page, "refused")
    session = cockpit("five_bar", port=port, token="t")
    page = tab(session, strict=False, viewport={"width": 800, "height": 500})
    session.close()
    with cockpit("scara", port=port, token="t"):
        assert becomes(page, "document.getElementById('toasts').textContent.includes('it drives scara')")
        assert page.is_hidden("#cover")


def test_a_mesh_that_is_lost_is_told_in_the_page(cockpit, tab):
    with pytest.warns(cinegen.CinegenWarning, match="is not found"):
        session = cockpit(setup=arrange({"arm": cinegen.load(LOST_MESH)}))
    page = tab(session)
    toast = page.locator("#toasts .toast").first.inner_text()
    assert "mesh 'lost.stl' is not found" in toast
    assert "sticks are drawn instead" in toast


def test_lists_of_a_robot_of_many_bodies_are_filtered(cockpit, tab):
    links, joints = ([f"{kind}{i}" for i in range(1, 300)] for kind in ("link", "joint"))
    page = tab(cockpit(setup=arrange({"chain": cinegen.load(urdf("chain", links, joints))})))
    tools(page, "pose")
    rows = page.locator("[data-joint]:visible")
    page.fill("#section-joints input[type=search]", "joint29")
    assert rows.count() == 11  # 29, 290 to 299
    page.fill("#section-tree input[type=search]", "link123")
    shown = page.locator("[data-node]:visible")
    assert [shown.nth(i).get_attribute("data-node") for i in range(shown.count())] == ["chain/link123"]
    page.fill("#section-joints input[type=search]", "")
    assert rows.count() == 299


# --- axes of a sensor -------------------------------------------------------------------------------------------------
# A user inverts, swaps and scales the axes of a sensor in the panel.


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
