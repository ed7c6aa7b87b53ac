import assert from "node:assert/strict";
import test from "node:test";
import { StatusAnnouncer } from "../../cinegen/cockpit/static/bar/status_announcer.js";

const FOLLOWING = { name: "FOLLOWING", label: "following", driven: true };
const IDLE = { name: "IDLE", label: "idle", driven: false };

/** An announcer, what it has announced, and `pass(ms, status)`: the status is offered every 100 ms. */
function begin(t) {
  t.mock.timers.enable({ apis: ["setTimeout", "Date"], now: 1e6 });
  const said = [];
  const announcer = new StatusAnnouncer((text) => said.push(text));
  const pass = (milliseconds, status) => {
    for (let i = 0; i < milliseconds / 100; i += 1) {
      announcer.offer(typeof status === "function" ? status(i) : status);
      t.mock.timers.tick(100);
    }
  };
  return { said, pass };
}

test("a target that is out of reach is announced once while its distance changes", (t) => {
  const { said, pass } = begin(t);
  pass(1000, FOLLOWING);
  pass(10_000, (i) => ({ name: "OUT_OF_REACH", label: `out of reach by ${10 + i}.5 mm`, driven: true }));
  assert.equal(said.length, 1);
  assert.match(said[0], /^out of reach by \d+\.5 mm$/);
  pass(3000, FOLLOWING);
  assert.deepEqual(said.slice(1), ["following"]); // it is over
});

test("reached, at a limit, singular", (t) => {
  const { said, pass } = begin(t);
  pass(1000, IDLE);
  pass(1000, FOLLOWING);
  assert.deepEqual(said, []);
  pass(3000, { name: "IDLE", label: "idle", driven: true });
  pass(3000, { name: "AT_LIMIT", label: "at the limit of joint12", driven: true });
  pass(3000, { name: "AT_LIMIT", label: "at the limit of joint6", driven: true });
  pass(3000, { name: "SINGULAR", label: "near a singularity: lost DoF", driven: true });
  pass(3000, IDLE);
  assert.deepEqual(said, ["target reached", "at the limit of joint12", "at the limit of joint6", "near a singularity: lost DoF", "idle"]);
});

test("a status that changes all the time does not flood", (t) => {
  const { said, pass } = begin(t);
  const limit = (i) => ({ name: "AT_LIMIT", label: `at the limit of joint${i}`, driven: true });
  pass(20_000, (i) => limit(i % 2)); // never the same for 400 ms
  assert.equal(said.length, 0);
  pass(20_000, (i) => limit(Math.floor(i / 5))); // each for half a second
  assert.ok(said.length >= 5 && said.length <= 10, `${said.length} announcements in 20 s`);
});
