import assert from "node:assert/strict";
import { mock, test } from "node:test";

import { Events } from "../../cinegen/cockpit/static/base/events.js";

test("listeners are called in order, each with the value of its own event", () => {
  const events = new Events();
  const told = [];
  events.on("a", (value) => told.push(["first", value])).on("a", (value) => told.push(["second", value]));
  events.on("b", (value) => told.push(["b", value]));
  events.tell("a", 1);
  events.tell("nobody listens", 2);
  assert.deepEqual(told, [["first", 1], ["second", 1]]);
});

test("a listener that fails stops no other, and is reported", () => {
  const logged = mock.method(console, "error", () => {});
  const events = new Events();
  const failure = new Error("broken");
  let told = 0;
  events.on("a", () => {
    throw failure;
  });
  events.on("a", () => (told += 1));
  events.tell("a");
  logged.mock.restore();
  assert.equal(told, 1);
  assert.deepEqual(logged.mock.calls.map((call) => call.arguments), [["a:", failure]]);
});
