import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { cleanName, LONGEST } = await import("../../cinegen/cockpit/static/base/names.js");
const { freeName } = await import("../../cinegen/cockpit/static/panel/waypoints.js");

test("a name is one line of text without control characters, of limited length", () => {
  assert.equal(cleanName("  pick \t up\n "), "pick up");
  assert.equal(cleanName("a\u0000b\u202ec\u2066d\ud83d"), "a b c d");
  assert.equal(cleanName("<b>& \"é機😀\""), "<b>& \"é機😀\"");
  assert.equal(cleanName(" \u200f\u0007 "), "");
  assert.equal([...cleanName("😀".repeat(99))].length, LONGEST);
  assert.equal(cleanName(`${"x".repeat(39)} y`), "x".repeat(39));
});

test("a name that is proposed is not taken", () => {
  const named = (...names) => names.map((name, id) => ({ id, name }));
  assert.equal(freeName([]), "Waypoint 1");
  assert.equal(freeName(named("Waypoint 1", "Waypoint 3")), "Waypoint 4");
  assert.equal(freeName(named("a", "Waypoint 3")), "Waypoint 4");
});
