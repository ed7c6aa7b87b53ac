"""Padlocks at the joints of the real page: what they lock, nothing moves."""

from __future__ import annotations

import numpy as np
from tabs import IN_BROWSER, becomes

pytestmark = IN_BROWSER


def test_a_padlock_locks_a_joint_and_its_slider(cockpit, tab):
    arm = cockpit("arm7")
    page = tab(arm)
    page.evaluate("document.getElementById('section-joints').open = true")
    lock = page.locator('[data-lock="arm7/joint2"]')
    slider, text = (page.locator(f'[data-joint="arm7/joint2"] input[type={kind}]') for kind in ("range", "number"))
    assert becomes(page, lambda: lock.is_visible() and lock.get_attribute("aria-pressed") == "false")
    lock.click()
    assert becomes(page, lambda: lock.get_attribute("aria-pressed") == "true" and slider.is_disabled())
    assert text.is_disabled()
    assert arm.state.robots["arm7"].locked == ("joint2",)
    before = arm.state.robots["arm7"].q
    page.locator('[data-joint="arm7/joint3"] input[type=number]').fill("20")
    page.keyboard.press("Enter")
    assert becomes(page, lambda: abs(arm.state.robots["arm7"].q[2] - np.radians(20.0)) < 1e-3)
    assert arm.state.robots["arm7"].q[1] == before[1]
    lock.click()
    assert becomes(page, lambda: lock.get_attribute("aria-pressed") == "false" and slider.is_enabled())
    assert arm.state.robots["arm7"].locked == ()


def test_who_watches_sees_the_locks_of_others(cockpit, tab):
    arm = cockpit("arm7")
    first, second = tab(arm), tab(arm)
    for page in (first, second):
        page.evaluate("document.getElementById('section-joints').open = true")
    first.locator('[data-lock="arm7/joint1"]').click()
    other = second.locator('[data-lock="arm7/joint1"]')
    assert becomes(second, lambda: other.get_attribute("aria-pressed") == "true")
