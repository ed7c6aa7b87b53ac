import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { csvOf, History } = await import("../../cinegen/cockpit/static/plots/history.js");
const { fractionOf, linearScale, logScale } = await import("../../cinegen/cockpit/static/plots/scale.js");
const { styleOf, trace } = await import("../../cinegen/cockpit/static/plots/chart.js");
const { Quantities } = await import("../../cinegen/cockpit/static/plots/quantities.js");
const { extremes } = await import("../../cinegen/cockpit/static/panel/plots.js");
const { fileName } = await import("../../cinegen/cockpit/static/base/download.js");

/** A history of one quantity: `filled([[time, value], ...])`. */
function filled(samples, most = 100) {
  const history = new History(["x"], { most });
  for (const [time, value] of samples) history.add(time, () => value);
  return history;
}

const times = (history) => Array.from({ length: history.count }, (_, i) => history.time(i));

test("a history keeps the newest samples, in their order, in memory that does not grow", () => {
  const history = filled(Array.from({ length: 25 }, (_, i) => [i, 10 * i]), 10);
  assert.deepEqual(times(history), [15, 16, 17, 18, 19, 20, 21, 22, 23, 24]);
  assert.equal(history.value(0, 0), 150);
  assert.equal(history.newest, 24);
  assert.deepEqual([-1, 15, 15.5, 24, 99].map((time) => history.since(time)), [0, 0, 1, 9, 10]);
  assert.deepEqual([-1, 15.4, 15.6, 99].map((time) => history.nearest(time)), [0, 0, 1, 9]);
  assert.equal(new History(["x"], { most: 3 }).nearest(1), -1);
});

test("samples that come too often are left out, and time that begins again removes what is later", () => {
  const history = new History(["x"], { most: 10, period: 0.1 });
  for (const time of [0, 0.05, 0.1, 0.15, 0.2]) history.add(time, () => time);
  assert.deepEqual(times(history), [0, 0.1, 0.2]);
  history.add(0.1, () => 7);
  assert.deepEqual(times(history), [0, 0.1]);
  history.add(-5, () => 8);
  assert.deepEqual([times(history), history.value(0, 0)], [[-5], 8]);
});

test("CSV merges histories by time, leaves unknown cells empty, and quotes names", () => {
  const curves = filled([[1, 0.5], [2, NaN], [3, 1e-9]]);
  const other = new History(['a "b", c', "d"], { most: 9 });
  other.add(2, (i) => i - 1);
  other.add(2.5, (i) => i + 1);
  assert.equal(csvOf([curves, other], 1.5), 'time (s),x,"a ""b"", c",d\r\n2,,-1,0\r\n2.5,,1,2\r\n3,1e-9,,\r\n');
});

test("ticks are at 1, 2 or 5 times a power of ten, inside the scale, with as many digits as they need", () => {
  for (const [least, most] of [[0, 1], [-90, 90], [3.1, 3.2], [1000, 1000], [-2e-5, 7e-4], [0, 0]]) {
    const { low, high, ticks } = linearScale(least, most, { smallest: 0.01, count: 4 });
    assert.ok(low < least && high > most && high - low > 0.00999);
    assert.ok(ticks.length >= 1 && ticks.length <= 5, `${least} ${most}: ${ticks.length}`);
    const steps = ticks.slice(1).map(({ at }, i) => at - ticks[i].at);
    for (const step of steps) {
      const mantissa = Number((step / 10 ** Math.floor(Math.log10(step * 1.0000001))).toPrecision(6));
      assert.ok([1, 2, 5].includes(mantissa), `${step}`);
    }
    for (const { at, text } of ticks) {
      assert.ok(at >= low - 1e-9 && at <= high + 1e-9);
      assert.ok(Math.abs(Number(text) - at) < 1e-9 * Math.max(1, Math.abs(at)), `${at} is shown as ${text}`);
    }
    assert.equal(new Set(ticks.map(({ text }) => text)).size, ticks.length);
  }
});

test("the scale of an error begins at zero", () => {
  const { low, high, ticks } = linearScale(3, 7, { smallest: 0.1, count: 4, fromZero: true });
  assert.deepEqual([low, ticks[0].text], [0, "0"]);
  assert.ok(high > 7 && high < 10);
  assert.equal(linearScale(0, 0, { smallest: 0.1, count: 4, fromZero: true }).high, 0.1);
});

