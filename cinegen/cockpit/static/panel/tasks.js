// Tasks: source, constrained DoF, weight and error of each, and a button to remove it.
//
// For tests: [data-task="ID"] with button (release), select[data-dof="translation"] and [data-dof="rotation"],
// input[type=range] (weight); of other kinds [data-described="ID"] with button (release).

import { textOf } from "../bar/part_tasks.js";
import { atMostEvery, button, choice, keepOnly, make, write } from "../base/dom.js";
import { significant, units } from "../base/units.js";
import { Section } from "./section.js";
import { logSlider } from "./slider.js";

const TRANSLATIONS = ["free", "x", "x, y", "x, y, z"];
const ROTATIONS = ["free", "about z", "direction of z", "all"];
const OFTEN = 100; // ms

/** @typedef {import("../base/messages").TaskMessage} Task */
/**
 * @typedef {{ source: HTMLElement, error: HTMLElement, element: HTMLElement, translation: HTMLSelectElement,
 *   rotation: HTMLSelectElement, weight: ReturnType<typeof logSlider>, changed: number }} Card
 */

export class Tasks {
  /** @type {Map<number, { element: HTMLElement, text: HTMLElement, error: HTMLElement }>} */
  #described = new Map();
  /** @type {Map<number, Card>} */
  #cards = new Map();

  /** @param {HTMLElement} panel @param {Session} session */
  constructor(panel, session) {
    this.session = session;
    this.section = new Section(panel, "tasks", "Tasks", "What moves the robots: the pointer, pins and sensors, and what parts keep. If not all tasks can be met, priorities and weights decide");
    this.empty = make("p", { class: "empty" }, "No tasks. Drag a part, or select one and pin it.");
    this.section.body.append(this.empty);
    this.show = atMostEvery(OFTEN, () => this.#show());
    session.on("state", () => this.show());
    session.on("hello", () => this.show());
  }

  #show() {
    const { tasks } = this.session;
    const described = this.session.state?.described ?? [];
    const count = tasks.length + described.length;
    this.empty.hidden = count > 0;
    write(this.section.note, count > 0 ? String(count) : "");
    keepOnly(this.#described, described.map(({ id }) => id));
    for (const task of described) this.#showDescribed(task);
    keepOnly(this.#cards, tasks.map(({ id }) => id));
    for (const task of tasks) {
      let card = this.#cards.get(task.id);
      if (card === undefined) {
        card = this.#make(task);
        this.#cards.set(task.id, card);
        this.section.body.append(card.element);
      }
      this.#fill(card, task);
    }
  }

  /** @param {import("../base/messages").DescribedMessage} task */
  #showDescribed({ id, robot, description, error: [far, turned], reached }) {
    let card = this.#described.get(id);
    if (card === undefined) {
      const [text, error] = [make("span", { class: "name" }), make("span", { class: "number" })];
      const element = make(
        "div",
        { class: "card", data: { described: String(id) } },
        make("div", { class: "head" }, text, this.#remover(id, "Remove this task")),
        make("div", { class: "pair" }, make("span", {}, "error"), error),
      );
      card = { element, text, error };
      this.#described.set(id, card);
      this.section.body.append(element);
    }
    write(card.text, this.session.called(robot, textOf(description)));
    const left = [far > 0 ? units.length(far) : "", turned > 0 ? units.angle(turned) : ""].filter(Boolean).join(" · ");
    write(card.error, reached ? "reached" : left);
  }

  /** @param {number} id @param {string} title */
  #remover(id, title) {
    return button({ class: "small end", title, "aria-label": title }, () => this.session.command({ type: "remove_task", task: id }), "Remove");
  }

  /** @param {Task} task @returns {Card} */
  #make(task) {
    const { id } = task;
    const whose = this.session.called(task.robot, task.node);
    const source = make("span", { class: "quiet" });
    const error = make("span", { class: "number" });
    const release = this.#remover(id, `Remove the task of ${whose}`);
    /** @param {string} kind @param {string[]} labels @param {string} hint */
    const choose = (kind, labels, hint) => {
      const about = { title: hint, "aria-label": `Constrained ${kind} of ${whose}`, data: { dof: kind } };
      return choice({ ...about, on: { change: () => this.#change(card, id) } }, labels.entries());
    };
    const translation = choose("translation", TRANSLATIONS, "Axes of the target along which the position is constrained");
    const rotation = choose("rotation", ROTATIONS, "Constrained part of the orientation");
    const weight = logSlider({
      label: `Weight of ${whose}`,
      hint: "If not all tasks can be met, those of larger weight are met better",
      low: 0.01,
      high: 100,
      format: (value) => `× ${significant(value)}`,
      changed: (value) => this.session.command({ type: "change_task", task: id, weight: value }),
    });
    const element = make(
      "div",
      { class: "card", data: { task: String(id) } },
      make("div", { class: "head" }, make("span", { class: "name" }, whose), source, release),
      make("label", { class: "pair" }, "position", translation),
      make("label", { class: "pair" }, "rotation", rotation),
      make("label", { class: "pair three" }, "weight", weight.input, weight.output),
      make("div", { class: "pair" }, make("span", {}, "error"), error),
    );
    /** @type {Card} */
    const card = { source, error, element, translation, rotation, weight, changed: -Infinity };
    return card;
  }

  /** @param {Card} card @param {number} id */
  #change(card, id) {
    card.changed = performance.now();
    const [translation, rotation] = [card.translation, card.rotation].map((select) => Number(select.value));
    this.session.command({ type: "change_task", task: id, translation, rotation });
  }

  /** @param {Card} card @param {Task} task */
  #fill(card, task) {
    write(card.source, task.source === "pin" ? "pinned" : task.label);
    const { translation, rotation } = task;
    const choosing = document.activeElement === card.translation || document.activeElement === card.rotation;
    if (!choosing || !(performance.now() - card.changed < 1000)) {
      if (card.translation.value !== String(translation)) card.translation.value = String(translation);
      if (card.rotation.value !== String(rotation)) card.rotation.value = String(rotation);
    }
    card.weight.show(task.weight ?? 1);
    const [far = 0, turned = 0] = task.error ?? [];
    write(card.error, `${units.length(far)}${rotation > 0 ? ` · ${units.angle(turned)}` : ""}`);
  }
}
