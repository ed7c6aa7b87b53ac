// What is known of the session: who is in it, where everything stands, who holds the hand, which part is selected.
//
// Events, besides the link's: hand ("mine", "other" or "free"), select ({ robot, node } or null).

import { Events } from "./events.js";

/**
 * @typedef {import("./link.js").Hello} Hello
 * @typedef {import("./link.js").State} State
 * @typedef {import("./link.js").Node} Node
 * @typedef {"mine" | "other" | "free"} Hand
 * @typedef {{ robot: string, node: string }} Part
 * @typedef {Required<import("./link.js").Robot> & { byName: Map<string, Node> }} KnownRobot
 * @typedef {Pick<import("./link.js").Link, "on" | "send">} Line
 */

/** @extends {Events<import("./link.js").Said & { hand: Hand, select: Part | null, denied: undefined }>} */
export class Session extends Events {
  /** @type {Hello | null} */
  hello = null;
  /** @type {State | null} */
  state = null;
  /** @type {import("./link.js").Report | null} */
  report = null;
  /** @type {Hand} */
  hand = "free";
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
      this.tell("report", report);
    });
    for (const name of /** @type {const} */ (["notice", "lost", "dropped"])) link.on(name, (value) => this.tell(name, value));
    document.documentElement.dataset.hand = this.hand;
  }

  /** @param {object} object */
  send(object) {
    this.link.send(object);
  }

  get robots() {
    return [...this.#robots.values()].filter(({ obstacle }) => !obstacle);
  }

  /** What robots keep clear of: each has one part. */
  get obstacles() {
    return [...this.#robots.values()].filter(({ obstacle }) => obstacle);
  }

  /**
   * A robot or an obstacle.
   *
   * @param {string} name
   */
  robot(name) {
    return this.#robots.get(name) ?? null;
  }

  /**
   * Whether there is such a part.
   *
   * @param {string} robot
   * @param {string} node
   */
  knows(robot, node) {
    return this.#robots.get(robot)?.byName.has(node) ?? false;
  }

  /**
   * What people call a part.
   *
   * @param {string} robot
   * @param {string} node
   */
  called(robot, node) {
    if (this.robot(robot)?.obstacle) return robot;
    return this.robots.length > 1 ? `${robot} · ${node}` : node;
  }

  /** Whether a part is pulled, and by whom: the tasks that hold now. */
  get tasks() {
    return this.state?.tasks ?? [];
  }

  /** Whether commands may be given; says so where another browser holds the hand. */
  mayAct() {
    if (this.hand !== "other") return true;
    this.tell("denied");
    return false;
  }

  /**
   * Selects a part, or nothing where there is no such part.
   *
   * @param {string | null} robot
   * @param {string | null} node
   */
  select(robot, node) {
    const selected = robot !== null && node !== null && this.knows(robot, node) ? { robot, node } : null;
    if (selected?.robot === this.selected?.robot && selected?.node === this.selected?.node) return;
    this.selected = selected;
    this.tell("select", selected);
  }

  /** @param {Hello} hello */
  #meet(hello) {
    this.hello = hello;
    this.state = this.report = null;
    this.#robots.clear();
    for (const robot of hello.robots ?? []) {
      const nodes = robot.nodes ?? [];
      const joints = robot.joints ?? [];
      const byName = new Map(nodes.map((node) => [node.name, node]));
      this.#robots.set(robot.name, { ...robot, nodes, joints, loops: robot.loops ?? [], byName });
    }
    this.tell("hello", hello);
    if (this.selected !== null && !this.knows(this.selected.robot, this.selected.node)) this.select(null, null);
  }

  /** @param {State} state */
  #follow(state) {
    this.state = state;
    const holder = state.hand ?? null;
    const hand = holder === null ? "free" : holder === this.hello?.client ? "mine" : "other";
    this.tell("state", state);
    if (hand === this.hand) return;
    this.hand = hand;
    document.documentElement.dataset.hand = hand;
    this.tell("hand", hand);
  }
}

/**
 * A part's key in maps.
 *
 * @param {string} robot
 * @param {string} node
 */
export function keyOf(robot, node) {
  return `${robot}\n${node}`;
}

/**
 * A part by its key: [robot, node].
 *
 * @param {string} key
 * @returns {[string, string]}
 */
export function partOf(key) {
  const [robot = "", node = ""] = key.split("\n");
  return [robot, node];
}
