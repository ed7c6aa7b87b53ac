import assert from "node:assert/strict";
import { test } from "node:test";

import { Group } from "three";

import { line } from "./browser.js";

window.matchMedia ??= () => ({ matches: false, addEventListener: () => {} });
const { Obstructions } = await import("../../cinegen/cockpit/static/aids/obstructions.js");

const FOUND = { label: "'link3' would hit 'pole'", points: [[0, 0, 0.5], [0.3, 0, 0.5]] };

/** Return a page with robots of length 2 m, `show` a state's obstructions in it, and what is drawn then. */
async function page(...names) {
  const session = Object.assign(await line(), { state: null, robots: names.map((name) => ({ name, length: 2 })) });
  const stage = new Group();
  const texts = new Map();
  let changes = 0;
  const labels = { put: (name, text, at) => texts.set(name, [text, at?.toArray()]) };
  new Obstructions({ view: { stage, changed: () => (changes += 1) }, session, labels });
  return {
    session,
    stage,
    texts,
    changes: () => changes,
    show(obstructions) {
      session.state = { obstructions };
      session.emit("state");
      return stage.children.filter((part) => part.visible);
    },
  };
}

test("an obstruction has a ball at both points, a rod between them, and its text at the second", async () => {
  const { show, texts, changes } = await page("arm");
  const [first, second, rod] = show({ arm: FOUND });
  assert.deepEqual([first.position.toArray(), second.position.toArray()], FOUND.points);
  assert.deepEqual(first.scale.toArray(), [0.04, 0.04, 0.04]); // 0.02 of its length
  assert.deepEqual(rod.position.toArray(), FOUND.points[0]);
  assert.ok(Math.abs(rod.scale.y - 0.3) < 1e-12);
  assert.deepEqual(texts.get("obstruction arm"), [FOUND.label, FOUND.points[1]]);
  assert.equal(changes(), 1);
});

test("it follows the points, with the same parts, and is hidden when the robot is free", async () => {
  const { show, stage, texts } = await page("arm");
  show({ arm: FOUND });
  const points = [
    [0, 0, 0.6],
    [0, 0, 0.6], // in contact: no rod
  ];
  const drawn = show({ arm: { ...FOUND, points } });
  assert.deepEqual(drawn.map((part) => part.position.toArray()), points);
  assert.equal(stage.children.length, 3);
  assert.deepEqual(show({}), []);
  assert.equal(texts.get("obstruction arm")[0], "");
  assert.equal(show({ arm: FOUND }).length, 3);
});

test("robots have marks of their own, and a new session has none", async () => {
  const { session, show, stage, texts } = await page("arm", "other");
  assert.equal(show({ arm: FOUND }).length, 3);
  assert.equal(show({ arm: FOUND, other: FOUND }).length, 6);
  assert.equal(show({ other: FOUND }).length, 3);
  session.emit("hello");
  assert.equal(stage.children.length, 0);
  assert.equal(texts.get("obstruction other")[0], "");
});
