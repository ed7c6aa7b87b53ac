"""Draws docs/pictures/cockpit*.png again, from the live page: `python docs/pictures/cockpit.py [NAME ...]`.

Needs chromium on PATH, playwright and Pillow. The picture is taken while a mouse drags a part of a robot.
"""

import sys
import warnings

from figures import ROBOTS, chromium, save_image, shot, show, tab_of

import cinegen
from cinegen.cockpit import Cockpit
from cinegen.collision import load_scene
from cinegen.session import arrange, scene_setup

TOUCH = """([robot, node]) => {
  const box = cockpit.viewer.renderer.domElement.getBoundingClientRect();
  const found = [];
  for (let y = 4; y < box.height; y += 4) for (let x = 4; x < box.width; x += 4) {
    const at = { clientX: box.left + x, clientY: box.top + y };
    const hit = cockpit.pick.touched(at);
    if (hit?.robot === robot && hit.node === node) found.push([at.clientX, at.clientY]);
  }
  return found[Math.floor(found.length / 2)];
}"""
"""Where on the screen a part can be touched."""


def drag(tab, robot, node, right, down):
    """Drags a part by so many pixels; the button stays down."""
    x, y = tab.evaluate(TOUCH, [robot, node])
    tab.mouse.move(x, y)
    tab.mouse.down()
    for step in range(1, 21):
        tab.mouse.move(x + right * step / 20, y + down * step / 20)
        tab.wait_for_timeout(50)
    tab.wait_for_timeout(4000)


def at_limit(tab):
    """A delta robot whose platform is dragged until a joint is at its limit."""
    tab.evaluate("cockpit.send({ type: 'select_sensor', robot: 'delta4', node: 'platform', sensor: null })")
    tab.evaluate("cockpit.send({ type: 'move_home' })")
    tab.wait_for_timeout(4000)
    drag(tab, "delta4", "platform", 420, 40)


def two_robots(tab):
    """An arm on a Gough platform: its tool is pinned, and the platform is dragged from under it."""
    tab.evaluate("cockpit.send({ type: 'pin', robot: 'arm7', node: 'tool' })")
    tab.evaluate("cockpit.select('arm7', 'tool')")
    drag(tab, "gough", "link6", -35, 5)


def pushed(tab):
    """A planar arm that a disc pushes."""
    drag(tab, "disc", "disc", -100, 110)


def forces(tab):
    """An ankle with 80 kg on its foot: forces as parts of the actuators' limits, and reactions."""
    tab.click("#fold")
    tab.click("#tab-analyse")
    tab.evaluate("document.getElementById('section-singularity').open = false")
    tab.evaluate("cockpit.send({ type: 'move_joint', robot: 'ankle', joint: 'joint5', value: 0.305 })")
    tab.wait_for_timeout(1000)
    tab.evaluate("cockpit.send({ type: 'end_joint_motion' })")
    tab.fill("[data-payload='ankle'] input[type=number]", "80")
    tab.press("[data-payload='ankle'] input[type=number]", "Enter")
    tab.check("#reactions")
    tab.click("#section-forces .fold summary")
    tab.evaluate("cockpit.frame()")
    tab.wait_for_timeout(4000)


SHOTS = {
    "cockpit": (at_limit, ["delta4"], [], "circle"),
    "cockpit_forces": (forces, ["ankle"], [], None),
    "cockpit_obstacles": (pushed, ["scenes/disc.toml"], [], None),
    "cockpit_two_robots": (two_robots, ["gough", "arm7"], ["arm7=gough.platform"], None),
}
"""What is done, with which robots, their base poses, and the path that they follow before."""


def draw(browser, name):
    """Draws one picture."""
    scene, robots, bases, follow = SHOTS[name]
    if robots[0].endswith(".toml"):
        setup = scene_setup(load_scene(ROBOTS / robots[0]))
    else:
        setup = arrange({robot: cinegen.load(ROBOTS / f"{robot}.raff") for robot in robots}, bases=bases, follow=follow)
    with Cockpit(setup, port=7860) as cockpit:
        tab = tab_of(browser, 1280, 800)
        show(tab, cockpit.url)
        scene(tab)
        tab.evaluate("cockpit.view.resolution.constant = true; cockpit.view.changed();")  # all pixels, and shadows
        tab.wait_for_timeout(2000)
        tab.evaluate("document.querySelectorAll('.toast, .hint, #hint').forEach((note) => note.remove())")
        save_image(name, shot(tab), 256)


if __name__ == "__main__":
    warnings.simplefilter("ignore", cinegen.CinegenWarning)  # sensors that are not plugged in here
    with chromium() as browser:
        for wanted in sys.argv[1:] or SHOTS:
            draw(browser, wanted)
