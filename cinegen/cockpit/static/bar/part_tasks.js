// Tasks of the selected part that a hand can give: it stays upright, looks at a part or a point, or is pinned to another
// part. A chip shows each task of the part, and removes it.
//
// For tests: #stay-upright #look-at #pin-to (aria-pressed), #choosing, #selection [data-described="ID"] with button.

import { atMostEvery, button, keepOnly, make, press, sign, write } from "../base/dom.js";
import { announce } from "../base/speech.js";

const OFTEN = 100; // ms
const UP = [0, 0, 1];

/**
 * @typedef {import("../base/messages").DescribedMessage} Described
 * @typedef {import("../base/messages").TaskDescription} Description
 * @typedef {"look-at" | "pin-to"} Choice
 */

/** Return the text of a task for people. @param {Description} task @returns {string} */
export function textOf(task) {
  switch (task.kind) {
    case "relative_pose": return `${task.node} pinned to ${task.other}`;
    case "look_at": return `${task.node} looks at ${task.on ?? "a point"}`;
    case "axis_along": return isUpright(task) ? `${task.node} stays upright` : `${task.node} along a direction`;
    case "range": return `range: ${textOf(task.task)}`;
    default: {
      const joints = "values" in task ? task.values : "coefficients" in task ? task.coefficients : {};
      return ["node" in task ? task.node : Object.keys(joints).join(", "), task.kind.replaceAll("_", " ")].filter(Boolean).join(": ");
    }
  }
}

/** @param {Description} task */
function isUpright(task) {
  return task.kind === "axis_along" && !task.on && (task.direction ?? UP).every((value, i) => Math.abs(value - UP[i]) < 1e-9);
}

/** Return the parts that a task is about. @param {Description} task @returns {string[]} */
function partsOf(task) {
  if (task.kind === "range") return partsOf(task.task);
  const { node, other, on } = /** @type {Record<string, string | undefined>} */ (/** @type {unknown} */ (task));
  return [node, other, on].filter((name) => name !== undefined && name !== null);
}

export class PartTasks {
  /** @type {Choice | null} */
  #choice = null;
  /** @type {Part | null} */
  #part = null; // whose task is chosen
  /** @type {Map<number, { element: HTMLElement, text: HTMLElement }>} */
  #chips = new Map();

  /**
   * @param {{ session: Session, view: View,
   *   pick: import("../pointer/pick.js").Pick, measure: { toggle: (on?: boolean) => boolean }, bar: HTMLElement, more: HTMLElement }} parts
   */
  constructor({ session, view, pick, measure, bar, more }) {
    this.session = session;
    this.view = view;
    this.pick = pick;
    /** @param {string} id @param {string} title @param {string} mark @param {string} text @param {() => void} click */
    const task = (id, title, mark, text, click) =>
      button({ id, class: "small", title, "aria-pressed": "false" }, click, sign(mark), make("span", { class: "word" }, text));
    /** @param {Choice} choice */
    const choose = (choice) => () => {
      measure.toggle(false);
      this.#choose(this.#choice === choice ? null : choice);
    };
    this.upright = task("stay-upright", "Keep upright: its inclination stays while parts are dragged", "up", "Keep upright", () => this.#toggleUpright());
    this.choices = {
      "look-at": task("look-at", "Aim at: its z axis points to the part or the point that you click next", "aim", "Aim at …", choose("look-at")),
      "pin-to": task("pin-to", "Pin to: it stays where it is relative to the part that you click next", "link", "Pin to …", choose("pin-to")),
    };
    this.hint = make("output", { id: "choosing", "aria-live": "off", hidden: true });
    this.row = make("div", { class: "tasks" }, this.upright, ...Object.values(this.choices));
    this.chosen = make("div", { class: "tasks chosen" }, this.hint);
    more.append(this.row);
    bar.append(this.chosen);
    view.pane.addEventListener("pointerdown", (event) => this.#click(event), true); // before a drag begins
    const show = atMostEvery(OFTEN, () => this.#show());
    session.on("state", () => show());
    session.on("select", (other) => {
      const [part, choice] = [this.#part, this.#choice];
      this.stop();
      if (part !== null && other !== null) { // the other part was selected by a key, or in the panel
        session.select(part.robot, part.node);
        this.#choose(choice);
        this.#take(other, view.pose(other.robot, other.node).position.clone());
      }
      this.#show();
    });
  }

  /** End a choice; return whether there was one. */
  stop() {
    const busy = this.#choice !== null;
    if (busy) this.#choose(null);
    return busy;
  }

  /** Tasks of the selected part. */
  get #onPart() {
    const { selected, state } = this.session;
    return (state?.described ?? []).filter(
      ({ robot, description }) => robot === selected?.robot && partsOf(description).includes(selected.node),
    );
  }

  /** @returns {Described | undefined} */
  get #upright() {
    return this.#onPart.find(({ description }) => isUpright(description));
  }

  /** @param {Choice | null} choice */
  #choose(choice) {
    this.#choice = choice;
    this.#part = choice === null ? null : this.session.selected;
    const name = this.session.selected?.node ?? "";
    const texts = { "look-at": `Click the part or the point that ${name} looks at`, "pin-to": `Click the part that ${name} is pinned to` };
    for (const [name, task] of Object.entries(this.choices)) press(task, name === choice);
    this.hint.hidden = choice === null;
    this.chosen.parentElement?.classList.toggle("choosing", choice !== null); // it must not cover what is clicked
    write(this.hint, choice === null ? "" : `${texts[choice]} (Esc: none)`);
    if (choice !== null) announce(texts[choice]);
  }

  #toggleUpright() {
    const { selected } = this.session;
    if (selected === null || !this.session.mayAct()) return;
    const task = this.#upright?.id;
    if (task !== undefined) this.session.send({ type: "remove_task", task });
    else this.#add({ kind: "axis_along", node: selected.node, axis: null });
  }

