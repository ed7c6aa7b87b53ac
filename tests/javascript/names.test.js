import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { nameOf, segment, valueOf } = await import("../../cinegen/cockpit/static/base/names.js");

const NAMES = ["tool", "constructor", "__proto__", "a/b", "a%2Fb", "%", "", ":x"];

test("a segment is no key of every object, has no slash, and has its name", () => {
  for (const name of NAMES) {
    assert.equal(nameOf(segment(name)), name);
    assert.ok(!(segment(name) in {}) && !segment(name).includes("/"));
  }
  assert.equal(segment("a/b%", "loop "), "loop a%2Fb%25"); // as `path_segment` returns it: tests/raff2urdf/test_escape.py
});

test("a record has the names that it was given", () => {
  const given = JSON.parse('{"arm": 1, "__proto__": 2}');
  assert.deepEqual(["arm", "__proto__", "constructor", "toString"].map((name) => valueOf(given, name)), [1, 2, undefined, undefined]);
  assert.equal(valueOf(null, "arm"), undefined);
});
