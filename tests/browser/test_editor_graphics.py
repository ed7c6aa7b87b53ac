"""Graphics in a page with an editor: where and as the page without an editor draws them, whatever the text becomes."""

from __future__ import annotations

import numpy as np
import pytest
from test_editor_page import edit
from test_local_page import CHROMIUM, PICTURES, becomes, browser, tab  # noqa: F401
from variants import slow

import cinegen
from cinegen.page import build_editor, build_page
from cinegen.session import Setup
from raff2urdf.graphics.skeleton import SkeletonDrawing
from raff2urdf.raff.reader import parse

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="NO CHROMIUM: the page is not tested in a real browser"),
]

DRAWN = """(robot) => {
  const { root, view, hello: { robots } } = cockpit;
  const { name, nodes } = robots.find((one) => one.name === robot);
  root.updateWorldMatrix(true, true);
  return Object.fromEntries(nodes.map(({ name: node }) => {
    const found = [];
    for (const child of view.group(name, node).children) child.traverse((object) => {
      if (!object.isMesh) return;
      const points = object.geometry.attributes.position;
      const box = [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
      for (let i = 0; i < points.count; i += 1) {
        const at = object.position.clone().set(points.getX(i), points.getY(i), points.getZ(i));
        root.worldToLocal(at.applyMatrix4(object.matrixWorld)).toArray().forEach((x, k) => {
          box[k] = Math.min(box[k], x);
          box[k + 3] = Math.max(box[k + 3], x);
        });
      }
      const { color, opacity } = object.material;
      found.push([...box, color.getHex(), opacity, points.count]);
    });
    return [node, found];
  }));
}"""
"""By node, of each mesh its bounding box in the world (m), its colour, opacity, and number of corners."""

CASES = {
    "rx90": ("arm", "joint2", 40.0, "d 450.0", "d 520.0", "tool"),
    "delta4": ("r1", "joint1", 15.0, "d 2000.0", "d 2100.0", "platform"),
}
"""The robot, a joint and an angle for it (degrees), a length of the text and another one, a node with graphics."""


def drawn(page, robot):
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return page.evaluate(DRAWN, robot)


def same(found, expected):
    """Check that two pages draw the same: to 1e-6 m, that of single precision."""
    assert set(found) == set(expected)
    for node, meshes in expected.items():
        assert len(found[node]) == len(meshes), node
        assert np.allclose(sorted(found[node]), sorted(meshes), rtol=0.0, atol=1e-6), node


def configuration(page, robot):
    """The values of a robot's joints (rad, m), by name."""
    names = "robot => cockpit.hello.robots.find(({ name }) => name === robot).joints.map(({ name }) => name)"
    return dict(zip(page.evaluate(names, robot), page.evaluate(f"cockpit.report.robots.{robot}.q"), strict=True))


def drawn_at(plain, mechanism, name, wanted):
    """What the page without an editor draws of a robot at a configuration (rad, m), by joint."""
    q = [wanted[joint] for joint in sorted(wanted, key=mechanism.q_index)]
    plain.evaluate("link => { location.hash = link; }", f"#{name}={','.join(map(repr, q))}")
    plain.wait_for_timeout(300)
    assert becomes(plain, "cockpit.report.rate.at_rest")
    assert configuration(plain, name) == pytest.approx(wanted, abs=1e-9)
    return drawn(plain, name)


def moved_at_least(found, other, node, metres):
    assert np.abs(np.subtract(found[node], other[node])[:, :6]).max() > metres


