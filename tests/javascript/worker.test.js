import assert from "node:assert/strict";
import { test } from "node:test";

globalThis.self = { addEventListener() {} };
const { reading } = await import("../../cinegen/page/static/editor/worker.js");

const most = { meshes: 2000, triangles: 1_000_000 };
const holding = (/** @type {object} */ file) => ({ known: new Map([["a.stl", { meshes: 1, triangles: 12, problem: null, ...file }]]), most });
const named = (/** @type {number} */ links, files = '"a.stl"') =>
  `RAFF t robot r {\n${Array.from({ length: links }, (_, i) => `link ${i + 1} { type 2 pred 0 parameters { d 100 } filename { ${files} } }`).join("\n")}\n}`;

test("a robot comes with the keys of its graphics, and without the names of its files", () => {
  const { notes, robots: [robot] } = reading(named(2), "t", holding({}));
  assert.deepEqual(notes, []);
  assert.deepEqual([...robot.graphics], [["base", null], ["link1", ["a.stl"]], ["link2", ["a.stl"]]]);
  assert.ok(robot.model.bodies.every(({ files }) => files === null));
});

test("more meshes or triangles than the page shows are an error, and no robot is drawn", () => {
  for (const [file, reason] of [
    [{ meshes: 8 }, /2080 meshes of 3120 triangles in all: the page shows at most 2000 of 1000000/],
    [{ triangles: 5000 }, /260 meshes of 1300000 triangles/],
  ]) {
    const { notes, robots } = reading(named(260), "t", holding(file));
    assert.equal(robots.length, 0);
    assert.deepEqual(notes.map(({ severity }) => severity), ["error"]);
    assert.match(notes[0].message, reason);
  }
  assert.equal(reading(named(240), "t", holding({ meshes: 8 })).robots.length, 1);
});

test("a file is shown once at a node, however often it is named there", () => {
  const { robots: [robot] } = reading(named(1, '"a.stl" "./a.stl" '.repeat(400)), "t", holding({ meshes: 1000 }));
  assert.deepEqual(robot.graphics.get("link1"), ["a.stl"]);
});

test("100,000 names of files that are not there are read at once, and counted", () => {
  const files = `${'"b" '.repeat(2000)}\n`.repeat(50);
  const began = process.cpuUsage();
  const { notes, robots } = reading(named(1, files), "t", holding({}));
  const { user } = process.cpuUsage(began);
  assert.equal(robots.length, 1);
  assert.equal(notes.length, 101);
  assert.equal(notes[100].message, "and 99900 more graphics that are not shown");
  assert.ok(user < 3e6, `${user} us`); // a fraction of a second; what is quadratic takes minutes
});
