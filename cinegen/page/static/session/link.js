// The line of a page without a server: what cockpit/static/base/link.js gets from a server comes from a session in this
// page. It emits the same events: hello, state, report and notice.
//
// The configuration is in the fragment of the page's address as soon as the robots are at rest, so that the address is a
// link to it.

import { byId } from "../../../cockpit/static/base/dom.js";
import { Events } from "../../../cockpit/static/base/events.js";
import { cameraOf, configurationsOf, fragmentOf } from "../../../cockpit/static/base/fragment.js";
import { frames } from "../../../cockpit/static/base/frames.js";
import { Clock } from "./clock.js";
import { Kinematics } from "./kinematics.js";
import { kernelsOf } from "./memory.js";
import { reportMessage, stateMessage } from "./messages.js";
import { robotReport } from "./report.js";
import { DrivenRobot } from "./robot.js";
import { LocalSession } from "./session.js";
import { Placement } from "./placement.js";
import { KernelSolver } from "./solver.js";

const OFTEN = 100; // ms from one report to the next
const LONGEST = 30; // ms of ticks in a frame: a robot that needs more moves more slowly
const CLOSURE = 1e-10;

/** @typedef {import("../../../cockpit/static/base/messages").RobotReport} RobotReport */
/** @typedef {import("../../../cockpit/static/base/link.js").ServerEvents} ServerEvents */
/** @typedef {{ name: string, start: number[], base: import("./session.js").BasePose }} StartedRobot */
/**
 * What the page's file holds: the first message, what is drawn, the name of the kernels' module, and of each robot the
 * start, the base pose and the tables.
 * @typedef {{ hello: import("../../../cockpit/static/base/messages").HelloMessage, rate: number, scene: string[],
 *   kernels: string, robots: (StartedRobot & { tables: import("./solver_interface").Tables })[] }} Content
 */

/** @extends {Events<ServerEvents>} */
export class Link extends Events {
  /** @type {LocalSession | null} */
  session = null;
  /** @type {Record<string, RobotReport>} */
  #reports = {};
  #frame = 0;
  #reported = -Infinity; // ms
  #shown = false; // whether the last state and report are of now
  #placed = ""; // the fragment that was last written or read
  connected = false;
  /** @type {"session" | "page"} */
  owner = "page"; // of the configuration in the page's address

  /** @param {{ handle: (command: Uint8Array) => void }} view */
  constructor(view) {
    super();
    this.view = view;
    document.documentElement.dataset.connected = "no";
  }

  async connect() {
    /** @type {Content} */
    const content = JSON.parse(byId("cinegen-page").textContent ?? "");
    const kernels = await import(content.kernels);
    const solvers = content.robots.map(({ tables }) => new KernelSolver(kernelsOf(kernels, tables)));
    this.session = new LocalSession(...robotsOf(content, solvers));
    this.#placed = this.#fragment();
    for (const command of content.scene) this.view.handle(bytesOf(command));
    this.connected = true;
    document.documentElement.dataset.connected = "yes";
    this.emit("hello", content.hello);
    const clock = new Clock(1 / content.rate);
    frames.each((now) => this.#advance(clock, now));
    this.#restore();
    window.addEventListener("hashchange", () => this.#restore());
  }

  /** @param {import("../../../cockpit/static/base/link.js").ClientMessage} message */
  send(message) {
    this.#shown = false;
    this.session?.obey(message);
  }

  /** @param {Clock} clock @param {number} now */
  #advance(clock, now) {
    const session = /** @type {LocalSession} */ (this.session);
    const ticks = clock.due(now);
    if (session.atRest && this.#shown) {
      clock.note(now, 0);
      return;
    }
    const begin = performance.now();
    let done = 0;
    for (; done < ticks && performance.now() - begin < LONGEST; done += 1) session.tick(clock.period);
    clock.note(now, done);
    for (const notice of session.notices.splice(0)) this.emit("notice", notice);
    this.#frame += 1;
    const state = stateMessage(session, this.#reports, this.#frame);
    this.emit("state", state);
    document.documentElement.dataset.frame = String(this.#frame);
    if (now - this.#reported < OFTEN) return;
    this.#reported = now;
    this.#reports = Object.fromEntries([...session.robots.values()].map((robot) => [robot.name, robotReport(robot)]));
    const { atRest } = session;
    this.#shown = atRest; // one more than the last that moved
    if (atRest) this.#writeAddress();
    this.emit("report", reportMessage(session, this.#reports, { ticks: clock.ticks, missed: 0, missed_in_all: 0, late: 0, at_rest: atRest }));
  }

  /** Return the present configuration of each robot, by name. @returns {[string, Float64Array][]} */
  configurations() {
    const robots = /** @type {LocalSession} */ (this.session).robots;
    return [...robots.values()].map(({ name, q }) => [name, q]);
  }

  #fragment() {
    return fragmentOf(this.configurations(), cameraOf(location.hash).camera);
  }

  /** Write the configuration into the page's address. */
  #writeAddress() {
    const fragment = this.#fragment();
    if (fragment === this.#placed) return;
    this.#placed = fragment;
    history.replaceState(null, "", fragment);
  }

  /** Place the robots as the page's address has them; a notice gives the reason if that can't be. */
  #restore() {
    const fragment = location.hash;
    if (fragment === this.#placed) return;
    this.#placed = fragment;
    const session = /** @type {LocalSession} */ (this.session);
    const sizes = new Map([...session.robots.values()].map(({ name, q }) => [name, q.length]));
    const linked = configurationsOf(fragment, sizes);
    let { problem } = linked;
    for (const [name, q] of linked.configurations) {
      const { kinematics } = /** @type {DrivenRobot} */ (session.robots.get(name));
      if (kinematics.solver.floating) q.set(Placement.of(q).numbers());
      const closed = kinematics.closure(q) <= CLOSURE || kinematics.solver.close(q, kinematics.locked) <= CLOSURE;
      const [beyond] = closed ? kinematics.beyond(q) : [];
      if (closed && beyond === undefined) session.place(name, q);
      else problem = `the link's configuration of ${name} ${closed ? `is beyond the limit of ${beyond.name}` : "leaves loops open"}`;
    }
    this.#shown = false;
    if (problem) this.emit("notice", { text: problem, level: "warning" });
  }
}

/** Return the bytes of a text in base16. @param {string} text */
function bytesOf(text) {
  return Uint8Array.from({ length: text.length / 2 }, (_, i) => parseInt(text.slice(2 * i, 2 * i + 2), 16));
}

/**
 * Return the robots, and their base poses.
 * @param {Pick<Content, "hello"> & { robots: StartedRobot[] }} content
 * @param {import("./solver_interface").Solver[]} solvers of each robot
 * @returns {[Map<string, DrivenRobot>, Record<string, import("./session.js").BasePose>]}
 */
export function robotsOf({ hello, robots }, solvers) {
  const descriptions = new Map(hello.robots.map((description) => [description.name, description]));
  const driven = robots.map(({ name, start }, i) => {
    const description = descriptions.get(name);
    if (description === undefined) throw new Error(`no robot '${name}'`);
    return new DrivenRobot(name, new Kinematics(description, solvers[i], start));
  });
  return [new Map(driven.map((robot) => [robot.name, robot])), Object.fromEntries(robots.map(({ name, base }) => [name, base]))];
}