test("a logarithmic scale has a tick at each power of ten, and clips", () => {
  const scale = logScale(1e-3, 1);
  assert.deepEqual(scale.ticks.map(({ text }) => text), ["0.001", "0.01", "0.1", "1"]);
  assert.deepEqual([0, 1e-3, 1, 5].map((value) => fractionOf(scale, value)), [0, 0, 1, 1]);
  assert.ok(Math.abs(fractionOf(scale, 0.1) - 2 / 3) < 1e-12);
});

/** What `trace` draws: lists of points, one for each line without an interruption. */
function drawn(history, width) {
  const lines = [];
  const path = { moveTo: (x, y) => lines.push([[x, y]]), lineTo: (x, y) => lines.at(-1).push([x, y]) };
  trace(path, history, 0, 0, (time) => time * width, (value) => value);
  return lines;
}

test("a line has at most four points in a pixel, and keeps every peak", () => {
  const history = filled(Array.from({ length: 3000 }, (_, i) => [i / 3000, i === 1234 ? 50 : i === 2345 ? -50 : Math.sin(i)]), 3000);
  const [points] = drawn(history, 200);
  assert.ok(points.length <= 4 * 201);
  const heights = points.map(([, y]) => y);
  assert.deepEqual([Math.max(...heights), Math.min(...heights)], [50, -50]);
});

test("a line is interrupted where a value is not known, and where samples are missing for long", () => {
  assert.deepEqual(drawn(filled([[0, 1], [0.5, 2], [0.6, NaN], [0.7, 3], [0.8, 4], [9, 5], [9.5, 6]]), 10), [
    [[0, 1], [5, 2]],
    [[7, 3], [8, 4]],
    [[90, 5], [95, 6]],
  ]);
});

test("lines beyond the colours are dashed, and no two of the first twenty look alike", () => {
  const styles = Array.from({ length: 20 }, (_, i) => JSON.stringify(styleOf(i)));
  assert.equal(new Set(styles).size, 20);
  assert.deepEqual(styleOf(0).dashes, []);
});

test("quantities are those of the robots; errors are the largest of the robot's own tasks", () => {
  const joint = (name, type, actuated) => ({ name, type, actuated });
  const robots = [
    { name: "a", joints: [joint("j", "revolute", true), joint("s", "prismatic", false)], loops: [{}], couplings: [] },
    { name: "b", joints: [], loops: [], couplings: [] },
  ];
  const quantities = new Quantities(robots);
  assert.deepEqual(quantities.all.map(({ key }) => key), [
    "angles/a/j", "positions/a/s", "singular/a/lost DoF", "singular/a/uncontrolled DoF", "singular/b/lost DoF",
    "distance/a/", "rotation/a/", "distance/b/", "rotation/b/",
  ]);
  const tasks = [{ robot: "a", error: [0.1, 2] }, { robot: "a", error: [0.3, 1] }, { robot: "c", error: [9, 9] }];
  const report = { robots: { a: { q: [1, 2], type1: { sigma: 0.25 }, type2: null }, b: { q: [], type1: null, type2: null } } };
  const session = { state: { time: 5 }, tasks, report };
  quantities.sampleState(session);
  quantities.sampleReport(session);
  const [header, row] = csvOf([quantities.reports, quantities.states], 0).split("\r\n");
  assert.equal(header.split(",").length, 10);
  assert.match(header, /^time \(s\),q of a\/j \(rad\),q of a\/s \(m\),singular value of a: lost DoF \(1\),/);
  assert.equal(row, "5,1,2,0.25,,,0.3,2,,");
});

test("the range of values is that of the samples that are shown", () => {
  const history = filled([[0, 99], [5, 1], [6, NaN], [7, -2]]);
  assert.deepEqual(extremes(history, [0], 4), [-2, 1]);
  assert.deepEqual(extremes(history, [], 4), [0, 0]);
});

test("names of downloaded files have no characters that a file system refuses", () => {
  assert.equal(fileName('a/b\\c:"d".csv'), "a_b_c__d_.csv");
  assert.equal(fileName("\u0007é機.csv"), "_é機.csv");
});
