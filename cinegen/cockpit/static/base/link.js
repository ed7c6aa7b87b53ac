// The line to the server: meshcat's commands on /scene, what moves and what is said on /session.
//
// Events: hello, state, report, notice, open, lost (words), dropped (words).
// A state is applied by whoever listens, and only then acknowledged: rendering has no part in it.

import { Events } from "./events.js";

/**
 * What the server sends: `hello` once, then `state` at every frame, some of them with a `report`, and `notice`. They are
 * made in cinegen/cockpit/frames.py and hub.py; a hostile server may leave out anything that is optional here.
 *
 * @typedef {{ name: string, parent: string | null, joint: string | null, kind: "base" | "link" | "frame" }} Node
 * @typedef {{ name: string, type: string, actuated: boolean, home?: number, low?: number | null, high?: number | null }} Joint
 * @typedef {{ first: string, second: string }} Loop
 * @typedef {{ name: string, robot: string, obstacle: boolean, length: number, mobility: number, end: string,
 *   stands_on: [string, string] | null, nodes?: Node[], joints?: Joint[], loops?: Loop[] }} Robot
 * @typedef {{ id: string, url?: string, what?: string }} Sensor
 * @typedef {{ robot: string, node: string, choices?: (string | null)[] }} Switch
 * @typedef {{ kind: "hello", protocol: number, client: number, title: string, robots?: Robot[], sensors?: Sensor[],
 *   switches?: Switch[], frames: string[], map?: string | null,
 *   replay?: { file: string, seconds: number, stops: number[] } | null }} Hello
 * @typedef {{ id: number, robot: string, node: string, who: string, label: string | null, point: number[],
 *   target: number[], error: number[], holds: [number, number], weight: number }} Task
 * @typedef {{ kind: "state", time: number, frame?: number, hand?: number | null, poses: Record<string, number[]>,
 *   tasks?: Task[], statuses?: Record<string, { name: string, words: string }>, report?: Report }} State
 * @typedef {{ sigma: number | null, near: number, words?: string, node?: string, at?: number[], twist?: number[] }} Singular
 * @typedef {{ time: number, kind: string, words: string, at: number[] }} Foreseen
 * @typedef {{ q?: number[], saturated: string[], near: string[], closure: number | null, type1: Singular | null,
 *   type2: Singular | null, ellipsoid: { at: number[], axes: number[][] } | null,
 *   forecast: { path: number[][], events: Foreseen[] } }} RobotReport
 * @typedef {{ id: string, state: string, words: string, packets: number, damaged: number, twist: number[] | null }} SensorReport
 * @typedef {{ robots?: Record<string, RobotReport>, sensors?: SensorReport[],
 *   switches?: { robot: string, node: string, sensor: string | null }[], settings?: { frame: string, speed: number, turning: number, gain: number, damping: number },
 *   undo: number, redo: number, paused: boolean, moving: string | null,
 *   recording: { file: string, seconds: number, error: string | null } | null,
 *   replay: { time: number, playing: boolean, speed: number } | null,
 *   rate: { ticks: number, late: number }, clients: number }} Report
 * @typedef {{ kind?: "notice", words: string, level?: string, action?: { words: string, run: () => void } }} Notice
 */

/**
 * @typedef {{ hello: Hello, state: State, report: Report, notice: Notice, lost: string, dropped: string }} Said
 */

const SOONEST = 500; // ms to the next try to reach the server
const LATEST = 3000;
const REFUSED = 1008; // the server wants no more of us

/** @extends {Events<Said>} */
export class Link extends Events {
  /** @type {WebSocket[]} */
  #sockets = [];
  /** @type {WebSocket | null} */
  #session = null;
  #wait = SOONEST;
  #over = false;
  connected = false;

  /** @param {(address: string) => WebSocket} scene what connects meshcat's viewer to an address and returns its socket */
  constructor(scene) {
    super();
    this.scene = scene;
    document.documentElement.dataset.connected = "no";
    window.addEventListener("pagehide", () => {
      this.#over = true;
    });
  }

  connect() {
    const session = new WebSocket(address("session"));
    const scene = this.scene(address("scene"));
    this.#sockets = [session, scene];
    session.addEventListener("message", (event) => this.#hear(event.data));
    for (const socket of this.#sockets) socket.addEventListener("close", (event) => this.#close(socket, event));
    this.#session = session;
  }

  /**
   * Says something to the server; nothing while the line is cut.
   *
   * @param {object} object
   */
  send(object) {
    if (this.#session?.readyState === WebSocket.OPEN) this.#session.send(JSON.stringify(object));
  }

  /** @param {string} text */
  #hear(text) {
    let said;
    try {
      said = JSON.parse(text);
    } catch {
      return;
    }
    if (said.kind === "state") {
      this.tell("state", said);
      if (Number.isFinite(said.frame)) {
        this.send({ ack: said.frame });
        document.documentElement.dataset.frame = String(said.frame);
      }
      if (said.report) this.tell("report", said.report);
    } else if (said.kind === "hello") {
      this.connected = true;
      this.#wait = SOONEST;
      document.documentElement.dataset.connected = "yes";
      this.tell("hello", said);
    } else if (said.kind === "notice") {
      this.tell("notice", said);
    }
  }

  /**
   * @param {WebSocket} socket
   * @param {CloseEvent} event
   */
  #close(socket, event) {
    if (!this.#sockets.includes(socket)) return; // the other of the two has told it already
    const others = this.#sockets.filter((other) => other !== socket);
    this.#sockets = [];
    for (const other of others) other.close();
    this.connected = false;
    document.documentElement.dataset.connected = "no";
    if (this.#over) return;
    if (event.code === REFUSED) {
      this.tell("dropped", event.reason || "the server refused this page");
      return;
    }
    this.tell("lost", event.reason);
    setTimeout(() => this.connect(), this.#wait);
    this.#wait = Math.min(LATEST, 1.5 * this.#wait);
  }
}

/**
 * A socket's address beside the page's own, with its token.
 *
 * @param {string} name
 */
function address(name) {
  const url = new URL(beside(name));
  url.protocol = url.protocol.replace("http", "ws");
  return url.href;
}

/**
 * An address beside the page's own, with its token.
 *
 * @param {string} name
 */
export function beside(name) {
  const url = new URL(name, location.href);
  const token = new URLSearchParams(location.search).get("token");
  if (token !== null) url.searchParams.set("token", token);
  return url.href;
}
