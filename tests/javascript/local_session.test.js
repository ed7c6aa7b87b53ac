import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";

import "./browser.js";

const { robotsOf } = await import("../../cinegen/page/static/session/link.js");
const { LocalSession } = await import("../../cinegen/page/static/session/session.js");
const { stateMessage, reportMessage } = await import("../../cinegen/page/static/session/messages.js");
const { robotReport } = await import("../../cinegen/page/static/session/report.js");

const LIMIT = 2.5;
const JOINTS = ["a", "b", "c"];
const NODES = ["base", "first", "second", "third", "tool"];
const at = (x) => [x, 0, 0, 0, 0, 0, 1];
const table = {
  joints: JOINTS.map((_, i) => ({ parent: i - 1, placement: at(i === 0 ? 0 : 1), axis: "z", prismatic: false })),
  nodes: [{ joint: -1, placement: at(0) }, ...[0, 1, 2].map((joint) => ({ joint, placement: at(0) })), { joint: 2, placement: at(1) }],
  names: { joints: JOINTS, nodes: NODES },
  home: [0.3, 0.4, 0.5],
  length: 3,
  lower: JOINTS.map(() => -LIMIT),
  upper: JOINTS.map(() => LIMIT),
};
const text = (await readFile(new URL("serial_solver.js", import.meta.url), "utf8")).replace("const TABLE = {};", `const TABLE = ${JSON.stringify(table)};`);
const module = await import(`data:text/javascript,${encodeURIComponent(text)}`);

/** A session of two planar arms; the second is mounted on the tool of the first. */
function arms() {
  const description = (name) => ({
    name,
    length: 3,
    end: "tool",
    nodes: NODES.map((node) => ({ name: node })),
    joints: JOINTS.map((joint) => ({ name: joint, type: "revolute", lower: -LIMIT, upper: LIMIT, velocity: null, actuated: true })),
  });
  const robots = ["one", "two"].map((name) => ({ name, start: table.home, base: { robot: null, node: null, placement: at(0) } }));
  robots[1].base = { robot: "one", node: "tool", placement: at(0.1) };
  return new LocalSession(...robotsOf({ hello: { robots: [description("one"), description("two")] }, robots }, [module.default(), module.default()]));
}

/** Random numbers that are the same in every run (mulberry32). */
function random(seed) {
  let state = seed;
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t ^= t + Math.imul(t ^ (t >>> 7), 61 | t);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

test("no command, sensible or not, stops the session, opens limits or leaves what is no number", () => {
  const next = random(5);
  const pick = (list) => list[Math.floor(next() * list.length)];
  const number = () => pick([() => 8 * next() - 4, () => 1e5 * next(), () => NaN, () => Infinity, () => 1e300, () => "1", () => null])();
  const near = () => 6 * next() - 3;
  const robot = () => pick(["one", "two", "nobody", "__proto__"]);
  const node = () => pick([...NODES, "nothing"]);
  const commands = [
    () => ({ type: "start_drag", robot: robot(), node: node(), point: pick([null, [near(), 0, 0], [number(), 0, 0]]), rotation: pick([true, false]) }),
    ...[0, 1, 2].map(() => () => ({ type: "move_drag", position: [near(), near(), 0], quaternion: null })),
    () => ({ type: "move_drag", position: [number(), number(), number()], quaternion: pick([null, [number(), 0, 0, 1]]) }),
    () => ({ type: "end_drag", pin: pick([true, false]) }),
    () => ({ type: "pin", robot: robot(), node: node() }),
    () => ({ type: "remove_task", task: Math.floor(200 * next()) }),
    () => ({ type: "change_task", task: Math.floor(200 * next()), translation: number(), rotation: 3, weight: number() }),
    () => ({ type: "move_joint", robot: robot(), joint: pick([...JOINTS, "d"]), value: number() }),
    () => ({ type: "end_joint_motion" }),
    () => ({ type: "move_home", robot: pick([null, robot()]) }),
    () => ({ type: "undo" }),
    () => ({ type: "redo" }),
    () => ({ type: "pause", on: next() < 0.2 }),
    () => ({ type: "change_settings", gain: number(), damping: number() }),
    () => ({ type: "nonsense" }),
  ];
  const session = arms();
  for (let i = 0; i < 3000; i += 1) {
    session.obey(pick(commands)());
    const ticks = Math.floor(4 * next());
    for (let k = 0; k < ticks; k += 1) session.tick(1 / 240);
    for (const { q, kinematics } of session.robots.values()) {
      assert.ok(q.every((value) => Number.isFinite(value)), String(i));
      assert.deepEqual(kinematics.beyond(q), []);
    }
    if (i % 100 !== 0) continue;
    const reports = Object.fromEntries([...session.robots.values()].map((one) => [one.name, robotReport(one)]));
    const sent = JSON.stringify([stateMessage(session, reports, i), reportMessage(session, reports, {})]);
    assert.ok(!/"(?:poses|target|position)":[^}]*null/.test(sent.split('"obstructions"')[0]), String(i));
  }
  assert.ok(session.notices.length > 0);
  assert.ok(session.history.undoCount > 0);
});

test("a robot that another carries goes with it, and what it is pinned to stays", () => {
  const session = arms();
  const two = session.robots.get("two");
  session.obey({ type: "pin", robot: "two", node: "tool" });
  const before = two.base.position.clone();
  const pinned = two.placement("tool").position.clone();
  session.obey({ type: "move_joint", robot: "one", joint: "c", value: 0.6 });
  for (let i = 0; i < 480; i += 1) session.tick(1 / 240);
  assert.ok(two.base.position.distanceTo(before) > 0.05);
  assert.ok(two.placement("tool").position.distanceTo(pinned) < 1e-3);
});

test("a second after the last motion the session is at rest, and any command ends that", () => {
  const session = arms();
  for (let i = 0; i < 241; i += 1) session.tick(1 / 240);
  assert.equal(session.atRest, true);
  session.obey({ type: "move_joint", robot: "one", joint: "a", value: 1 });
  assert.equal(session.atRest, false);
  for (let i = 0; i < 480; i += 1) session.tick(1 / 240);
  assert.equal(session.atRest, false); // the slider is still held
  session.obey({ type: "end_joint_motion" });
  for (let i = 0; i < 245; i += 1) session.tick(1 / 240);
  assert.equal(session.atRest, true);
  assert.equal(session.history.undoCount, 1);
});

test("a robot never has more tasks than its solver, though drags may end as pins", () => {
  const session = arms();
  const one = session.robots.get("one");
  one.kinematics.solver.mostTasks = 3;
  for (const node of NODES) {
    session.obey({ type: "start_drag", robot: "one", node, point: null, rotation: false });
    session.tick(1 / 240);
    session.obey({ type: "end_drag", pin: true });
    assert.ok(one.tasks.length <= 3);
  }
  assert.equal(one.tasks.length, 3);
  assert.match(session.notices.at(-1).text, /one has 3 tasks: remove some first/);
  session.obey({ type: "pin", robot: "one", node: "tool" });
  assert.equal(one.tasks.length, 3);
});
