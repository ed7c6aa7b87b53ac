import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";

import { line } from "./browser.js";

const { Gamepad, twistOf } = await import("../../cinegen/cockpit/static/base/gamepad.js");
const { Session } = await import("../../cinegen/cockpit/static/base/session.js");

const buttons = (pressed = {}) => Array.from({ length: 8 }, (_, i) => ({ value: pressed[i] ?? 0, pressed: i in pressed }));
let pads = [];
Object.defineProperty(globalThis, "navigator", { value: { getGamepads: () => pads }, configurable: true });

test("sticks, triggers and shoulder buttons make a twist", () => {
  assert.deepEqual(twistOf({ axes: [1, -1, 0, 0], buttons: buttons() }), [1, 1, 0, 0, 0, 0]);
  assert.deepEqual(twistOf({ axes: [0, 0, 1, -1], buttons: buttons() }), [0, 0, 0, -1, 1, 0]);
  assert.deepEqual(twistOf({ axes: [], buttons: buttons({ 7: 1, 5: 1 }) }), [0, 0, 1, 0, 0, -1]);
  assert.deepEqual(twistOf({ axes: [], buttons: [] }), [0, 0, 0, 0, 0, 0]);
});

test("within the dead zone nothing moves, and from its edge the twist grows from 0 to 1", () => {
  const x = (value) => twistOf({ axes: [value], buttons: [] })[0];
  assert.deepEqual([x(0.05), x(-0.05)], [0, 0]);
  assert.ok(x(0.06) > 0 && x(0.06) < 0.02);
  assert.deepEqual([x(0.525), x(1), x(-1), x(1.2)], [0.5, 1, -1, 1]);
});

beforeEach(() => {
  mock.timers.reset();
  mock.timers.enable({ apis: ["setInterval"] });
});

test("a gamepad is read only while a node follows it, and says once that it rests", async () => {
  const link = await line();
  new Gamepad(new Session(link));
  link.emit("hello", { client: 1, robots: [], sensors: [{ id: "pad", url: "gamepad:0" }] });
  pads = [null, { connected: true, axes: [1, 0], buttons: buttons({ 0: 1 }) }];
  mock.timers.tick(100);
  assert.deepEqual(link.sent, []);
  for (let i = 0; i < 2; i += 1) link.emit("report", { switches: [{ robot: "arm", node: "tool", sensor: "pad" }] });
  mock.timers.tick(34);
  assert.deepEqual(link.sent.splice(0), [{ type: "gamepad_input", twist: [1, 0, 0, 0, 0, 0], buttons: [0] }]);
  pads = [];
  mock.timers.tick(340);
  assert.deepEqual(link.sent.splice(0), [{ type: "gamepad_input", twist: [0, 0, 0, 0, 0, 0], buttons: [] }]);
  pads = [{ connected: true, axes: [1], buttons: buttons() }];
  link.emit("report", { switches: [{ robot: "arm", node: "tool", sensor: null }] });
  mock.timers.tick(340);
  assert.deepEqual(link.sent, []);
});
