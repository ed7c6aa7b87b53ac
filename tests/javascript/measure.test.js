import assert from "node:assert/strict";
import { test } from "node:test";

import { Vector3 } from "three";

import "./browser.js";

window.matchMedia ??= () => ({ matches: false, addEventListener: () => {} });
const { measured } = await import("../../cinegen/cockpit/static/pointer/measure.js");
const { units } = await import("../../cinegen/cockpit/static/base/units.js");

const point = (position, direction, origin = true) => ({
  position: new Vector3(...position),
  direction: new Vector3(...direction),
  origin,
});

test("distance, components and the angle of two axes", () => {
  const text = measured(point([0.1, 0, 0], [0, 0, 1]), point([0.4, -0.4, 1.2], [0, 1, 1]));
  assert.equal(text, "distance 1300.0 mm, dx 300.0 mm, dy -400.0 mm, dz 1200.0 mm, z axes at 45.0°");
});

test("axes and faces have no sense; a face and an axis have no angle", () => {
  const first = point([0, 0, 0], [0, 0, 2], false);
  assert.match(measured(first, point([0, 0, 1], [0, 0, -1], false)), /, faces at 0\.0°$/);
  assert.match(measured(first, point([0, 0, 1], [1, 0, -1], false)), /, faces at 45\.0°$/);
  assert.match(measured(first, point([0, 0, 1], [1, 0, 0], true)), /dz 1000\.0 mm$/);
  assert.match(measured(first, point([0, 0, 1], [0, 0, 0], false)), /dz 1000\.0 mm$/); // what has no faces
});

test("in the units of the page", () => {
  units.toggle();
  const text = measured(point([0, 0, 0], [0, 0, 1]), point([0, 0.5, 0], [1, 0, 0]));
  units.toggle();
  assert.equal(text, "distance 0.5000 m, dx 0.0000 m, dy 0.5000 m, dz 0.0000 m, z axes at 1.571 rad");
});
