import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import "./browser.js";

const { Resolution } = await import("../../cinegen/cockpit/static/view/resolution.js");

let ratios;
let now;
let slow;

function paced(still = false) {
  const viewer = { renderer: { setPixelRatio: (ratio) => ratios.push(ratio) }, set_3d_pane_size: () => {} };
  const resolution = new Resolution(viewer, still);
  resolution.on("slow", () => (slow += 1));
  return resolution;
}

/** Draws pictures of a motion that take so long each, ms. */
function draw(resolution, pictures, time) {
  for (let i = 0; i < pictures; i += 1) {
    resolution.choose(true);
    resolution.drew(now, true);
    now += time;
  }
}

beforeEach(() => {
  ratios = [];
  now = 1000;
  slow = 0;
});

test("quick pictures keep all pixels", () => {
  const resolution = paced();
  draw(resolution, 100, 20);
  assert.deepEqual(ratios, []);
  assert.equal(resolution.due(now + 10_000), false);
  assert.ok(Math.abs(resolution.mean - 20) < 1e-9);
});

test("the mean follows the time from picture to picture, and leaves out pictures of a robot that rests", () => {
  const resolution = paced();
  draw(resolution, 2, 20);
  draw(resolution, 1, 70);
  draw(resolution, 1, 0);
  assert.ok(Math.abs(resolution.mean - (0.8 * 20 + 0.2 * 70)) < 1e-9);
  resolution.drew(now + 500, false);
  resolution.drew(now + 900, true);
  assert.ok(Math.abs(resolution.mean - 30) < 1e-9);
});

test("slow pictures get fewer pixels while that helps, and all of them when the robot rests", () => {
  const resolution = paced();
  draw(resolution, 10, 200);
  assert.deepEqual(ratios, [1]);
  draw(resolution, 8, 100);
  assert.deepEqual(ratios, [1, 0.75]);
  draw(resolution, 20, 30);
  assert.deepEqual(ratios, [1, 0.75]);
  assert.equal(resolution.due(now), false);
  assert.equal(resolution.due(now + 400), true);
  resolution.choose(false);
  assert.deepEqual(ratios, [1, 0.75, 2]);
  assert.equal(resolution.due(now + 400), false);
});

test("fewer pixels that do not help are given back, and slowness is last", () => {
  const resolution = paced();
  draw(resolution, 60, 200);
  assert.deepEqual(ratios, [1, 2]);
  assert.ok(slow > 0);
});

test("where pictures are taken from outside, all have all pixels", () => {
  const resolution = paced(true);
  draw(resolution, 100, 500);
  assert.deepEqual(ratios, []);
  assert.equal(slow, 0);
  assert.equal(resolution.complete, true);
});

test("shadows and reflections are left out while something moves where that is slow, before pixels are", () => {
  const resolution = paced();
  draw(resolution, 20, 20);
  assert.equal(resolution.complete, true);
  draw(resolution, 20, 50);
  assert.deepEqual([resolution.complete, ratios], [false, []]);
  draw(resolution, 20, 20);
  assert.equal(resolution.complete, false); // it would be slow again
  resolution.choose(false);
  assert.equal(resolution.complete, true);
});

test("a pause between two motions says nothing of how long pictures take", () => {
  const resolution = paced();
  for (let i = 0; i < 20; i += 1) {
    draw(resolution, 2, 20);
    now += 5000;
  }
  assert.deepEqual(ratios, []);
  assert.ok(Math.abs(resolution.mean - 20) < 1e-9);
});
