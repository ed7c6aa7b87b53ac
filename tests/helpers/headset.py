"""A headset that is emulated in a browser (iwer): its head, its controllers and its hands, for tests of pages."""

from pathlib import Path

import numpy as np
import pytest

EMULATOR = Path(__file__).resolve().parents[2] / "node_modules" / "iwer" / "build" / "iwer.min.js"

needs_emulator = pytest.mark.skipif(
    not EMULATOR.is_file(), reason="NO IWER in node_modules: headsets are not tested; `make javascript` installs it"
)

_INSTALL = """
window.device = new IWER.XRDevice(IWER.metaQuest3, { stereoEnabled: true });
device.installRuntime({ forceInstall: true });
device.position.set(0, 1.6, 0);
device.quaternion.set(-0.17, 0, 0, 0.985); // looks 20 degrees down
device.fovy = 1.1;
"""

# Turns a hand so that its ray meets a node; what it meets first, in the room, or null if the node is hidden from there.
_AIM = """([side, robot, node]) => {
  const { Box3, Vector3, Quaternion, Ray } = MeshCat.THREE;
  const tracked = device.primaryInputMode === "hand" ? device.hands[side] : device.controllers[side];
  const from = new Vector3(tracked.position.x, tracked.position.y, tracked.position.z);
  const group = cockpit.view.group(robot, node);
  const box = new Box3().setFromObject(group);
  const inside = (x, y, z) => new Vector3(x, y, z).multiply(box.max.clone().sub(box.min)).add(box.min);
  const shares = [0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9, 0.05, 0.95];
  for (const x of shares) for (const y of shares) for (const z of shares) {
    const way = inside(x, y, z).sub(from).normalize();
    const hit = cockpit.pick.along(new Ray(from, way));
    if (hit === null || hit.robot !== robot || hit.node !== node) continue;
    const turn = new Quaternion().setFromUnitVectors(new Vector3(0, 0, -1), way);
    tracked.quaternion.set(turn.x, turn.y, turn.z, turn.w);
    return hit.point.toArray();
  }
  return null;
}"""


class Headset:
    """A headset on a page: "right" and "left" are its hands; positions are in the room (m, y up).

    Args:
        page: a page of playwright, on which nothing has been loaded yet.
    """

    def __init__(self, page):
        self.page = page
        page.add_init_script(EMULATOR.read_text(encoding="utf-8") + _INSTALL)

    def enter(self, mode="vr"):
        """Press the page's button, and wait for pictures."""
        self.page.click("#fold")
        self.page.click("#tab-view")
        self.page.click(f"#enter-{mode}")
        self.page.evaluate("document.getElementById('fold').click()")  # the emulator covers it
        self.page.wait_for_function("document.documentElement.dataset.headset", timeout=60_000)
        self.frames()

    def frames(self, count=4):
        """Wait for some pictures."""
        self.page.evaluate(
            """(count) => new Promise((resolve) => {
              const { renderer } = cockpit.viewer;
              const from = renderer.info.render.frame;
              const look = () => (renderer.info.render.frame >= from + count ? resolve() : setTimeout(look, 5));
              look();
            })""",
            count,
        )

    def put(self, side, position, hand=False):
        """Place a hand."""
        kind = "hands" if hand else "controllers"
        x, y, z = position
        self.page.evaluate(f"device.{kind}.{side}.position.set({x}, {y}, {z})")
        self.frames()

    def aim(self, side, robot, node):
        """Let a hand point at a node; where its ray meets it, in the room."""
        point = self.page.evaluate(_AIM, [side, robot, node])
        assert point is not None, f"{node} of {robot} can't be seen from the {side} hand"
        self.frames()
        return np.array(point)

    def press(self, side, strength, button="trigger"):
        """Press a button, from 0 to 1."""
        self.page.evaluate(f"device.controllers.{side}.updateButtonValue('{button}', {strength})")
        self.frames()

    def panel(self):
        """What the panel reads."""
        return self.page.evaluate("cockpit.presentation.panel.content")

    def at(self, point):
        """Where a point of the robots' world is in the room."""
        script = "(point) => cockpit.root.localToWorld(new MeshCat.THREE.Vector3(...point)).toArray()"
        self.page.evaluate("cockpit.root.updateWorldMatrix(true, false)")
        return np.array(self.page.evaluate(script, list(point)))

    def scale(self):
        """Metres of the room per metre of the robots, by two points of the robots' world."""
        return np.linalg.norm(self.at((1.0, 0.0, 0.0)) - self.at((0.0, 0.0, 0.0)))
