// Forces: what each robot carries, and the reactions in its joints. Its torques are shown with the joints.
//
// For tests: [data-payload="ROBOT"] with input[type=range], input[type=number] (kg) and select (the node);
// [data-missing="ROBOT"] where links have no masses; #reactions (a checkbox), [data-reactions="ROBOT"] (text).

import { atMostEvery, choice, make, write } from "../base/dom.js";
import { valueOf } from "../base/names.js";
import { speak } from "../base/speech.js";
import { amount, units } from "../base/units.js";
import { scaleOf } from "../aids/force_scale.js";
import { byRobot, folded, Section } from "./section.js";
import { fill } from "./slider.js";

const PICTURE = 1000 / 60;
const STEPS = 200; // of the slider
const HEAVIEST = 1e6; // kg
const MOVED = 400; // ms for which reports do not move a slider that is moved
const TYPE = "Type a mass and press Enter";
const HINT = "Holding torques and reactions: statics of the robot at rest with its payload, without friction";

/** @typedef {import("../base/messages").ReactionReport} ReactionReport */
/**
 * @typedef {{ range: HTMLInputElement, number: HTMLInputElement, node: HTMLSelectElement, moved: number,
 *   text: HTMLElement, list: HTMLElement, named: string, rows: Map<string, [HTMLElement, HTMLElement]> }} Controls
 */

export class Forces {
  /** @type {Map<string, Controls>} */
  #controls = new Map();