  /** @param {Description} description */
  #add(description) {
    const { selected } = this.session;
    if (selected !== null) this.session.command({ type: "add_task", robot: selected.robot, description });
  }

  /** @param {PointerEvent} event */
  #click(event) {
    if (this.#choice === null || !event.isPrimary || event.button !== 0) return;
    const hit = this.pick.near(event);
    if (hit === null) return;
    event.stopImmediatePropagation();
    this.#take(hit, this.view.root.worldToLocal(hit.point.clone()));
  }

  /**
   * Give the selected part the task of the choice.
   * @param {Part} other
   * @param {import("three").Vector3} point on it, in the world (m)
   */
  #take(other, point) {
    const [choice, part] = [this.#choice, this.#part];
    if (choice === null || part === null) return;
    const same = other.robot === part.robot;
    if (same && other.node === part.node) return this.#refuse(`${other.node} is the part itself: click another`);
    if (choice === "look-at") {
      if (same) point = within(point, this.view.pose(other.robot, other.node));
      const [x, y, z] = point.toArray();
      this.#add({ kind: "look_at", node: part.node, point: [x, y, z], on: same ? other.node : null });
    } else if (same) this.#add({ kind: "relative_pose", node: part.node, other: other.node });
    else return this.#refuse(`${other.node} is part of ${other.robot}: only parts of one robot can be pinned together`);
    this.stop();
  }

  /** @param {string} text */
  #refuse(text) {
    this.session.emit("notice", { text, level: "warning" });
  }

  #show() {
    this.row.hidden = this.session.robot(this.session.selected?.robot ?? "")?.obstacle ?? true;
    press(this.upright, this.#upright !== undefined);
    const onPart = this.#onPart;
    keepOnly(this.#chips, onPart.map(({ id }) => id));
    for (const { id, description, reached } of onPart) {
      const chip = this.#chips.get(id) ?? this.#chip(id);
      write(chip.text, textOf(description));
      chip.element.dataset.tone = reached ? "good" : "warn";
      chip.element.title = reached ? "reached" : "not reached";
    }
  }

  /** @param {number} id */
  #chip(id) {
    const text = make("span");
    const title = "Remove this task";
    const remove = button({ class: "small", title, "aria-label": title }, () => this.session.command({ type: "remove_task", task: id }), sign("close"));
    const chip = { element: make("span", { class: "chip", data: { described: String(id) } }, text, remove), text };
    this.#chips.set(id, chip);
    this.chosen.append(chip.element);
    return chip;
  }
}

/**
 * Return a point of the world in the frame of a part.
 * @param {import("three").Vector3} point
 * @param {{ position: import("three").Vector3, quaternion: import("three").Quaternion }} pose
 */
function within(point, { position, quaternion }) {
  return point.clone().sub(position).applyQuaternion(quaternion.clone().invert());
}
