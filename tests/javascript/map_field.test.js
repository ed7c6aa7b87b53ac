import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { kept, line } from "./browser.js";
import { loaded, serve, small } from "./map.js";

const { Field, got } = await import("../../cinegen/cockpit/static/map/field.js");

beforeEach(() => kept.clear());

test("the block of a map is read as the server wrote it", async () => {
  const map = small();
  const field = await loaded(map);
  for (const [name, array] of Object.entries(map.arrays)) assert.deepEqual(field.array(name), array, name);
  assert.equal(field.quantity, "sigma");
  assert.deepEqual(field.values(), map.arrays["value sigma"]);
  assert.equal(field.description().text, "least singular value");
  assert.deepEqual([...field.seen], [0, 1, 2, 3, 4, 5]);
  assert.equal(field.ready, true);
});

test("numbers that a map does not have are an error that names them; an unknown quantity has no values", async () => {
  const field = await loaded(small());
  assert.throws(() => field.array("edges"), /edges/);
  assert.equal(field.values("speed"), null);
  assert.equal(field.description("speed"), null);
});

test("a cut leaves cells up to an index, or one layer", async () => {
  const field = await loaded(small());
  let changes = 0;
  field.on("change", () => (changes += 1));
  field.choose({ cut: { axis: 0, index: 1, layer: false } });
  assert.deepEqual([...field.seen], [0, 1, 2, 3]);
  field.choose({ cut: { axis: 0, index: 1, layer: true } });
  assert.deepEqual([...field.seen], [2, 3]);
  field.choose({ cut: { axis: 1, index: 0, layer: true } });
  assert.deepEqual([...field.seen], [0, 2, 4]);
  field.choose({ cut: null });
  assert.equal(field.seen.length, 6);
  field.choose({ shown: false });
  assert.equal(field.seen.length, 0);
  assert.equal(changes, 5);
});

test("how large cells are is remembered, for clouds and surfaces apart", async () => {
  const cloud = await loaded(small());
  assert.equal(cloud.share, 0.6);
  cloud.choose({ share: 0.3 });
  assert.equal((await loaded(small())).share, 0.3);
  assert.equal((await loaded(small({ edges: true }))).share, 0.96);
});

test("a cloud all around the robot is cut open along its first axis", async () => {
  const map = small();
  assert.equal((await loaded(map)).cut, null);
  map.arrays.points.set([-1, -1, -1, 1, 1, 1]);
  assert.deepEqual((await loaded(map)).cut, { axis: 0, index: 1, layer: false });
});

test("of an axis that is no place, one layer is shown first", async () => {
  const map = small();
  map.about.axes[1].translates = false;
  assert.deepEqual((await loaded(map)).cut, { axis: 1, index: 1, layer: true });
});

test("a session without a map is ready at once", async () => {
  const session = await line();
  const field = new Field(session);
  assert.equal(field.ready, false);
  session.emit("hello", {});
  assert.equal(field.ready, true);
});

test("an answer that is an error is raised, with its address and status", async () => {
  serve(small());
  await assert.rejects(got("map/nothing"), { message: "map/nothing: 404" });
});
