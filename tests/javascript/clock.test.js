import assert from "node:assert/strict";
import { test } from "node:test";

const { Clock } = await import("../../cinegen/page/static/session/clock.js");

test("ticks follow the time, however it is divided into frames", () => {
  const clock = new Clock(1 / 240);
  let ticks = clock.due(0);
  for (let now = 0; now < 1000; ) {
    now += 3 + ((now * 7) % 13);
    ticks += clock.due(Math.min(now, 1000));
  }
  assert.ok(Math.abs(ticks - 241) <= 1, ticks);
});

test("a pause is not made up for", () => {
  const clock = new Clock(1 / 240);
  clock.due(0);
  assert.equal(clock.due(60_000), 24); // 0.1 s
  assert.ok(clock.due(60_016) <= 4);
});

test("the rate is that of the last second", () => {
  const clock = new Clock(1 / 240);
  for (let now = 0; now <= 3000; now += 100) clock.note(now, now < 1500 ? 7 : 24);
  assert.equal(clock.ticks, 11 * 24);
});
