// The state of the session: its robots, the newest messages, who has control, and the selected part.
//
// Events, besides the link's: control ("mine", "other" or "free"), select ({ robot, node } or null), over (the part that a pointer
// is on, in the scene or in a list, or null), denied.

import { Events } from "./events.js";

const NUMBERED = /^(link|frame)\d+$/; // names that say nothing

/**
 * @typedef {import("./messages").NodeDescription} Node
 * @typedef {"mine" | "other" | "free"} Control
 * @typedef {{ robot: string, node: string }} Part
 * @typedef {import("./messages").RobotDescription & { obstacle: boolean, byName: Map<string, Node> }} KnownRobot
 * @typedef {Pick<import("./link.js").Link, "on" | "send" | "owner" | "configurations" | "connected">} Line
 */

/** @extends {Events<import("./link.js").ServerEvents & { control: Control, select: Part | null, over: Part | null, denied: undefined }>} */
export class Session extends Events {
  /** @type {Hello | null} */
  hello = null;
  /** @type {State | null} */
  state = null;
  /** @type {SessionReport | null} */
  report = null;
  /** @type {Control} */
  control = "free";
  /** @type {Part | null} */
  selected = null;
  /** @type {Map<string, KnownRobot>} */
  #robots = new Map();

  /** @param {Line} link */
  constructor(link) {
    super();
    this.link = link;
    link.on("hello", (hello) => this.#meet(hello));
    link.on("state", (state) => this.#follow(state));
    link.on("report", (report) => {
      this.report = report;
      this.emit("report", report);
    });
    for (const name of /** @type {const} */ (["notice", "problem", "lost", "silent", "dropped"])) link.on(name, (value) => this.emit(name, value));
    document.documentElement.dataset.control = this.control;
  }

  /** @param {ClientMessage} message */
  send(message) {
    this.link.send(message);
  }

  get robots() {
    return [...this.#robots.values()].filter(({ obstacle }) => !obstacle);
  }

  /** Obstacles, of one part each. */
  get obstacles() {
    return [...this.#robots.values()].filter(({ obstacle }) => obstacle);
  }

  /** Return a robot or an obstacle. @param {string} name */
  robot(name) {
    return this.#robots.get(name) ?? null;
  }

  /** Return whether there is such a part. @param {string} robot @param {string} node */
  knows(robot, node) {
    return this.#robots.get(robot)?.byName.has(node) ?? false;
  }

  /**
   * Return whether nothing can move a part: no joint lies between it and a base that stands still.
   * @param {string} robot
   * @param {string} node
   */
  isFixed(robot, node) {
    const owner = this.robot(robot);
    if (owner === null || owner.obstacle || owner.root) return false;
    let part = owner.byName.get(node);
    while (part && !part.joint) part = owner.byName.get(part.parent ?? "");
    return part === undefined;
  }

  /**
   * Return the name of a part for people: that of a frame on it, such as a tool, where it has only a number itself.
   * @param {string} robot
   * @param {string} node
   */
  called(robot, node) {
    const owner = this.robot(robot);
    if (owner?.obstacle) return robot;
    const frames = NUMBERED.test(node) ? (owner?.nodes ?? []).filter(({ name, parent, kind }) => kind === "frame" && parent === node && !NUMBERED.test(name)) : [];
    const name = (frames.find(({ name: frame }) => frame === owner?.end) ?? frames[0])?.name ?? node;
    return this.robots.length > 1 ? `${robot} · ${name}` : name;
  }

  /** Return the present values of each robot's joints, by name. @returns {[string, ArrayLike<number>][]} */
  configurations() {
    const reported = Object.entries(this.report?.robots ?? {}).map(([name, { q }]) => [name, q]);
    return this.link.configurations() ?? /** @type {[string, number[]][]} */ (reported);
  }

  /** The present tasks. */
  get tasks() {
    return this.state?.tasks ?? [];
  }

  /** Whether robots do what a person had them do, now or when it was recorded. */
  get driven() {
    return this.control !== "free" || Boolean(this.hello?.playback);
  }

  /** Whether this page only views: the server refuses its commands. */
  get viewOnly() {
    return this.hello?.view_only ?? false;
  }

  /** Return whether commands may be sent; tell the user if another browser has control, or this page only views. */
  mayAct() {
    if (this.control !== "other" && !this.viewOnly) return true;
    this.emit("denied");
    return false;
  }

  /** Send a command, if it may be sent. @param {ClientMessage} message */
  command(message) {
    if (this.mayAct()) this.send(message);
  }

  /** Select a part; nothing if there is no such part. @param {string | null} robot @param {string | null} node */
  select(robot, node) {
    const selected = robot !== null && node !== null && this.knows(robot, node) ? { robot, node } : null;
    if (selected?.robot === this.selected?.robot && selected?.node === this.selected?.node) return;
    this.selected = selected;
    this.emit("select", selected);
  }

  /** @param {Hello} hello */
  #meet(hello) {
    this.hello = hello;
    this.state = this.report = null;
    this.#robots.clear();
    for (const robot of hello.robots ?? []) {
      const nodes = robot.nodes ?? [];
      const { joints = [], loops = [], couplings = [] } = robot;
      const byName = new Map(nodes.map((node) => [node.name, node]));
      const parts = { nodes, joints, loops, couplings, byName };
      this.#robots.set(robot.name, { ...robot, ...parts, obstacle: false });
    }
    for (const obstacle of hello.obstacles ?? []) this.#robots.set(obstacle.name, asRobot(obstacle));
    this.emit("hello", hello);
    if (this.selected !== null && !this.knows(this.selected.robot, this.selected.node)) this.select(null, null);
  }

  /** @param {State} state */
  #follow(state) {
    this.state = state;
    const controller = state.controller ?? null;
    const control = this.viewOnly ? "other" : controller === null ? "free" : controller === this.hello?.client ? "mine" : "other";
    this.emit("state", state);
    if (control === this.control) return;
    this.control = control;
    document.documentElement.dataset.control = control;
    this.emit("control", control);
  }
}

/**
 * Return an obstacle as a robot of one part.
 * @param {import("./messages").ObstacleDescription} obstacle
 * @returns {KnownRobot}
 */
function asRobot({ name, length, mobility }) {
  const node = { name, parent: null, joint: null, kind: /** @type {const} */ ("link") };
  const byName = new Map([[name, node]]);
  const parts = { nodes: [node], joints: [], loops: [], couplings: [], byName };
  const forces = { missing: "it is an obstacle", largest_payload: 0, excluded: [] };
  return { name, robot: name, obstacle: true, length, mobility, end: name, base: null, forces, ...parts };
}

/** Return the key of a part in maps. @param {string} robot @param {string} node */
export function keyOf(robot, node) {
  return `${robot}\n${node}`;
}

/** Return the part of a key: [robot, node]. @param {string} key @returns {[string, string]} */
export function partOf(key) {
  const [robot = "", node = ""] = key.split("\n");
  return [robot, node];
}