  /** @param {HTMLElement} panel @param {Session} session @param {Aids} aids */
  constructor(panel, session, aids) {
    this.session = session;
    this.aids = aids;
    this.section = new Section(panel, "forces", "Forces", HINT);
    this.send = atMostEvery(PICTURE, (/** @type {{ robot: string, node: string, mass: number }} */ payload) =>
      session.send({ type: "set_payload", ...payload }),
    );
    this.box = make("input", {
      type: "checkbox",
      id: "reactions",
      on: { change: () => aids.choose("reactions", this.box.checked) },
    });
    this.switch = make(
      "div",
      { class: "ticks" },
      make("label", { title: "Arrows of the forces that joints and loops exert on the parts behind them" }, this.box, "reactions"),
    );
    session.on("hello", () => this.#build());
    session.on("report", () => this.#show());
    aids.on("change", () => this.#show());
  }

  #build() {
    this.#controls.clear();
    byRobot(this.section.body, this.session.robots, (robot, body) => {
      if (robot.forces.missing) {
        const text = `No torques and no reactions: ${robot.forces.missing}.`;
        body.append(make("p", { class: "empty", data: { missing: robot.name } }, text));
      } else body.append(...this.#payload(robot));
    });
    if (this.#controls.size > 0) this.section.body.prepend(this.switch);
    this.#show();
  }

  /** @param {KnownRobot} robot */
  #payload(robot) {
    const { largest_payload: most, excluded } = robot.forces;
    const label = `Payload of ${robot.name}`;
    const carries = { "aria-label": `Part that carries the payload of ${robot.name}`, title: "Part whose origin carries it" };
    const title = `A point mass of 0 to ${most} kg; the field takes any. Drag it, or use the arrow keys`;
    /** @type {Controls} */
    const controls = {
      range: make("input", { type: "range", min: 0, max: most, step: most / STEPS, value: 0, "aria-label": label, title }),
      number: make("input", { type: "number", min: 0, max: HEAVIEST, step: "any", "aria-label": `${label}, in kilograms`, title: TYPE }),
      node: choice(carries, robot.nodes.filter(({ kind }) => kind !== "base").map(({ name }) => [name, name])),
      moved: -Infinity,
      text: make("p", { class: "empty", data: { reactions: robot.name } }),
      list: make("div", { class: "body" }),
      named: "",
      rows: new Map(),
    };
    controls.node.value = robot.end;
    const set = (/** @type {number} */ mass) => {
      if (!this.session.mayAct()) return;
      controls.moved = performance.now();
      this.#mass(controls, mass);
      this.send({ robot: robot.name, node: controls.node.value, mass });
    };
    controls.range.addEventListener("input", () => set(Number(Number(controls.range.value).toPrecision(4))));
    controls.number.addEventListener("change", () => {
      const mass = controls.number.valueAsNumber;
      if (Number.isFinite(mass)) set(Math.min(Math.max(mass, 0), HEAVIEST));
      controls.number.blur();
    });
    controls.node.addEventListener("change", () => set(controls.number.valueAsNumber || 0));
    const field = make("span", { class: "value" }, controls.number, make("span", { class: "unit" }, "kg"));
    this.#controls.set(robot.name, controls);
    this.#mass(controls, 0);
    const others = `The weight of ${excluded.join(", ")}, which it carries, is not counted.`;
    return [
      make("div", { class: "row", data: { payload: robot.name } }, make("span", { class: "name" }, "payload"), controls.range, field),
      make("label", { class: "row" }, make("span", { class: "name" }, "on"), controls.node),
      excluded.length > 0 ? make("p", { class: "empty" }, others) : "",
      controls.text,
      folded("all reactions", "Forces and moments of all joints and loops, as far as statics determines them", controls.list),
    ];
  }

  /** @param {Controls} controls @param {number} mass */
  #mass(controls, mass) {
    const text = String(Number(mass.toPrecision(4)));
    if (document.activeElement !== controls.number && controls.number.value !== text) controls.number.value = text;
    if (Number(controls.range.value) !== mass) controls.range.value = String(mass);
    speak(controls.range, `${text} kg`);
    fill(controls.range);
  }

  #show() {
    const on = this.aids.shows("reactions");
    this.box.checked = on;
    for (const robot of this.session.robots) {
      const controls = this.#controls.get(robot.name);
      const report = valueOf(this.session.report?.robots, robot.name);
      if (controls === undefined) continue;
      const carried = report?.carried;
      if (carried && performance.now() - controls.moved > MOVED) {
        this.#mass(controls, carried.mass);
        if (document.activeElement !== controls.node && controls.node.value !== carried.node) controls.node.value = carried.node;
      }
      const reactions = on ? report?.reactions : null;
      write(controls.text, reactions ? summary(reactions, robot.length) : "");
      controls.text.hidden = !reactions;
      const fold = controls.list.parentElement;
      if (fold !== null) fold.hidden = !reactions || reactions.length === 0;
      if (reactions) this.#list(controls, reactions);
    }
  }

  /** @param {Controls} controls @param {readonly ReactionReport[]} reactions */
  #list(controls, reactions) {
    const named = reactions.map(({ kind, name }) => `${kind} ${name}`).join("\n");
    if (controls.named !== named) {
      controls.named = named;
      controls.rows.clear();
      controls.list.replaceChildren();
      for (const { kind, name, node } of reactions) {
        /** @type {[HTMLElement, HTMLElement]} */
        const cells = [make("span", { class: "number" }), make("span", { class: "number" })];
        const title = `${kind} ${name}, on ${node}`;
        controls.rows.set(`${kind} ${name}`, cells);
        controls.list.append(make("div", { class: "row passive reaction", title }, make("span", { class: "name" }, name), ...cells));
      }
    }
    for (const { kind, name, force, moment, undetermined } of reactions) {
      const cells = controls.rows.get(`${kind} ${name}`);
      if (cells === undefined) continue;
      const open = (/** @type {string} */ letter) => undetermined.some((part) => part.startsWith(letter));
      write(cells[0], force === null ? "? N" : `${amount(Math.hypot(...force), "N")}${open("F") ? " + ?" : ""}`);
      write(cells[1], moment === null ? "? N m" : `${amount(moment, "N m")}${open("M") ? " + ?" : ""}`);
    }
  }
}

/**
 * Return the text about reactions: the scale of the arrows, and what statics does not determine.
 * @param {readonly ReactionReport[]} reactions
 * @param {number} length characteristic length of the robot (m)
 */
export function summary(reactions, length) {
  if (reactions.length === 0) return "No actuator holds the load here: there are no reactions.";
  const { newtons, metres } = scaleOf(reactions, length);
  const scale = newtons > 0 ? `An arrow ${units.length(metres)} long is ${amount(newtons, "N")}.` : "All forces that statics determines are 0.";
  const open = reactions.filter(({ undetermined }) => undetermined.length > 0);
  if (open.length === 0) return scale;
  const all = open.length === reactions.length ? `all ${open.length}` : `${open.length} of ${reactions.length}`;
  const parts = [...new Set(open.flatMap(({ undetermined }) => undetermined))].sort();
  return (
    `${scale} Statics does not determine all components of ${all} reactions (${parts.join(", ")} in the joints' axes): ` +
    "those are not drawn."
  );
}
