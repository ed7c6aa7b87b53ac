import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { nameOf, segment, sharedBeginnings, valueOf } = await import("../../cinegen/cockpit/static/base/names.js");

const NAMES = ["tool", "constructor", "__proto__", "a/b", "a%2Fb", "%", "", ":x"];

test("a segment is no key of every object, has no slash, and has its name", () => {
  for (const name of NAMES) {
    assert.equal(nameOf(segment(name)), name);
    assert.ok(!(segment(name) in {}) && !segment(name).includes("/"));
  }
  assert.equal(segment("a/b%", "loop "), "loop a%2Fb%25"); // as `path_segment` returns it: tests/raff2urdf/test_escape.py
});

test("a record has the names that it was given", () => {
  const parsed = JSON.parse('{"arm": 1, "__proto__": 2}');
  assert.deepEqual(["arm", "__proto__", "constructor", "toString"].map((name) => valueOf(parsed, name)), [1, 2, undefined, undefined]);
  assert.equal(valueOf(null, "arm"), undefined);
});

test("what at least three names begin with, up to a separator, is not repeated", () => {
  const cut = (names) => sharedBeginnings(names).map((length, i) => names[i].slice(length));
  const panda = ["panda_joint1", "panda_joint2", "panda_joint3", "panda_finger_joint1", "panda_finger_joint2"];
  assert.deepEqual(cut(panda), ["joint1", "joint2", "joint3", "finger_joint1", "finger_joint2"]);
  assert.deepEqual(cut(["arm_left_1", "arm_left_2", "arm_left_3", "arm_right_1", "torso/a"]), ["1", "2", "3", "right_1", "torso/a"]);
  assert.deepEqual(cut(["joint1", "joint2", "joint3"]), ["joint1", "joint2", "joint3"]); // no separator
  assert.deepEqual(cut(["a_", "a_", "a_", ""]), ["a_", "a_", "a_", ""]); // something is left of each
});
