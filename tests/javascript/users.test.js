import assert from "node:assert/strict";
import { test } from "node:test";

import { kept, line } from "./browser.js";

const { Cursors, sendCursor, textOf } = await import("../../cinegen/cockpit/static/users/cursors.js");
const { COLOURS, profile } = await import("../../cinegen/cockpit/static/users/profile.js");
const { Session } = await import("../../cinegen/cockpit/static/base/session.js");
const { Events } = await import("../../cinegen/cockpit/static/base/events.js");
const { Vector3, Quaternion } = await import("three");

const ARM = { name: "arm", nodes: [{ name: "tool" }], joints: [], loops: [], couplings: [] };
const ADA = { client: 2, name: "Ada", colour: 3, robot: "arm", node: "tool", point: [0, 0, 1], dragging: false };

/** A session of this user, client 1, with labels, and a view in which the tool is at (1, 2, 3), turned about x by 180°. */
async function page() {
  const link = await line();
  const session = new Session(link);
  const all = new Map();
  const labels = {
    all,
    put: (key, text, point) => (text ? all.set(key, { text, point, element: { dataset: {} } }) : all.delete(key)),
  };
  const view = {
    canvas: new EventTarget(),
    pose: () => ({ position: new Vector3(1, 2, 3), quaternion: new Quaternion(1, 0, 0, 0) }),
  };
  new Cursors({ view, session, labels });
  link.emit("hello", { client: 1, robots: [ARM] });
  return { link, session, labels, view };
}

test("the pointers of others have labels with their names, which move with the parts", async () => {
  const { link, labels } = await page();
  link.emit("state", { users: [ADA, { ...ADA, client: 1, name: "me" }, { ...ADA, client: 3, robot: null }, { ...ADA, client: 4, node: "nose" }] });
  assert.deepEqual([...labels.all.keys()], ["user 2"]);
  const { text, point, element } = labels.all.get("user 2");
  assert.equal(text, "Ada");
  assert.deepEqual(point.toArray(), [1, 2, 2]);
  assert.deepEqual(element.dataset, { client: "2", colour: "3" });
  link.emit("state", { users: [{ ...ADA, dragging: true }] });
  assert.equal(labels.all.get("user 2").text, "Ada drags");
  link.emit("state", {}); // users have not changed
  assert.equal(labels.all.size, 1);
  link.emit("state", { users: [] });
  assert.equal(labels.all.size, 0);
});

test("a lost connection takes the pointers of others away", async () => {
  const { link, labels } = await page();
  link.emit("state", { users: [ADA] });
  link.emit("lost", "");
  assert.equal(labels.all.size, 0);
});

test("a pointer is sent where others see it, at most ten times per second, and only when it has changed", async (t) => {
  t.mock.timers.enable({ apis: ["setTimeout", "Date"], now: 1e6 });
  t.mock.method(performance, "now", () => Date.now());
  const { link, session, view } = await page();
  const drag = Object.assign(new Events(), { part: null });
  sendCursor({ view, session, drag });
  const group = { worldToLocal: (point) => point };
  const over = (x) => drag.emit("hover", { robot: "arm", node: "tool", group, point: new Vector3(x, 0, 0) });
  link.emit("report", { clients: 1, robots: {} });
  over(1);
  t.mock.timers.tick(120);
  assert.deepEqual(link.sent, []); // no one else is here
  link.emit("report", { clients: 2, robots: {} });
  for (let i = 0; i < 50; i += 1) over(i);
  t.mock.timers.tick(150);
  over(49);
  t.mock.timers.tick(150);
  const cursor = { type: "set_cursor", robot: "arm", node: "tool", dragging: false };
  assert.deepEqual(link.sent, [{ ...cursor, point: [0, 0, 0] }, { ...cursor, point: [49, 0, 0] }]);
  drag.emit("drag", { robot: "arm", node: "tool", at: new Vector3(0.123456, 0, 0) });
  t.mock.timers.tick(150);
  assert.deepEqual(link.sent.at(-1), { ...cursor, point: [0.1235, 0, 0], dragging: true });
  view.canvas.dispatchEvent(new Event("pointerleave"));
  t.mock.timers.tick(150);
  assert.deepEqual(link.sent.at(-1), { type: "set_cursor" });
});

test("names and colours that a browser keeps are checked", () => {
  assert.equal(textOf({ ...ADA, robot: null }), "");
  kept.set("cinegen.user.name", JSON.stringify(`${"x".repeat(99)}\u202e`));
  kept.set("cinegen.user.colour", "99");
  const { name, colour } = profile();
  assert.equal(name, "x".repeat(40));
  assert.ok(Number.isInteger(colour) && colour >= 0 && colour < COLOURS);
  assert.equal(profile().colour, colour); // and kept
});
