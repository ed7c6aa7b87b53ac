import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import "./browser.js";

const { Pace } = await import("../../cinegen/cockpit/static/view/pace.js");

let ratios;
let now;
let slow;

function paced(still = false) {
  const viewer = { renderer: { setPixelRatio: (ratio) => ratios.push(ratio) }, set_3d_pane_size: () => {} };
  const pace = new Pace(viewer, still);
  pace.on("slow", () => (slow += 1));
  return pace;
}

/** Draws pictures of a motion that take so long each, ms. */
function draw(pace, pictures, time) {
  for (let i = 0; i < pictures; i += 1) {
    pace.choose(true);
    pace.drew(now, true);
    now += time;
  }
}

beforeEach(() => {
  ratios = [];
  now = 1000;
  slow = 0;
});

test("quick pictures keep all pixels", () => {
  const pace = paced();
  draw(pace, 100, 20);
  assert.deepEqual(ratios, []);
  assert.equal(pace.due(now + 10_000), false);
  assert.ok(Math.abs(pace.mean - 20) < 1e-9);
});

test("the mean follows the time from picture to picture, and leaves out pictures of a robot that rests", () => {
  const pace = paced();
  draw(pace, 2, 20);
  draw(pace, 1, 70);
  draw(pace, 1, 0);
  assert.ok(Math.abs(pace.mean - (0.8 * 20 + 0.2 * 70)) < 1e-9);
  pace.drew(now + 500, false);
  pace.drew(now + 900, true);
  assert.ok(Math.abs(pace.mean - 30) < 1e-9);
});

test("slow pictures get fewer pixels while that helps, and all of them when the robot rests", () => {
  const pace = paced();
  draw(pace, 10, 200);
  assert.deepEqual(ratios, [1]);
  draw(pace, 8, 100);
  assert.deepEqual(ratios, [1, 0.75]);
  draw(pace, 20, 30);
  assert.deepEqual(ratios, [1, 0.75]);
  assert.equal(pace.due(now), false);
  assert.equal(pace.due(now + 400), true);
  pace.choose(false);
  assert.deepEqual(ratios, [1, 0.75, 2]);
  assert.equal(pace.due(now + 400), false);
});

test("fewer pixels that do not help are given back, and slowness is told", () => {
  const pace = paced();
  draw(pace, 60, 200);
  assert.deepEqual(ratios, [1, 2]);
  assert.ok(slow > 0);
});

test("where pictures are taken from outside, all have all pixels", () => {
  const pace = paced(true);
  draw(pace, 100, 500);
  assert.deepEqual(ratios, []);
  assert.equal(slow, 0);
});

test("a pause between two motions says nothing of how long pictures take", () => {
  const pace = paced();
  for (let i = 0; i < 20; i += 1) {
    draw(pace, 2, 20);
    now += 5000;
  }
  assert.deepEqual(ratios, []);
  assert.ok(Math.abs(pace.mean - 20) < 1e-9);
});
