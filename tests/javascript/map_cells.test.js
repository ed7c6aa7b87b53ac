import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { Group, Ray, Vector3 } from "three";

import { kept } from "./browser.js";
import { loaded, small } from "./map.js";

const { Cells } = await import("../../cinegen/cockpit/static/map/cells.js");

beforeEach(() => kept.clear()); // the share of a cell is remembered

/** Return the cells of a map beside a robot that stands at a pose. */
async function cellsOf(map, place = new Group()) {
  const steps = [];
  const view = {
    stage: new Group(),
    canvas: { height: 600 },
    before: (step) => steps.push(step),
    group: () => place,
    changed: () => {},
  };
  const field = await loaded(map);
  const cells = new Cells({ view, field });
  field.emit("cells");
  for (const step of steps) step();
  return { cells, field, drawn: () => view.stage.children[0].children[0], steps };
}

const ray = (from, to) => new Ray(new Vector3(...from), new Vector3(...to).sub(new Vector3(...from)).normalize());

test("a ray meets the nearest ball, and only balls that are seen", async () => {
  const { cells, field } = await cellsOf(small());
  const along = ray([-1, 0, 0], [1, 0, 0]); // through cells 0, 2 and 4
  assert.deepEqual(cells.met(along).cell, 0);
  assert.ok(Math.abs(cells.met(along).away - 1) < 1e-7);
  field.choose({ cut: { axis: 0, index: 1, layer: true } });
  assert.equal(cells.met(along).cell, 2);
  assert.ok(Math.abs(cells.met(along).away - 1.1) < 1e-7);
  field.choose({ shown: false });
  assert.equal(cells.met(along), null);
});

test("a ball is as large as its share of a cell", async () => {
  const { cells, field } = await cellsOf(small());
  const past = (y) => cells.met(ray([-1, -y, 0], [1, -y, 0]));
  assert.equal(field.share, 0.6); // of 0.1 m: a radius of 0.03 m
  assert.equal(past(0.029)?.cell, 0);
  assert.equal(past(0.031), null);
  field.choose({ share: 0.9 });
  assert.equal(past(0.044)?.cell, 0);
  assert.equal(past(0.046), null);
});

test("a slanting ray meets the ball that it passes through", async () => {
  const { cells } = await cellsOf(small());
  for (const [cell, at] of [[3, [0.1, 0.1, 0]], [4, [0.2, 0, 0]]]) {
    const [x, y, z] = at;
    const from = [x - 0.3, y + 0.4, z + 1.2]; // 1.3 m away
    const met = cells.met(ray(from, at));
    assert.equal(met.cell, cell);
    assert.ok(Math.abs(met.away - 1.3) < 1e-6);
    const [dx, dy] = [0.035 * 0.8, 0.035 * 0.6]; // across the ray, past the ball of 0.03 m
    assert.equal(cells.met(ray([from[0] + dx, from[1] + dy, from[2]], [x + dx, y + dy, z])), null);
  }
});

test("nothing behind the eye is met", async () => {
  const { cells } = await cellsOf(small());
  assert.equal(cells.met(ray([-1, 0, 0], [-2, 0, 0])), null);
});

test("a ray meets the tile whose edges are around it", async () => {
  const { cells, field } = await cellsOf(small({ edges: true }));
  const half = 0.5 * 0.1 * field.share;
  const above = (x, y) => cells.met(ray([x, y, 1], [x, y, 0]));
  assert.equal(above(0, 0).cell, 0);
  assert.equal(above(0.2, 0.1).cell, 5);
  assert.ok(Math.abs(above(0.2, 0.1).away - 1) < 1e-6);
  assert.equal(above(0.1 + 0.98 * half, -0.98 * half).cell, 2);
  assert.equal(above(0.1, -1.02 * half), null);
});

test("cells move with the robot beside which the map is", async () => {
  const place = new Group();
  place.position.set(0, 0, 2);
  place.rotation.set(0, 0, Math.PI / 2);
  const { cells } = await cellsOf(small(), place);
  const middle = cells.middle(2); // at (0.1, 0, 0) as seen by the robot
  assert.ok(middle.distanceTo(new Vector3(0, 0.1, 2)) < 1e-7);
  assert.equal(cells.met(ray([1, 0.1, 2], [0, 0.1, 2])).cell, 2);
});

test("all cells are drawn in one object, grey where nothing is known", async () => {
  const { drawn, field } = await cellsOf(small());
  const { position, color } = drawn().geometry.attributes;
  assert.deepEqual(position.array, field.array("points"));
  const rgb = (cell) => Array.from(color.array.subarray(3 * cell, 3 * cell + 3), (part) => Number(part.toFixed(2)));
  assert.deepEqual(rgb(0), [0.27, 0, 0.33]);
  assert.deepEqual(rgb(4), [0.62, 0.62, 0.62]);
  assert.deepEqual(rgb(5), [0.99, 0.91, 0.15]);
});

test("where all values are the same, all cells have the colour of the lowest", async () => {
  const map = small();
  map.arrays["value sigma"].fill(0.5);
  Object.assign(map.about.quantities[0], { low: 0.5, high: 0.5 });
  const { drawn } = await cellsOf(map);
  const { array } = drawn().geometry.attributes.color;
  for (let i = 0; i < array.length; i += 1) assert.equal(array[i], array[i % 3]);
  assert.ok(Math.abs(array[0] - 0x44 / 255) < 1e-6);
});

test("tiles are drawn with four corners each, as large as their share", async () => {
  const { drawn, field } = await cellsOf(small({ edges: true }));
  const { geometry } = drawn();
  assert.equal(geometry.attributes.position.count, 4 * 6);
  assert.equal(geometry.index.count, 6 * 6);
  const half = 0.5 * 0.1 * field.share;
  const corners = Array.from(geometry.attributes.position.array.subarray(0, 12), (x) => Number((x / half).toFixed(4)));
  assert.deepEqual(corners, [-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]);
  geometry.computeBoundingBox();
  assert.ok(geometry.boundingBox.min.distanceTo(new Vector3(-half, -half, 0)) < 1e-7);
  assert.ok(geometry.boundingBox.max.distanceTo(new Vector3(0.2 + half, 0.1 + half, 0)) < 1e-7);
});