@pytest.mark.parametrize("name", ["delta4", *slow("rx90")])
def test_graphics_are_where_the_page_without_an_editor_has_them(name, root, tmp_path, tab, monkeypatch):  # noqa: F811
    monkeypatch.setenv("RAFF2URDF_MESH_PATH", str(root / "robots/graphics"))
    robot, joint, angle, length, other, node = CASES[name]
    path = root / "robots" / f"{name}.raff"
    text = path.read_text()
    assert length in text
    changed = text.replace(length, other)
    (tmp_path / "edited.raff").write_text(changed.replace('path "graphics/"', f'path "{root / "robots/graphics"}/"'))
    robots = {"written": cinegen.load(path), "edited": cinegen.load(tmp_path / "edited.raff")}
    (tmp_path / "plain.html").write_text(build_page(Setup(robots)))
    (tmp_path / "page.html").write_text(build_editor(text, path.name, folder=path.parent))
    plain, page = tab(tmp_path / "plain.html"), tab(tmp_path / "page.html")

    home = drawn(page, robot)
    assert len(home["base"]) + len(home[node]) > 3
    assert list(configuration(page, robot).values()) == pytest.approx(list(configuration(plain, "written").values()))
    same(home, drawn(plain, "written"))

    page.locator(f'[data-joint="{robot}/{joint}"] input[type=number]').fill(str(angle))
    page.keyboard.press("Enter")
    assert becomes(page, "cockpit.report.undo === 1 && cockpit.report.moving === null && cockpit.report.rate.at_rest")
    moved = drawn(page, robot)
    moved_at_least(moved, home, node, 0.01)
    same(moved, drawn_at(plain, robots["written"], "written", configuration(page, robot)))
    PICTURES.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=PICTURES / f"editor_graphics_{name}.png")

    edit(page, changed)
    assert becomes(page, "document.documentElement.dataset.read === 'yes' && cockpit.report?.rate.at_rest")
    longer = drawn(page, robot)
    moved_at_least(longer, moved, node, 0.01)
    same(longer, drawn_at(plain, robots["edited"], "edited", configuration(page, robot)))


VISIBLE = """() => cockpit.hello.robots[0].nodes.flatMap(({ name }) => cockpit.view.group("arm", name).children)
  .filter(({ name }) => name !== "triad").map(({ visible }) => visible)"""


@pytest.mark.slow
def test_a_file_that_is_not_in_the_page_is_reported_and_drawn_as_a_skeleton(root, tmp_path, tab):  # noqa: F811
    path = root / "robots" / "rx90.raff"
    text = path.read_text()
    (tmp_path / "edited.html").write_text(build_editor(text, path.name, folder=path.parent))
    page = tab(tmp_path / "edited.html")
    assert page.locator("#notes button").count() == 0
    home = drawn(page, "arm")
    wrong = text.replace('"rx90_base.dxf"', '"rx90_bas.dxf"')
    edit(page, wrong)
    assert becomes(page, "document.documentElement.dataset.read === 'yes' && cockpit.report !== null")
    line = next(i for i, one in enumerate(wrong.split("\n"), 1) if "rx90_bas.dxf" in one)
    column = wrong.split("\n")[line - 1].index('"rx90_bas.dxf"') + 1
    (note,) = page.locator("#notes button.warning").all_inner_texts()
    assert note.startswith(f"rx90.raff:{line}:{column}: the base is drawn as a skeleton, without 'rx90_bas.dxf': ")
    assert note.split("\n")[0].endswith(": did you mean 'graphics/rx90_base.dxf'?")
    page.locator("#notes button").click()
    assert becomes(page, "document.querySelector('#text .cm-lint-marker-warning') !== null")
    found = drawn(page, "arm")
    document = parse(text)
    (ball,) = SkeletonDrawing(document, document.robots[0]).draw(document.robots[0].base)
    ((*box, _, _, _),) = found["base"]
    radius = ball.geometry.sphere.radius
    assert box == pytest.approx([-radius, -radius, -radius, radius, radius, radius], abs=1e-6)
    same({**found, "base": home["base"]}, home)

    page.evaluate("document.querySelector('#bodies').value = 'skeleton'")
    page.evaluate("document.querySelector('#bodies').dispatchEvent(new Event('change'))")
    assert becomes(page, f"({VISIBLE})().every((one) => !one)")
    edit(page, text)
    assert becomes(page, "document.documentElement.dataset.read === 'yes' && cockpit.report !== null")
    drawn(page, "arm")
    assert becomes(page, f"({VISIBLE})().every((one) => !one)")
    page.evaluate("document.querySelector('#bodies').value = 'parts'")
    page.evaluate("document.querySelector('#bodies').dispatchEvent(new Event('change'))")
    assert becomes(page, f"({VISIBLE})().every((one) => one)")
    same(drawn(page, "arm"), home)
