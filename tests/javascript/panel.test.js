import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { share, tone } = await import("../../cinegen/cockpit/static/panel/singularity.js");
const { summary } = await import("../../cinegen/cockpit/static/bar/status.js");
const { ticking } = await import("../../cinegen/cockpit/static/panel/performance.js");
const { fill } = await import("../../cinegen/cockpit/static/panel/slider.js");
const { holding } = await import("../../cinegen/cockpit/static/panel/joints.js");
const { summary: described } = await import("../../cinegen/cockpit/static/panel/forces.js");
const { scaleOf } = await import("../../cinegen/cockpit/static/aids/force_scale.js");
const { Changes } = await import("../../cinegen/cockpit/static/aids/changes.js");
const { AIDS, Aids } = await import("../../cinegen/cockpit/static/aids/aids.js");

test("the scale of a singular value is logarithmic from 0.001 to 1", () => {
  assert.deepEqual([share(0), share(1e-3), share(1), share(50)], [0, 0, 1, 1]);
  assert.ok(Math.abs(share(0.1) - 2 / 3) < 1e-12);
});

test("a meter is red below its threshold, orange below three times it", () => {
  assert.deepEqual([0.0099, 0.01, 0.0299, 0.03].map((sigma) => tone(sigma, 0.01)), ["bad", "warn", "warn", "good"]);
  assert.equal(tone(0, 0), "good");
});

test("the chip shows the robot in most trouble, the first where several are", () => {
  const statuses = {
    a: { name: "FOLLOWING", label: "following" },
    b: { name: "AT_LIMIT", label: "joint 2 at its limit" },
    c: { name: "SINGULAR", label: "singular" },
  };
  const { label, tone: colour, name, title } = summary(statuses, null, true);
  assert.deepEqual([label, colour, name], ["b: joint 2 at its limit", "warn", "AT_LIMIT"]);
  assert.equal(title, "a: following\nb: joint 2 at its limit\nc: singular");
  assert.equal(summary({ ...statuses, d: { name: "REFUSED", label: "refused" } }, null, true).name, "REFUSED");
});

test("the chip tells of one robot without its name, and of a session that is paused or moves by itself", () => {
  const limited = { arm: { name: "AT_LIMIT", label: "joint 2 at its limit" } };
  assert.equal(summary(limited, null, false).label, "joint 2 at its limit");
  assert.deepEqual(summary({ arm: { name: "IDLE", label: "idle" } }, null, true).label, "idle");
  const shown = (report) => {
    const { label, tone: colour } = summary(limited, report, false);
    return [label, colour];
  };
  assert.deepEqual(shown({ paused: true, moving: "home" }), ["paused", "none"]);
  assert.deepEqual(shown({ paused: false, moving: "home" }), ["moving home", "good"]);
  assert.deepEqual(shown({ paused: false, moving: null }), ["joint 2 at its limit", "warn"]);
  assert.equal(summary({}, null, false), null);
});

test("a slider is filled by the share of its range, also where it has none", () => {
  const filled = (input) => {
    let style;
    fill({ ...input, style: { setProperty: (name, value) => (style = [name, value]) } });
    return style;
  };
  assert.deepEqual(filled({ min: "-1", max: "3", value: "0" }), ["--fill", "25.00%"]);
  assert.deepEqual(filled({ min: "1", max: "1", value: "1" }), ["--fill", "0.00%"]);
});

test("what is last again unchanged is not fresh", () => {
  const changes = new Changes();
  assert.equal(changes.differs("a", { at: [1, 2] }), true);
  assert.equal(changes.differs("a", { at: [1, 2] }), false);
  assert.equal(changes.differs("b", { at: [1, 2] }), true);
  assert.equal(changes.differs("a", { at: [1, 3] }), true);
  assert.equal(changes.differs("a", undefined), true);
  assert.equal(changes.differs("a", null), false);
  changes.clear();
  assert.equal(changes.differs("a", null), true);
});

