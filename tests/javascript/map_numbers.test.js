import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { colour, GRADIENT, UNKNOWN } = await import("../../cinegen/cockpit/static/map/colours.js");
const { formatted, valueOf } = await import("../../cinegen/cockpit/static/map/numbers.js");
const { units } = await import("../../cinegen/cockpit/static/base/units.js");

function rgb(part) {
  const into = [9, 0, 0, 0, 9];
  colour(part, into, 1);
  assert.deepEqual([into[0], into[4]], [9, 9], "only three numbers are written");
  return into.slice(1, 4);
}

test("colours go from viridis' first to its last, linearly between stops", () => {
  assert.deepEqual(rgb(0), [0x44 / 255, 0x01 / 255, 0x54 / 255]);
  assert.deepEqual(rgb(1), [0xfd / 255, 0xe7 / 255, 0x25 / 255]);
  assert.deepEqual(rgb(-3), rgb(0));
  assert.deepEqual(rgb(7), rgb(1));
  const [first, second, between] = [rgb(0), rgb(1 / 9), rgb(0.5 / 9)];
  for (let k = 0; k < 3; k += 1) assert.ok(Math.abs(between[k] - 0.5 * (first[k] + second[k])) < 1e-12);
});

test("what has no value is grey", () => {
  for (const part of [NaN, Infinity, -Infinity]) assert.deepEqual(rgb(part), UNKNOWN);
});

test("the bar has the same ends as the colours", () => {
  assert.match(GRADIENT, /^linear-gradient\(to right, rgb\(68 1 84\), .*rgb\(253 231 37\)\)$/);
});

test("values have three digits and their unit", () => {
  assert.equal(formatted(0.123456, "1"), "0.123");
  assert.equal(formatted(1.5, "m s-1"), "1.5 m/s");
  assert.equal(formatted(12.3456, "m"), "12.3 m");
  assert.equal(formatted(0, "m"), "0 m");
  assert.equal(formatted(0.00012345, "1"), "1.2e-4");
  assert.equal(formatted(-123456, "1"), "-1.2e+5");
  assert.equal(formatted(99999, "1"), "100000");
  assert.equal(formatted(Infinity, "m"), "∞");
  assert.equal(formatted(NaN, "m"), "–");
  assert.equal(formatted(-Infinity, "m"), "–");
});

test("an index along an axis is told as a length or an angle", () => {
  units.small = true;
  assert.equal(valueOf({ unit: "m", low: -0.5, step: 0.1 }, 2), "-300.0 mm");
  assert.equal(valueOf({ unit: "rad", low: 0, step: Math.PI / 4 }, 2), "90.0°");
});
