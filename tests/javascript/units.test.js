import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { kept } from "./browser.js";

const { amount, fixed, significant, Units } = await import("../../cinegen/cockpit/static/base/units.js");

beforeEach(() => kept.clear());

test("lengths and angles are shown in mm and degrees, or in m and radians", () => {
  const units = new Units();
  assert.equal(units.length(0.01234), "12.3 mm");
  assert.equal(units.angle(Math.PI / 6), "30.0°");
  assert.equal(units.speed(0.0123), "12 mm/s");
  assert.equal(units.turning(Math.PI), "180 °/s");
  units.toggle();
  assert.equal(units.length(0.01234), "0.0123 m");
  assert.equal(units.angle(Math.PI / 6), "0.524 rad");
  assert.equal(units.speed(0.0123), "0.012 m/s");
  assert.equal(units.turning(Math.PI), "3.1 rad/s");
});

test("a joint's value keeps its meaning on the way to the screen and back", () => {
  for (const small of [true, false]) {
    const units = new Units();
    units.small = small;
    for (const type of ["revolute", "prismatic"]) {
      const shown = units.shown({ type }, 0.7);
      assert.ok(Math.abs(units.meant({ type }, shown) - 0.7) < 1e-15, `${type}, ${units.unit({ type })}`);
    }
  }
  const units = new Units();
  assert.equal(units.shown({ type: "prismatic" }, 0.5), 500);
  assert.equal(units.shown({ type: "revolute" }, Math.PI), 180);
  assert.equal(units.joint({ type: "prismatic" }, 0.5), "500.0 mm");
  assert.equal(units.joint({ type: "revolute" }, Math.PI), "180.0°");
});

test("a joint's unit and digits are those of its kind", () => {
  const units = new Units();
  const both = () => ["prismatic", "revolute"].map((type) => [units.unit({ type }), units.digits({ type })]);
  assert.deepEqual(both(), [["mm", 1], ["°", 1]]);
  units.toggle();
  assert.deepEqual(both(), [["m", 4], ["rad", 3]]);
});

test("toggling tells listeners and is remembered", () => {
  const units = new Units();
  let last = 0;
  units.on("change", () => (last += 1));
  assert.deepEqual([units.name, units.other], ["mm · °", "m · rad"]);
  units.toggle();
  assert.deepEqual([units.name, units.other], ["m · rad", "mm · °"]);
  assert.equal(last, 1);
  assert.equal(kept.get("cinegen.units"), '"m"');
  assert.equal(new Units().small, false);
  units.toggle();
  assert.equal(new Units().small, true);
});

test("a number that rounds to zero has no sign, and what is no number is a dash", () => {
  assert.equal(fixed(-0.04, 1), "0.0");
  assert.equal(fixed(-0.06, 1), "-0.1");
  assert.equal(fixed(NaN, 1), "–");
  assert.equal(fixed(Infinity, 1), "–");
  assert.equal(significant(0.01234), "0.012");
  assert.equal(significant(123456), "120000");
  assert.equal(significant(NaN), "–");
});

test("forces and torques have three significant digits, from 10,000 on with a prefix", () => {
  assert.deepEqual(
    [642.097, -35.42, 1e-9, 9994, 12345, 3.1e7, NaN].map((value) => amount(value, "N m")),
    ["642 N m", "-35.4 N m", "0 N m", "9990 N m", "12.3 kN m", "31 MN m", "–"],
  );
});
