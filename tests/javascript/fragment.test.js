import assert from "node:assert/strict";
import { test } from "node:test";

import { line } from "./browser.js";

const { cameraOf, configurationsOf, fragmentOf } = await import("../../cinegen/cockpit/static/base/fragment.js");

const { Session } = await import("../../cinegen/cockpit/static/base/session.js");
const { moveTo } = await import("../../cinegen/cockpit/static/bar/share.js");

const SIZES = new Map([["a&b=c", 2], ["arm", 3]]);

test("a configuration is read back bit by bit, whatever its robot is called", () => {
  const q = Float64Array.of(Math.PI, -1e-17);
  const other = Float64Array.of(0.1 + 0.2, 0, 1e5 / 3);
  const { configurations, problem } = configurationsOf(fragmentOf([["a&b=c", q], ["arm", other]]), SIZES);
  assert.equal(problem, "");
  assert.deepEqual([...configurations], [["a&b=c", q], ["arm", other]]);
});

test("no fragment asks for nothing", () => {
  for (const none of ["", "#"]) assert.deepEqual(configurationsOf(none, SIZES), { configurations: new Map(), problem: "" });
});

test("whatever else a link holds is refused with its reason", () => {
  const bad = {
    "#leg=1,2,3": /a robot 'leg'/,
    "#arm=1,2": /3 numbers/,
    "#arm=1,2,": /3 numbers/,
    "#arm=1,2,NaN": /3 numbers/,
    "#arm=1,2,Infinity": /3 numbers/,
    "#arm=1,2,1e7": /3 numbers/,
    "#arm": /3 numbers/,
    "#arm=1,2,3&leg=1": /a robot 'leg'/,
    "#%E0%A4%A=1": /a robot '%E0%A4%A'/,
    "#<img src=x onerror=alert(1)>": /a robot '<img/,
    [`#arm=${"1,".repeat(20000)}1`]: /too long/,
    "#__proto__=1": /a robot '__proto__'/,
  };
  for (const [fragment, reason] of Object.entries(bad)) {
    const { configurations, problem } = configurationsOf(fragment, SIZES);
    assert.match(problem, reason);
    assert.equal(configurations.size, 0, fragment);
  }
});

test("a camera is read back beside configurations, even those of a robot of its name", () => {
  const camera = [1.5, -2, 0.25, 0, 1e-7, 123456];
  const fragment = fragmentOf([["@camera", [1, 2]]], camera);
  assert.deepEqual(cameraOf(fragment), { camera, problem: "" });
  const { configurations, problem } = configurationsOf(fragment, new Map([["@camera", 2]]));
  assert.deepEqual([problem, [...configurations]], ["", [["@camera", Float64Array.of(1, 2)]]]);
  assert.deepEqual(cameraOf(fragmentOf([["arm", [1]]])), { camera: null, problem: "" });
});

test("a camera that looks nowhere, or is no six numbers, is refused", () => {
  for (const bad of ["", "1,2,3", "1,2,3,4,5,6,7", "1,2,3,4,5,NaN", "1,2,3,4,5,1e7", "1,2,3,1,2,3", "1,2,3,4,5,", "<script>", "1,2,3,4,5,6=7"]) {
    const { camera, problem } = cameraOf(`#@camera=${bad}`);
    assert.equal(camera, null, bad);
    assert.match(problem, /no camera/, bad);
  }
});

test("a link's configuration is a motion of the actuated joints, and only who has control may start it", async () => {
  const link = await line();
  const session = new Session(link);
  const joint = (name, actuated) => ({ name, actuated });
  link.emit("hello", { client: 1, robots: [{ name: "arm", joints: [joint("a", true), joint("b", false), joint("c", true)] }] });
  link.emit("state", { controller: 2 });
  moveTo(session, [["arm", [1, 2, 3]]]);
  assert.deepEqual(link.sent, []);
  link.emit("state", { controller: 1 });
  moveTo(session, [["arm", [1, 2, 3]], ["other", [4]]]);
  assert.deepEqual(link.sent, [
    { type: "move_joint", robot: "arm", joint: "a", value: 1 },
    { type: "move_joint", robot: "arm", joint: "c", value: 3 },
    { type: "end_joint_motion" },
  ]);
});
