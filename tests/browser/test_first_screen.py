"""The first screen: the robot, and next to nothing else. Everything else is a few clicks away."""

import pytest
from tabs import becomes, picture

from cinegen.collision import scene_of
from cinegen.session import arrange, scene_setup

MOST_WORDS, MOST_CONTROLS = 30, 8
SIZES = [(1440, 900), (390, 844)]
# Words that are read, and controls that can be pressed, before anything is done.
COUNTED = """() => {
  const seen = (one) => {
    const { width, height } = one.getBoundingClientRect();
    return one.checkVisibility({ visibilityProperty: true, opacityProperty: true }) && width > 1 && height > 1;
  };
  const words = [], walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node; (node = walker.nextNode()) !== null;) {
    if (seen(node.parentElement)) words.push(...(node.textContent.match(/[\\p{L}\\p{N}]+/gu) ?? []));
  }
  const controls = [...document.querySelectorAll("button, input, select, textarea, a, summary")].filter(seen);
  return { words, controls: controls.map((one) => one.id || one.outerHTML) };
}"""
# Whether the first hint is there, and where it is no part is seen.
UNCOVERED = """() => {
  const hint = document.querySelector(".label.hint");
  const { left, right, top, bottom } = hint.getBoundingClientRect();
  const across = [0, 0.25, 0.5, 0.75, 1].map((part) => left + part * (right - left));
  const points = across.flatMap((clientX) => [top, bottom].map((clientY) => ({ clientX, clientY })));
  return bottom <= innerHeight && points.every((point) => cockpit.pick.touched(point) === null);
}"""
POLE = {"name": "pole", "kind": "capsule", "radius": 0.03, "length": 1.0, "point": [0.45, 0.25, 0.5]}


def setup_of(name, robot):
    """What `cinegen drive` shows; "scene" has an obstacle."""
    if name == "scene":
        said = {"robot": "arm7.raff", "goal": {"point": [0.3, 0.3, 0.3]}, "obstacle": [POLE]}
        return scene_setup(scene_of(said, mechanism=robot("arm7")))
    return arrange({name: robot(name)}, follow="circle" if name == "delta4" else None)


@pytest.mark.parametrize("name", ["delta4", "two_arms", "scene"])
def test_it_has_few_words_and_controls(opened, robot, name):
    _, page = opened(setup=setup_of(name, robot))
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        assert becomes(page, f"innerWidth === {width}")
        counted = page.evaluate(COUNTED)
        picture(page, f"first_screen_{name}_{width}")
        assert 0 < len(counted["words"]) <= MOST_WORDS, counted["words"]
        assert 0 < len(counted["controls"]) <= MOST_CONTROLS, counted["controls"]
        assert becomes(page, UNCOVERED)
