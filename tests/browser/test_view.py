"""What is seen of robots: how much of the view they fill, in which colours, and what is drawn when nothing changes."""

import numpy as np
import pytest
from tabs import becomes, find, grab
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.cockpit.cockpit import draw
from cinegen.cockpit.page import Page
from cinegen.session import Setup, arrange

SMALL = {"width": 450, "height": 280}
"""Where all pixels are drawn, which takes long in software."""

# The rectangle of all vertices of parts on the screen, of which the whole is 2 by 2: its size and its middle.
RECTANGLE = """() => {
  const { view, viewer: { camera } } = cockpit;
  const at = new MeshCat.THREE.Vector3();
  const seen = [[], []];
  camera.updateWorldMatrix(true, false);
  for (const robot of view.root.children.filter(({ name }) => !view.background.has(name.slice(1)))) {
    for (const part of robot.children.flatMap((node) => node.children)) {
      if (/^(triad$|loop )/.test(part.name)) continue;
      part.traverse(({ isMesh, geometry, matrixWorld }) => {
        for (let i = 0; isMesh && i < geometry.attributes.position.count; i += 1) {
          at.fromBufferAttribute(geometry.attributes.position, i).applyMatrix4(matrixWorld).project(camera);
          seen[0].push(at.x);
          seen[1].push(at.y);
        }
      });
    }
  }
  const ends = seen.map((all) => [all.reduce((a, b) => Math.min(a, b)), all.reduce((a, b) => Math.max(a, b))]);
  return [ends.map(([a, b]) => (b - a) / 2), ends.map(([a, b]) => (a + b) / 2)];
}"""
FRAMES = """new Promise((done) => {
  let frames = 20;
  const next = () => (frames-- ? requestAnimationFrame(next) : done());
  next();
})"""
MEMORY = """() => {
  const { memory: { geometries, textures }, programs } = cockpit.viewer.renderer.info;
  return [programs.length, geometries, textures, document.querySelectorAll(":not(#announcer *, .labels *)").length];
}"""
# The colour of the middle of the first box, in a complete picture or one of a motion.
LIT = """(complete) => {
  const { view, viewer } = cockpit;
  const box = view.group("box", "box");
  const { x, y } = new MeshCat.THREE.Vector3().applyMatrix4(box.matrixWorld).project(viewer.camera);
  const { width, height } = view.canvas;
  const picture = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
  const { choose } = view.resolution;
  view.resolution.choose = () => (view.resolution.complete = complete);
  view.picture();
  view.resolution.choose = choose;
  picture.drawImage(view.canvas, 0, 0);
  return [...picture.getImageData((1 + x) / 2 * width, (1 - y) / 2 * height, 1, 1).data].slice(0, 3);
}"""

# The calls that draw a complete picture in which one leg is hidden and another lit up, and its pixels; with every part
# drawn by itself or not, as those are that are transparent.
TOGETHER = """async (alone) => {
  const { view, viewer } = cockpit;
  view.group("gough", "link9").visible = false;
  view.group("gough", "link15").traverse(({ userData: { made } }) => made?.matt.emissive.setHex(0x304060));
  view.root.traverse(({ userData: { made } }) => { if (made) made.matt.transparent = alone; });
  viewer.num_messages_received += 1; // parts are looked at anew
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  const { width, height } = view.canvas;
  const picture = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
  view.picture();
  const { calls } = viewer.renderer.info.render;
  picture.drawImage(view.canvas, 0, 0);
  return [calls, [...picture.getImageData(0, 0, width, height).data]];
}"""


def chain(count):
    """RAFF of a chain that winds up."""
    links = "".join(
        f"link {i} {{ parameters {{ theta 20.0 d {100.0 * (i > 1)} r 5.0 }} type 2 pred {i - 1} }}\n"
        for i in range(1, count + 1)
    )
    return f"RAFF Chain\nrobot chain {{\nbase {{ }}\n{links}}}\n"


def box(size, colour="1 1 1"):
    """Two boxes beside each other, seen from above. The first has a colour."""
    shape = f'<geometry><box size="{size} {size} {size}"/></geometry>'
    paint = f'<material name="paint"><color rgba="{colour} 1"/></material>'
    visuals = {"box": f"<visual>{shape}{paint}</visual>", "lid": f'<visual><origin xyz="{size} 0 0"/>{shape}</visual>'}
    return cinegen.load(urdf_text([UrdfJoint("turn", "box", "lid")], visuals, "box"))


def share(page):
    """The larger of the shares of the view's width and height that the robots fill, if they are in its middle."""
    sizes, middle = page.evaluate(RECTANGLE)
    assert np.abs(middle).max() < 0.1
    return max(sizes)


@pytest.mark.parametrize(
    ("name", "size"),
    [
        *((name, (1440, 900)) for name in ("five_bar", "chain", "box")),
        *(("gough", size) for size in ((390, 844), (2200, 700))),
    ],
)
def test_robots_fill_most_of_the_view_at_first(robot, cockpit, tab, name, size):
    made = {"chain": lambda: cinegen.load(chain(60)), "box": lambda: box(2e-8)}
    shown = cockpit(setup=arrange({name: made[name]() if name in made else robot(name)}))
    assert 0.62 < share(tab(shown, viewport=dict(zip(("width", "height"), size, strict=True)))) < 0.78