test("aids that were chosen are remembered, and none is shown where none is wished for", () => {
  const aids = new Aids();
  assert.deepEqual(AIDS.filter(({ id }) => !aids.shows(id)).map(({ id }) => id), ["ellipsoid", "reactions", "loops"]);
  aids.choose("ellipsoid", true);
  aids.choose("ghost", false);
  aids.draw("skeleton");
  const again = new Aids();
  assert.deepEqual([again.shows("ellipsoid"), again.shows("ghost"), again.bodies], [true, false, "skeleton"]);
  assert.equal(new Aids(true).shows("ellipsoid"), false);
  assert.equal(again.shows("unknown"), false);
});

test("paused or moving, the chip still reports a singularity that a meter shows in red", () => {
  const near = { arm: { name: "UNCONTROLLED", label: "near a singularity: x" } };
  const { label, tone: colour } = summary(near, { paused: true, moving: null }, false);
  assert.deepEqual([label, colour], ["paused, near a singularity: x", "bad"]);
  const lost = { arm: { name: "SINGULAR", label: "near a singularity: y" } };
  assert.equal(summary(lost, { paused: false, moving: "home" }, false).label, "moving home, near a singularity: y");
});

test("the footer shows the ticks and the missed deadlines of the last second", () => {
  const rate = { ticks: 998.6, missed: 0, missed_in_all: 7, late: 0.21, at_rest: false };
  assert.equal(ticking(rate).text, "999 /s");
  assert.equal(ticking(rate).late, false);
  assert.match(ticking(rate).title, /999 ticks, 0 missed. Since the start: 7 missed, 99 % begin 0.21 ms late/);
  assert.deepEqual([ticking({ ...rate, missed: 3 }).text, ticking({ ...rate, missed: 3 }).late], ["999 /s, 3 missed", true]);
  assert.equal(ticking({ ...rate, ticks: 60, at_rest: true }).text, "at rest");
  assert.equal(ticking(undefined).text, "–");
});

test("a holding torque is a part of its limit where there is one, and none where no actuator holds", () => {
  const free = { type: "revolute", effort: null };
  const limited = { type: "prismatic", effort: 200 };
  assert.deepEqual(holding(free, -35.42), { text: "-35.4 N m", share: 0, tone: "none" });
  assert.deepEqual(holding(free, null), { text: "no actuator holds", share: 0, tone: "bad" });
  assert.deepEqual(holding(limited, -50), { text: "-50 N · 25 %", share: 0.25, tone: "good" });
  assert.equal(holding(limited, 170).tone, "warn");
  assert.deepEqual(holding(limited, 500), { text: "500 N · 250 %", share: 2.5, tone: "bad" });
  assert.deepEqual(holding(limited, null), { text: "no actuator holds", share: 1, tone: "bad" });
  assert.equal(holding({ type: "revolute", effort: 0 }, 0).tone, "good");
  assert.equal(holding({ type: "revolute", effort: 0 }, 1).tone, "bad");
});

test("arrows have a round scale, and what is not determined is told", () => {
  const reaction = { kind: "joint", name: "a", node: "b", point: [0, 0, 0], moment: 0, undetermined: [] };
  const [first, second] = [{ ...reaction, force: [0, 300, 400] }, { ...reaction, force: null, undetermined: ["Fz", "Fx", "Fy"] }];
  assert.deepEqual(scaleOf([first, second], 2), { newtons: 500, metres: 0.8 });
  assert.deepEqual(scaleOf([{ ...reaction, force: [501, 0, 0] }], 2).newtons, 1000);
  assert.deepEqual(scaleOf([{ ...reaction, force: [0, 0, 0] }, second], 2).newtons, 0);
  assert.equal(described([first], 2), "An arrow 800.0 mm long is 500 N.");
  assert.match(described([first, second], 2), /determine all components of 1 of 2 reactions \(Fx, Fy, Fz in the joints' axes\)/);
  assert.match(described([], 2), /No actuator holds/);
});
