"""Accessibility of every page: axe-core finds no violation."""

import numpy as np
import pytest
from axe import needs_axe, violations
from tabs import becomes, tools

HIGH = {"width": 900, "height": 3200}  # the panel does not scroll: axe-core judges no colours of what is scrolled away
LOW = "document.getElementById('pane').style.maxHeight = '400px'"  # drawing in software takes long
UNFOLD = "document.querySelectorAll('details').forEach((one) => { one.open = true; })"
TABS = ("pose", "tasks", "analyse", "record", "view")
SCHEMES = ("light", "dark")
SPOKEN = """() => [...document.querySelectorAll("input[type=range], [role=meter]")]
  .filter((one) => one.checkVisibility())
  .map((one) => [one.getAttribute("aria-label"), one.getAttribute("aria-valuetext")])"""

# Controls without a label or a hint.
BARE = """() => [...document.querySelectorAll("button, input, select, [role=button]")].filter((control) => {
  const label = control.getAttribute("aria-label") || control.innerText?.trim() || control.labels?.[0]?.innerText
    || control.title;
  const hint = control.title || control.closest("[title]")?.title || control.labels?.[0]?.title;
  return !label || !hint;
}).map((control) => control.outerHTML.slice(0, 120))"""

pytestmark = needs_axe


@pytest.fixture
def open_tab(tab):
    """`open_tab(shown)`: a page that shows it, all sections of its drawer open."""

    def opened(shown):
        page = tab(shown)
        tools(page, "pose")
        for script in (UNFOLD, LOW):
            page.evaluate(script)
        page.set_viewport_size(HIGH)
        return page

    return opened


def in_both_schemes(page, state, scope=None):
    """Return the violations of a page (or of what is in a scope) in a state, in light and in dark colours."""
    faults = []
    for scheme in SCHEMES:
        page.emulate_media(color_scheme=scheme)
        faults += [f"{state}, {scheme}: {text}" for text in violations(page, scope)]
    return faults


def ranges(page):
    """Return the name, least and largest value that screen readers get of each slider and number field."""
    nodes = page.context.new_cdp_session(page).send("Accessibility.getFullAXTree")["nodes"]
    controls = []
    for node in nodes:
        if node.get("role", {}).get("value") in ("slider", "spinbutton"):
            properties = {entry["name"]: entry["value"].get("value") for entry in node["properties"]}
            controls.append((node["name"]["value"], properties["valuemin"], properties["valuemax"]))
    return controls


def test_sliders_and_number_fields_of_a_page_without_a_server_have_names_units_and_ranges(robot, open_tab, page_of):
    mechanism = robot("scara")
    page = open_tab(page_of("scara"))
    controls = ranges(page)
    for joint in mechanism.actuated:
        i = mechanism.q_index(joint)
        limits = np.degrees([mechanism.limits.lower[i], mechanism.limits.upper[i]])
        for name in (f"{joint} of scara", f"{joint} of scara, in degrees"):
            (shown,) = [values for title, *values in controls if title == name]
            if np.isfinite(limits).all():  # else a range about home
                assert shown == pytest.approx(limits, abs=1e-3)
    texts = dict(page.evaluate(SPOKEN))
    tools(page, "tasks")
    texts |= dict(page.evaluate(SPOKEN))
    assert texts["joint1 of scara"] == f"{np.degrees(mechanism.q_home[mechanism.q_index('joint1')]):.1f} degrees"
    assert texts["Gain"] == "100 per second"
    assert all(texts.values())
    tools(page, "view")
    page.select_option("#measures", index=1)
    tools(page, "pose")
    assert becomes(page, lambda: any(name == "joint1 of scara, in radians" for name, *_ in ranges(page)))
    slider = page.locator("[data-joint='scara/joint1'] input[type=range]")
    slider.press("Home")  # to its least value, which is read at once
    assert slider.get_attribute("aria-valuetext").startswith("minus 2.269 ")
    page.evaluate("cockpit.send({ type: 'set_recording', on: true })")
    assert becomes(page, "document.querySelector('#toasts .toast') !== null")
    assert in_both_schemes(page, "a notice", "#toasts") == []


def test_the_served_page(cockpit, open_tab):
    page = open_tab(cockpit("delta4", "rx90"))
    page.evaluate("cockpit.select('delta4', 'platform')")
    tools(page, "analyse")
    page.check("#reactions")
    assert page.evaluate(BARE) == []
    page.click("#pin")
    assert becomes(page, "document.querySelector('[data-task]') !== null")
    page.evaluate("""for (const id of ["crowd", "cover"]) document.getElementById(id).hidden = false;
      document.getElementById("cover").textContent = "The connection is lost.";""")
    faults = []
    for name in TABS:
        tools(page, name)
        faults += in_both_schemes(page, name)
    page.click("#help")
    faults += in_both_schemes(page, "help", "#keys")
    page.keyboard.press("Escape")
    assert faults == []


@pytest.mark.slow
def test_every_page_of_the_site(root, browser):
    site = root / "build" / "site" / "html"
    if not site.is_dir():
        pytest.skip("the site is not built: `make docs` builds it")
    others = [site / name for name in ("live", "source", "_modules", "_static")]
    faults = []
    for path in sorted(site.rglob("*.html")):
        if not any(path.is_relative_to(other) for other in others):
            page = browser.new_page()
            page.goto(path.as_uri())
            faults += in_both_schemes(page, path.stem)
            page.close()
    assert faults == []
