import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { line, root } from "./browser.js";

const { keyOf, Session } = await import("../../cinegen/cockpit/static/base/session.js");

const ARM = { name: "arm", nodes: [{ name: "base" }, { name: "tool" }], joints: [], loops: [], couplings: [] };
const WALL = { name: "wall", length: 1, mobility: 0 };
let link;
let session;
let last;

beforeEach(async () => {
  link = await line();
  session = new Session(link);
  last = [];
  for (const name of ["hello", "state", "report", "control", "select", "denied", "notice", "lost", "dropped"]) {
    session.on(name, (value) => last.push([name, value]));
  }
});

test("robots and obstacles are told apart, and what the server leaves out is empty", () => {
  link.emit("hello", { client: 1, robots: [ARM, { name: "bare" }], obstacles: [WALL] });
  assert.deepEqual(session.robots.map(({ name }) => name), ["arm", "bare"]);
  assert.deepEqual(session.obstacles.map(({ name }) => name), ["wall"]);
  const { nodes, joints, loops } = session.robot("bare");
  assert.deepEqual([nodes, joints, loops], [[], [], []]);
  assert.equal(session.knows("arm", "tool"), true);
  assert.equal(session.knows("arm", "nothing"), false);
  assert.equal(session.knows("nobody", "tool"), false);
  assert.equal(session.robot("nobody"), null);
});

test("a part is called by its node alone where there is one robot", () => {
  link.emit("hello", { client: 1, robots: [ARM], obstacles: [WALL] });
  assert.equal(session.called("arm", "tool"), "tool");
  assert.equal(session.called("wall", "wall"), "wall");
  link.emit("hello", { client: 1, robots: [ARM, { ...ARM, name: "other" }] });
  assert.equal(session.called("arm", "tool"), "arm · tool");
});

test("a part that has only a number is called by the frame on it, the end before others", () => {
  const nodes = [{ name: "link6" }, ...["frame9", "camera", "plate"].map((name) => ({ name, parent: "link6", kind: "frame" }))];
  link.emit("hello", { client: 1, robots: [{ ...ARM, nodes, end: "plate" }] });
  assert.equal(session.called("arm", "link6"), "plate");
  link.emit("hello", { client: 1, robots: [{ ...ARM, nodes: nodes.slice(0, 2) }] });
  assert.equal(session.called("arm", "link6"), "link6");
});

test("who has control is last when it changes, and only then", () => {
  link.emit("hello", { client: 7, robots: [ARM] });
  const changes = () => last.filter(([name]) => name === "control").map(([, value]) => value);
  for (const controller of [null, 7, 7, 3, 3, null]) link.emit("state", { controller, poses: {} });
  assert.deepEqual(changes(), ["mine", "other", "free"]);
  assert.equal(root.dataset.control, "free");
});

test("a page that only views sends no commands, whoever has control", () => {
  link.emit("hello", { client: 7, robots: [ARM], view_only: true });
  assert.equal(session.mayAct(), false);
  link.emit("state", { controller: null, poses: {} });
  assert.equal(session.mayAct(), false);
  assert.equal(session.control, "other");
  assert.equal(last.filter(([name]) => name === "denied").length, 2);
});

test("commands are denied while another browser has control", () => {
  link.emit("hello", { client: 7, robots: [ARM] });
  assert.equal(session.mayAct(), true);
  link.emit("state", { controller: 3, poses: {} });
  assert.equal(session.mayAct(), false);
  assert.equal(last.filter(([name]) => name === "denied").length, 1);
  link.emit("state", { controller: 7, poses: {} });
  assert.equal(session.mayAct(), true);
});

test("a part is selected once; unknown ones select nothing", () => {
  link.emit("hello", { client: 1, robots: [ARM] });
  const selected = () => last.filter(([name]) => name === "select").map(([, value]) => value);
  session.select("arm", "tool");
  session.select("arm", "tool");
  session.select("arm", "base");
  session.select("arm", "nothing");
  session.select(null, null);
  assert.deepEqual(selected(), [{ robot: "arm", node: "tool" }, { robot: "arm", node: "base" }, null]);
});

test("another scene forgets the state, and a selection that is not in it", () => {
  link.emit("hello", { client: 1, robots: [ARM] });
  link.emit("state", { controller: null, tasks: [{ id: 1 }], poses: {} });
  link.emit("report", { robots: {} });
  session.select("arm", "tool");
  assert.equal(session.tasks.length, 1);
  link.emit("hello", { client: 2, robots: [ARM] });
  assert.deepEqual([session.state, session.report, session.tasks], [null, null, []]);
  assert.deepEqual(session.selected, { robot: "arm", node: "tool" });
  link.emit("hello", { client: 3, robots: [WALL] });
  assert.equal(session.selected, null);
  assert.equal(session.knows("arm", "tool"), false);
});

test("what the link says is passed on, and what is sent goes to the link", () => {
  for (const name of ["notice", "lost", "dropped"]) link.emit(name, name);
  assert.deepEqual(last, [["notice", "notice"], ["lost", "lost"], ["dropped", "dropped"]]);
  session.send({ home: true });
  assert.deepEqual(link.sent, [{ home: true }]);
});

test("keys of parts differ where names only run together", () => {
  assert.notEqual(keyOf("a", "bc"), keyOf("ab", "c"));
});
