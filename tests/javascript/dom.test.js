import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";

import { kept } from "./browser.js";

const { atMostEvery, memory } = await import("../../cinegen/cockpit/static/base/dom.js");

let now = 0;
mock.method(performance, "now", () => now);

function pass(milliseconds) {
  now += milliseconds;
  mock.timers.tick(milliseconds);
}

beforeEach(() => {
  mock.timers.reset();
  mock.timers.enable({ apis: ["setTimeout"] });
  kept.clear();
});

test("an action runs at once, then at most once in an interval, with the newest value", () => {
  const done = [];
  const offer = atMostEvery(100, (value) => done.push(value));
  for (const value of [1, 2, 3]) offer(value);
  assert.deepEqual(done, [1]);
  pass(99);
  assert.deepEqual(done, [1]);
  pass(1);
  assert.deepEqual(done, [1, 3]);
  pass(500);
  assert.deepEqual(done, [1, 3]);
  offer(4);
  assert.deepEqual(done, [1, 3, 4]);
});

test("what waits is done now by flush, and never after stop", () => {
  const done = [];
  const offer = atMostEvery(100, (value) => done.push(value));
  offer(1);
  offer.flush();
  assert.deepEqual(done, [1]);
  offer(2);
  offer.flush();
  assert.deepEqual(done, [1, 2]);
  offer(3);
  offer.stop();
  pass(1000);
  assert.deepEqual(done, [1, 2]);
});

test("memory returns what was kept, unless it is of another type or damaged", () => {
  assert.equal(memory.get("open", true), true);
  memory.set("open", false);
  assert.equal(memory.get("open", true), false);
  kept.set("cinegen.open", '"yes"');
  assert.equal(memory.get("open", true), true);
  kept.set("cinegen.open", "{");
  assert.equal(memory.get("open", true), true);
  kept.set("cinegen.open", "null");
  assert.equal(memory.get("open", true), true);
});
