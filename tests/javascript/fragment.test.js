import assert from "node:assert/strict";
import { test } from "node:test";

const { configurationsOf, fragmentOf } = await import("../../cinegen/page/static/session/fragment.js");

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
