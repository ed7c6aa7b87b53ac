"""What stands over the scene, in windows of all sizes: nothing covers the part's toolbar, and no text is cut off."""

import pytest
from tabs import becomes

# The page as a server has it: all parts are shown that a page without a server hides.
PREPARE = """() => {
  document.documentElement.removeAttribute("data-source");
  document.getElementById("fold").click();
  document.getElementById("hint").textContent = "Drag any part of the robot, or click a cell: it goes there.";
  document.getElementById("measure-mode").click();
  document.getElementById("cover").textContent = "Connection lost, trying again.";
  for (let i = 0; i < 2; i += 1) {
    const toast = document.createElement("div");
    toast.className = "toast warning";
    toast.textContent = `${i}: Home of rx90 is in another assembly mode: it was moved there without a path`;
    document.getElementById("toasts").append(toast);
  }
  const legend = document.getElementById("legend");
  legend.querySelector(".name").textContent = "condition, dimensionless";
  legend.querySelector(".low").textContent = "0.01";
  legend.querySelector(".high").textContent = "1";
}"""
# Pairs of boxes that meet, boxes that are not whole, and controls of the toolbar that something covers.
FAULTS = """async (shown) => {
  const all = ["hint", "crowd", "cover", "legend", "toasts"];
  for (const id of all) document.getElementById(id).hidden = !shown.includes(id);
  for (let i = 0; i < 2; i += 1) await new Promise(requestAnimationFrame);
  const pane = document.getElementById("pane").getBoundingClientRect();
  const boxes = ["bar", "panel", "foot", "selection", "measure", ...shown]
    .map((id) => [id, document.getElementById(id).getBoundingClientRect()]).filter(([, box]) => box.width > 0);
  const meets = (one, other) => one.left < other.right - 1 && other.left < one.right - 1
    && one.top < other.bottom - 1 && other.top < one.bottom - 1;
  const faults = [];
  boxes.forEach(([id, box], i) => {
    for (const [other, second] of boxes.slice(0, i)) if (meets(box, second)) faults.push(`${id} meets ${other}`);
    if (i < 3) return;
    const { left, right, top, bottom } = pane;
    if (box.left < left || box.right > right || box.top < top || box.bottom > bottom) faults.push(`${id} is not whole`);
  });
  if (shown.includes("cover")) return faults.filter((fault) => !fault.includes("selection")); // it is not seen then
  if (!boxes.some(([id]) => id === "selection")) faults.push("no toolbar");
  for (const control of document.querySelectorAll(":is(#selection, #measure) :is(button, select, input)")) {
    if (!control.checkVisibility()) continue;
    const { x, y, width, height } = control.getBoundingClientRect();
    const found = document.elementFromPoint(x + width / 2, y + height / 2);
    if (!control.contains(found)) faults.push(`${control.id} is covered`);
  }
  return faults;
}"""
# Texts that are wider than their element or stand out of the window.
CUT = """() => [...document.querySelectorAll("#bar, #pane > :not(#scene), #panel, #foot")].flatMap((part) =>
  [part, ...part.querySelectorAll("*")].filter((one) => {
    if (one.checkVisibility?.() === false) return false;
    if (one.matches("button, select") && one.getBoundingClientRect().right > window.innerWidth) return true;
    const own = [...one.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim() !== "");
    if (!own || one.closest(".unseen, .word, option")) return false;
    const { left, right, width } = one.getBoundingClientRect();
    if (width === 0) return false;
    const style = getComputedStyle(one);
    const shortened = style.textOverflow === "ellipsis" && (one.title || one.closest("[title]"));
    const hidden = style.overflowX !== "visible" && one.scrollWidth > one.clientWidth + 1 && !shortened;
    return hidden || left < -1 || right > window.innerWidth + 1;
  }).map((one) => `${one.tagName} ${one.id} ${one.textContent}`))"""
TOGETHER = (["hint"], ["toasts"], ["crowd"], ["legend"], ["cover"])
ALL = ["hint", "toasts", "crowd", "legend", "cover"]
SIZES = [(360, 640), (640, 360), (900, 560), (2560, 1440)]  # the second: 1280 x 720 at a zoom of 200 %


def test_nothing_covers_the_toolbar_and_no_text_is_cut(page_of, tab):
    page = tab(page_of("rx90"))
    page.evaluate(PREPARE)
    page.evaluate("cockpit.select('rx90', 'tool')")
    faults = []
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        assert becomes(page, f"innerWidth === {width} && innerHeight === {height}")
        page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        roomy = width >= 900 and height >= 560
        for shown in (*TOGETHER, *([ALL] if roomy else [])):
            faults += [f"{width}x{height}, {' '.join(shown)}: {fault}" for fault in page.evaluate(FAULTS, shown)]
        faults += [f"{width}x{height}: {text} is cut" for text in page.evaluate(CUT)]
    assert faults == []
    assert page.evaluate("parseFloat(getComputedStyle(document.documentElement).fontSize)") >= 16


def test_reduced_motion_and_forced_colours(page_of, tab):
    page = tab(page_of("rx90"), viewport={"width": 700, "height": 500}, reduced_motion="reduce", forced_colors="active")
    camera = "cockpit.viewer.camera.matrixWorld.toArray()"
    before = page.evaluate(camera)
    page.evaluate("cockpit.send({ type: 'move_joint', robot: 'rx90', joint: 'joint2', value: 0.9 })")  # out of the view
    assert becomes(page, "Math.abs(cockpit.report.robots.rx90.q[1] - 0.9) < 1e-9")
    page.wait_for_timeout(300)
    assert page.evaluate(camera) == pytest.approx(before, abs=1e-6)  # m; a motion is of decimetres
    page.click("#fold")
    # what only a colour showed has an edge or the system's colours
    shown = page.evaluate("""() => {
      cockpit.select("rx90", "tool");
      const of = (selector, pseudo) => getComputedStyle(document.querySelector(selector), pseudo);
      return {
        chip: of("#status", "::before").borderTopStyle, meter: of(".meter .scale").borderTopStyle,
        slider: of("[data-joint] input[type=range]").appearance,
        bar: of(".meter .scale > b").backgroundColor, paper: of(".meter .scale").backgroundColor,
        pressed: of("#move").backgroundColor, other: of("#turn").backgroundColor,
      };
    }""")
    assert (shown["chip"], shown["meter"], shown["slider"]) == ("solid", "solid", "auto")
    assert shown["bar"] != shown["paper"]
    assert shown["pressed"] != shown["other"]
