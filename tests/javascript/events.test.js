import assert from "node:assert/strict";
import { mock, test } from "node:test";

import { Events } from "../../cinegen/cockpit/static/base/events.js";

test("listeners are called in order, each with the value of its own event", () => {
  const events = new Events();
  const last = [];
  events.on("a", (value) => last.push(["first", value])).on("a", (value) => last.push(["second", value]));
  events.on("b", (value) => last.push(["b", value]));
  events.emit("a", 1);
  events.emit("nobody listens", 2);
  assert.deepEqual(last, [["first", 1], ["second", 1]]);
});

test("a listener that fails stops no other, and is reported", () => {
  const logged = mock.method(console, "error", () => {});
  const events = new Events();
  const failure = new Error("broken");
  let last = 0;
  events.on("a", () => {
    throw failure;
  });
  events.on("a", () => (last += 1));
  events.emit("a");
  logged.mock.restore();
  assert.equal(last, 1);
  assert.deepEqual(logged.mock.calls.map((call) => call.arguments), [["a:", failure]]);
});
