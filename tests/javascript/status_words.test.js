import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { inWords, statusesInWords } = await import("../../cinegen/cockpit/static/bar/status_words.js");

const FRONT = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]; // the view from the front: x is to the right, z up, -y towards the viewer
const SINGULAR = { name: "SINGULAR", label: "near a singularity: lost DoF" };
const lost = (...twist) => ({ type1: { twist } });
const said = (twist, pull, axes = FRONT) => inWords(SINGULAR, lost(...twist), axes, pull, 1).label;

test("near a singularity the way is told that the part is pulled in and can't go", () => {
  assert.equal(said([0, 0, 1, 0, 0, 0], [0, 0, 0.1]), "can't push upwards here");
  assert.equal(said([0, 0, 1, 0, 0, 0], [0, 0, -0.1]), "can't push downwards here");
  assert.equal(said([0, 0, -1, 0, 0, 0], [0, 0, -0.1]), "can't push downwards here");
  assert.equal(said([1, 0, 0.1, 0, 0, 0], [-0.1, 0, 0.01]), "can't push to the left here");
  assert.equal(said([0, 1, 0, 0, 0, 0], [0, 0.1, 0]), "can't push away from you here");
  assert.equal(said([0, 0, 0.1, 0, 0, 1], [0, 0, 0.1]), "can't rotate in this direction here");
});

test("a pull that doesn't meet the lost direction is followed", () => {
  assert.equal(inWords(SINGULAR, lost(0, 0, 1, 0, 0, 0), FRONT, [0.1, 0, 0], 1).name, "FOLLOWING");
});

test("what has no better words stays", () => {
  assert.equal(inWords({ name: "AT_LIMIT", label: "at the limit of a and b, near a singularity" }, undefined, FRONT, [0, 0, 0], 1).label, "at the limit of a and b");
  assert.equal(inWords({ name: "OUT_OF_REACH", label: "out of reach by 12 mm" }, undefined, FRONT, [0, 0, 0], 1).label, "out of reach by 12 mm");
});

test("a robot that stands near a singularity before anyone drives is quiet", () => {
  const session = (control, tasks) => ({ control, tasks, state: { statuses: { arm: SINGULAR } }, report: { robots: {} }, robot: () => ({ length: 1 }) });
  assert.equal(statusesInWords(session("free", []), FRONT).arm.name, "IDLE");
  assert.equal(statusesInWords(session("free", [{ robot: "arm", source: "path" }]), FRONT).arm.name, "IDLE");
  assert.equal(statusesInWords(session("mine", [{ robot: "arm", source: "pointer", target: [0, 0, 0] }]), FRONT).arm.name, "SINGULAR");
  assert.equal(statusesInWords(session("mine", []), FRONT).arm.name, "IDLE");
});

test("a limit that keeps nothing from its target is none to a person", () => {
  const name = (...errors) => {
    const tasks = errors.map((error) => ({ robot: "arm", source: "path", target: [0, 0, 0], error }));
    const status = { name: "AT_LIMIT", label: "at the limit of a", description: "" };
    return statusesInWords({ state: { statuses: { arm: status } }, report: {}, control: "free", tasks, robot: () => ({ length: 2 }) }, FRONT).arm.name;
  };
  assert.equal(name([0.023, 0.05]), "FOLLOWING");
  assert.equal(name([0.025, 0]), "AT_LIMIT");
  assert.equal(name([0.023, 0], [0, 0.07]), "AT_LIMIT");
  assert.equal(name(), "AT_LIMIT");
  assert.equal(name(undefined), "AT_LIMIT");
});
