import assert from "node:assert/strict";
import { test } from "node:test";

import { fill, significant } from "../../cinegen/page/static/raff/texts.js";
import { read } from "../../cinegen/page/static/raff/read.js";

// Agreement with Python's reader is tested by tests/page/test_raff_reader.py.

test("text that is no JavaScript of ours is only text", () => {
  for (const text of ["", "<script>alert(1)</script>", "RAFF __proto__ robot constructor { __proto__ 1 toString { } }", "\ud800"]) {
    const { models, errors } = read(text, "<text>");
    assert.deepEqual(models, []);
    assert.ok(errors.length > 0 && errors.every((one) => String(one).startsWith("<text>:1:")), text);
  }
});

test("a model of a robot is in metres and radians", () => {
  const { models, errors, warnings } = read("RAFF t robot r { link 1 { parameters { theta 90 d 500 } type 2 pred 0 limits { 0 180 } } }");
  assert.deepEqual([errors, warnings], [[], []]);
  const [{ bodies, joints }] = models;
  assert.deepEqual(bodies.map((body) => [body.name, body.parent, body.joint]), [["base", -1, -1], ["link1", 0, 0]]);
  assert.deepEqual(bodies[1].world.filter((_, i) => i % 4 === 3), [0.5, 0, 0]);
  assert.deepEqual(joints, [
    { name: "joint1", type: "revolute", body: 1, home: Math.PI / 2, lower: 0, upper: Math.PI, velocity: Infinity, effort: Infinity, actuated: null },
  ]);
});

test("numbers are rounded to even as Python rounds them", () => {
  const shown = [1000000.5, 1234565, 0.5, -0, 1e-5, 1e6, 123456.5, 123457.5].map((value) => significant(value, 6));
  assert.deepEqual(shown, ["1e+06", "1.23456e+06", "0.5", "-0", "1e-05", "1e+06", "123456", "123458"]);
  assert.deepEqual([2.5, 0.25, 35, 1e300].map((value) => significant(value, 1)), ["2", "0.2", "4e+01", "1e+300"]);
});

test("a text whose field is missing is a mistake of ours", () => {
  assert.equal(fill("{a}{{}}{b:.3g}", { a: 1, b: 2.34567 }), "1{}2.35");
  assert.throws(() => fill("{a}", { b: 1 }), TypeError);
});
