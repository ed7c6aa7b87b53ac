import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";

import { root } from "./browser.js";

const { pageUrl } = await import("../../cinegen/cockpit/static/base/address.js");
const { Link } = await import("../../cinegen/cockpit/static/base/link.js");

class Socket extends EventTarget {
  static OPEN = 1;
  static opened = [];
  readyState = Socket.OPEN;
  sent = [];

  constructor(url) {
    super();
    this.url = url;
    Socket.opened.push(this);
  }

  send(text) {
    this.sent.push(JSON.parse(text));
  }

  close() {
    this.readyState = 3;
    this.dispatchEvent(new Event("close"));
  }

  state(object) {
    const text = new TextEncoder().encode(JSON.stringify(object).padEnd(400));
    const data = new Uint8Array(8 + text.length);
    new DataView(data.buffer).setUint32(4, text.length, true);
    data.set(text, 8);
    this.dispatchEvent(Object.assign(new Event("message"), { data: data.buffer }));
  }

  say(object) {
    this.dispatchEvent(Object.assign(new Event("message"), { data: JSON.stringify(object) }));
  }

  cut(code = 1006, reason = "") {
    this.readyState = 3;
    this.dispatchEvent(Object.assign(new Event("close"), { code, reason }));
  }
}
globalThis.WebSocket = Socket;

let link;
let last;
let drawn;

beforeEach(() => {
  mock.timers.reset();
  mock.timers.enable({ apis: ["setTimeout"] });
  Socket.opened = [];
  drawn = [];
  link = new Link({ clear: () => drawn.push("clear"), handle: (command) => drawn.push([...command]) });
  last = [];
  for (const name of ["hello", "state", "report", "notice", "lost", "dropped"]) {
    link.on(name, (value) => last.push([name, value]));
  }
  link.connect();
});

test("addresses keep the page's token", () => {
  assert.equal(pageUrl("map/about.json"), "http://127.0.0.1:7000/map/about.json?token=a+b");
  assert.deepEqual(Socket.opened.map(({ url }) => url), ["ws://127.0.0.1:7000/page?token=a+b"]);
});

test("a state is acknowledged after all listeners have applied it", () => {
  const [session] = Socket.opened;
  link.on("state", () => last.push(["sent before", session.sent.length]));
  session.say({ type: "hello", robots: [] });
  session.state({ type: "state", frame: 5, report: { clients: 1 } });
  assert.deepEqual(last.map(([name]) => name), ["hello", "state", "sent before", "report"]);
  assert.deepEqual(last[2], ["sent before", 0]);
  assert.deepEqual(session.sent, [{ type: "ack", frame: 5 }]);
  assert.equal(root.dataset.frame, "5");
});

test("a line that stands begins with nothing drawn, and what is no state is drawn", () => {
  const [session] = Socket.opened;
  session.dispatchEvent(new Event("open"));
  session.dispatchEvent(Object.assign(new Event("message"), { data: Uint8Array.of(0x83, 1, 2).buffer }));
  assert.deepEqual(drawn, ["clear", [0x83, 1, 2]]);
});

test("text that is not JSON, and messages of unknown kinds, are ignored", () => {
  const [session] = Socket.opened;
  session.dispatchEvent(Object.assign(new Event("message"), { data: "{" }));
  session.say({ type: "gossip" });
  assert.deepEqual(last, []);
});

test("a cut line is last once, and tried again after ever longer waits", () => {
  for (const wait of [500, 750, 1125, 1687.5, 2531.25, 3000, 3000]) {
    last.length = 0;
    const [session] = Socket.opened.splice(0);
    session.cut(1006, "gone");
    assert.deepEqual(last, [["lost", "gone"]]);
    mock.timers.tick(Math.floor(wait) - 1);
    assert.equal(Socket.opened.length, 0, `too early before ${wait} ms`);
    mock.timers.tick(2);
    assert.equal(Socket.opened.length, 1, `no try after ${wait} ms`);
  }
  const [session] = Socket.opened.splice(0);
  session.say({ type: "hello" });
  assert.equal(link.connected, true);
  session.cut();
  assert.equal(link.connected, false);
  mock.timers.tick(501);
  assert.equal(Socket.opened.length, 1, "a hello begins with short waits again");
});

test("a server that refuses the page is not asked again", () => {
  const [session] = Socket.opened.splice(0);
  session.cut(1008, "a wrong token");
  mock.timers.tick(60_000);
  assert.deepEqual(last, [["dropped", "a wrong token"]]);
  assert.equal(Socket.opened.length, 0);
});

test("a page that is left does not connect again", () => {
  window.dispatchEvent(new Event("pagehide"));
  Socket.opened.splice(0)[0].cut();
  mock.timers.tick(60_000);
  assert.deepEqual(last, []);
  assert.equal(Socket.opened.length, 0);
});

test("nothing is sent while the line is cut", () => {
  const [session] = Socket.opened;
  link.send({ home: true });
  session.readyState = 3;
  link.send({ home: true });
  assert.deepEqual(session.sent, [{ home: true }]);
});
