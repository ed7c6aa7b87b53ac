import assert from "node:assert/strict";
import { test } from "node:test";

import { Reader } from "../../cinegen/page/static/editor/reading.js";

const NO_FILES = { known: new Map(), most: { meshes: 0, triangles: 0 } };

/** A worker that answers all texts but "endless". */
class FakeWorker {
  static made = [];
  ended = false;
  constructor() {
    FakeWorker.made.push(this);
  }
  postMessage({ text }) {
    if (text !== "endless") setTimeout(() => this.ended || this.onmessage({ data: { notes: [], robots: [text] } }));
  }
  terminate() {
    this.ended = true;
  }
}
globalThis.Worker = FakeWorker;

test("a text that takes too long ends the worker, and the next one is read by another", async () => {
  const found = [];
  const reader = new Reader("", NO_FILES, (reading) => found.push(reading), 20);
  reader.take("endless", "t");
  await new Promise((resolve) => setTimeout(resolve, 60));
  assert.deepEqual(found.map(({ robots }) => robots), [[]]);
  assert.match(found[0].notes[0].message, /more than 0.02 s/);
  reader.take("short", "t");
  await new Promise((resolve) => setTimeout(resolve, 60));
  assert.deepEqual(found[1].robots, ["short"]);
  assert.deepEqual(FakeWorker.made.map(({ ended }) => ended), [true, false]);
});

test("of texts that come while one is read, only the last is answered", async () => {
  const found = [];
  const reader = new Reader("", NO_FILES, (reading) => found.push(...reading.robots), 1000);
  for (const text of ["one", "two", "three"]) reader.take(text, "t");
  await new Promise((resolve) => setTimeout(resolve, 60));
  assert.deepEqual(found, ["three"]);
});