def test_pictures_from_outside_are_filled_too(cockpit, tab):
    page = tab(f"{cockpit('delta4').url}&camera=1", ready="document.documentElement.dataset.view === 'ready'")
    assert 0.62 < share(page) < 0.78


def test_another_size_of_the_window_is_filled_too_unless_a_person_has_moved_the_camera(cockpit, tab):
    shown = cockpit("delta4")
    page = tab(shown, viewport={"width": 390, "height": 844})
    page.set_viewport_size({"width": 844, "height": 390})
    assert becomes(page, lambda: 0.62 < share(page) < 0.78)
    page.keyboard.press("-")
    page.evaluate("cockpit.view.canvas.focus()")
    page.keyboard.press("-")
    before = page.evaluate("cockpit.view.cameraNumbers()")
    page.set_viewport_size({"width": 390, "height": 844})
    assert becomes(page, "cockpit.viewer.camera.aspect < 1")
    assert page.evaluate("cockpit.view.cameraNumbers()") == pytest.approx(before)
    page.keyboard.press("f")
    assert becomes(page, lambda: 0.62 < share(page) < 0.78)


@pytest.mark.parametrize(("once", "least", "most"), [("true", 0.78, 0.88), ("false", 0.89, 0.97)])
def test_a_robot_that_leaves_the_view_is_brought_back_with_room_where_the_camera_moves_once(
    cockpit, tab, once, least, most
):
    page = tab(cockpit("delta4"))
    page.evaluate(f"""() => {{
      const {{ view, viewer: {{ camera }} }} = cockpit;
      camera.position.lerp(view.controls.target, 0.6);
      view.keep({once});
    }}""")
    assert least < share(page) < most


@pytest.mark.parametrize(
    ("scheme", "colour", "expected"),
    [
        ("light", "0.8 0.45 0.2", "0.8 0.45 0.2"),
        ("light", "0.2 0.2 0.2", "0.2 0.2 0.2"),
        ("dark", "0.9 0.9 0.9", "0.9 0.9 0.9"),
        ("dark", "0.16 0.35 0.44", "0.24 0.52 0.65"),
    ],
)
def test_a_face_in_full_light_has_the_colour_of_its_material(cockpit, tab, scheme, colour, expected):
    """On a dark page a dark colour is brighter, so that it is seen before it; what is darker stays so."""
    page = tab(cockpit(setup=Setup({"box": box(0.5, colour)})), drawn=True, viewport=SMALL, color_scheme=scheme)
    for complete in (True, False):
        seen = np.array(page.evaluate(LIT, complete)) / 255.0
        assert np.abs(seen - np.array(expected.split(), dtype=float)).max() < 0.08, complete


def test_parts_that_are_drawn_at_once_look_as_if_each_was_drawn_alone(cockpit, tab):
    page = tab(cockpit("gough", follow=None), drawn=True, viewport=SMALL, reduced_motion="reduce")
    page.evaluate("cockpit.view.chosen = true")  # the view is not framed again
    (few, together), (many, apart) = (page.evaluate(TOGETHER, alone) for alone in (False, True))
    assert few < 0.6 * many
    differences = np.abs(np.array(together) - apart)
    assert (differences > 3).sum() < 10  # of a hundred thousand pixels: a matrix is rounded elsewhere


def test_nothing_is_drawn_while_nothing_changes_and_motions_leave_nothing_behind(opened):
    shown, page = opened("five_bar")
    page.evaluate("""() => {
      window.drawn = 0;
      const { viewer } = cockpit;
      const render = viewer.render.bind(viewer);
      viewer.render = () => (render(), (drawn += 1));
    }""")
    assert becomes(page, "cockpit.view.resolution.complete")

    def nothing_is_drawn():  # once the last messages of a page that was opened have come
        before = page.evaluate("drawn")
        page.evaluate(FRAMES)
        return page.evaluate("drawn") == before

    assert becomes(page, nothing_is_drawn)
    before = page.evaluate("drawn")
    grab(page, shown, "five_bar", "link4")
    page.mouse.up()
    assert becomes(page, f"drawn > {before}")
    assert find(page, "five_bar", "link4")


def test_robots_that_are_drawn_again_and_again_take_no_more_memory(opened):
    shown, page = opened("five_bar")
    taken = []
    for _ in range(4):
        heard = page.evaluate("cockpit.viewer.num_messages_received")
        again = Page()
        draw(again, shown.setup)
        shown.page.replace("/meshcat/cinegen", again)
        assert becomes(page, f"cockpit.viewer.num_messages_received > {heard} && cockpit.view.whole")
        assert becomes(page, "!cockpit.viewer.needs_render && cockpit.view.resolution.complete")
        taken.append(page.evaluate(MEMORY))
    programs, *others = zip(*taken[1:], strict=True)
    assert [len(set(series)) for series in others] == [1, 1, 1]
    assert programs[-1] <= programs[0] + 2  # one more for what is drawn while something moves
