// The robot as a tree of its nodes: base, links and frames with the joints that carry them, loops marked. A chain runs
// straight down; only branches are moved in. Arrow keys walk, Enter selects.
//
// For tests: [data-node="ROBOT/NODE"] buttons with aria-pressed.

import { atMostEvery, button, make, press, sign } from "../base/dom.js";
import { keyOf } from "../base/session.js";
import { byRobot, filter, Section } from "./section.js";

/** @typedef {import("../base/session.js").Node} Description */

export class Tree {
  /** @type {Map<string, HTMLButtonElement>} */
  #nodes = new Map();

  /** @param {HTMLElement} panel @param {Session} session */
  constructor(panel, session) {
    this.session = session;
    this.section = new Section(panel, "tree", "Parts", "All parts of the robots. Click one to select it, also those that have no shape");
    session.on("hello", () => this.section.fill(() => this.#build()));
    session.on("select", () => this.#mark(true));
    const mark = atMostEvery(200, () => this.#mark(false));
    session.on("state", () => mark());
  }

  #build() {
    this.#nodes.clear();
    const { robots, obstacles } = this.session;
    this.section.note.textContent = String(robots.reduce((sum, robot) => sum + robot.nodes.length, 0));
    byRobot(this.section.body, robots, (robot, body) => {
      /** @type {Map<string | null, Description[]>} */
      const children = new Map();
      for (const node of robot.nodes) children.set(node.parent, [...(children.get(node.parent) ?? []), node]);
      const list = make("ul", { class: "tree", "aria-label": `Parts of ${robot.name}` });
      for (const node of robot.nodes) if (!robot.byName.has(node.parent ?? "")) this.#grow(list, robot, node, children);
      list.addEventListener("keydown", (event) => this.#walk(event, list));
      const actuated = robot.joints.filter((joint) => joint.actuated).length;
      const texts = [`mobility ${robot.mobility ?? "–"}`, `${actuated} actuated joints`, `${robot.loops.length} loops`];
      if (robot.couplings.length > 0) texts.push(`${robot.couplings.length} couplings`);
      if (robot.base !== null) texts.push(`base on ${robot.base.join(" · ")}`);
      body.append(make("p", { class: "empty" }, texts.join(" · ")), list);
      filter(body, "[data-node]", "Find a part");
    });
    if (obstacles.length > 0) this.section.body.append(this.#obstacles(obstacles));
    this.#mark(false);
  }

  /** @param {KnownRobot[]} obstacles */
  #obstacles(obstacles) {
    const list = make("ul", { class: "tree", "aria-label": "Obstacles" });
    for (const obstacle of obstacles) {
      if (obstacle.mobility > 0) list.append(this.#item(obstacle, obstacle.nodes[0]));
      else list.append(make("li", { class: "empty" }, obstacle.name));
    }
    list.addEventListener("keydown", (event) => this.#walk(event, list));
    const summary = make("summary", { title: "What the robot keeps clear of; drag it" }, "Obstacles");
    return make("details", { class: "robot", open: true }, summary, make("div", { class: "body" }, list));
  }

  /**
   * @param {HTMLElement} list
   * @param {KnownRobot} robot
   * @param {Description} first
   * @param {Map<string | null, Description[]>} children
   */
  #grow(list, robot, first, children) {
    for (let node = /** @type {Description | undefined} */ (first); node !== undefined;) {
      list.append(this.#item(robot, node));
      const below = children.get(node.name) ?? [];
      if (below.length > 1) {
        const inner = make("ul");
        for (const child of below) {
          const branch = make("ul");
          this.#grow(branch, robot, child, children);
          branch.firstElementChild?.classList.add("branch");
          inner.append(...branch.childNodes);
        }
        list.append(make("li", {}, inner));
        return;
      }
      node = below[0];
    }
  }

  /** @param {KnownRobot} robot @param {Description} node */
  #item(robot, node) {
    const kind = robot.obstacle ? "" : node.kind === "base" ? " base" : node.name === robot.end ? " end" : "";
    const joint = robot.joints.find((candidate) => candidate.name === node.joint);
    const loops = robot.loops.filter((loop) => loop.first === node.name || loop.second === node.name)
      .map((loop) => (loop.first === node.name ? loop.second : loop.first));
    const texts = [
      robot.obstacle ? "obstacle" : (node.kind ?? "node"),
      joint && !robot.obstacle ? `on ${joint.name} (${joint.actuated ? "actuated" : "passive"})` : "",
      loops.length > 0 ? `loop closed with ${loops.join(", ")}` : "",
      node.name === robot.end && !robot.obstacle ? "the tool" : "",
    ];
    const about = { class: `node${kind}`, data: { node: `${robot.name}/${node.name}` }, "aria-pressed": "false", title: texts.filter(Boolean).join("; ") };
    const parts = [make("span", { class: "text" }, node.name)];
    if (joint?.actuated && !robot.obstacle) parts.push(make("span", { class: "joint-name" }, joint.name));
    if (loops.length > 0) parts.push(make("span", { class: "loop" }, sign("loop"), loops.join(", ")));
    const part = button(about, () => this.session.select(robot.name, node.name), ...parts);
    this.#nodes.set(keyOf(robot.name, node.name), part);
    return make("li", {}, part);
  }

  /** @param {KeyboardEvent} event @param {HTMLElement} list */
  #walk(event, list) {
    const step = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
    if (step === 0) return;
    const all = [...list.querySelectorAll("button")];
    all[all.findIndex((button) => button === document.activeElement) + step]?.focus();
    event.preventDefault();
  }

  /** @param {boolean} show */
  #mark(show) {
    const { selected, tasks } = this.session;
    const chosen = selected === null ? null : keyOf(selected.robot, selected.node);
    const withTask = new Set(tasks.map((task) => keyOf(task.robot, task.node)));
    for (const [key, button] of this.#nodes) {
      press(button, key === chosen);
      button.classList.toggle("with-task", withTask.has(key));
    }
    if (show && this.section.element.open) this.#nodes.get(chosen ?? "")?.scrollIntoView({ block: "nearest" });
  }
}
