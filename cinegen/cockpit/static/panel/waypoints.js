// Waypoints: configurations of all robots under names. A click moves the robots there; in their order they are played as
// one motion, which may be recorded.
//
// For tests: #section-waypoints; #waypoint-name with #save-waypoint, #play-waypoints (aria-pressed), #record-waypoints;
// #waypoints with [data-waypoint=ID] (aria-current where the robots move there) and buttons [data-action="go", "rename",
// "up", "down" or "remove"].

import { button, isOn, make, press, show, sign, write } from "../base/dom.js";
import { cleanName, LONGEST } from "../base/names.js";
import { Section } from "./section.js";

/** @typedef {{ id: number, name: string }} Waypoint */

export class Waypoints {
  /** @type {Waypoint[]} */
  #all = [];
  #built = "";
  #renaming = false;

  /** @param {HTMLElement} panel @param {Session} session */
  constructor(panel, session) {
    this.session = session;
    this.section = new Section(panel, "waypoints", "Waypoints", "Save configurations of all robots, move to them, and play them as one motion");
    const hints = { "aria-label": "Name of the new waypoint", title: "Name of the configuration that is saved" };
    this.name = make("input", { id: "waypoint-name", type: "text", class: "small", maxlength: LONGEST, ...hints });
    const save = make("button", { type: "submit", id: "save-waypoint", class: "small", title: "Save the present configurations of all robots" }, "Save");
    const form = make("form", { class: "buttons", on: { submit: (/** @type {Event} */ event) => this.#save(event) } }, this.name, save);
    this.list = make("ol", { id: "waypoints", class: "waypoints" });
    this.word = make("span", {}, "Play");
    const playing = { id: "play-waypoints", class: "small", title: "Move through all waypoints in their order", "aria-pressed": "false" };
    this.play = button(playing, () => session.command({ type: "play_waypoints", on: !isOn(this.play) }), sign("play"), this.word);
    const recording = { id: "record-waypoints", class: "small", title: "Play them, and record the motion from the first to the last" };
    const record = () => session.command({ type: "play_waypoints", on: true, record: true });
    this.record = button(recording, record, sign("record"), make("span", {}, "Play and record"));
    this.section.body.append(form, this.list, make("div", { class: "buttons" }, this.play, this.record));
    session.on("hello", ({ playback }) => {
      this.section.element.hidden = Boolean(playback); // a recording can't be driven
    });
    session.on("report", ({ waypoints = [], waypoint = null }) => this.#show(waypoints, waypoint));
  }

  /** @param {Event} event */
  #save(event) {
    event.preventDefault();
    this.session.command({ type: "save_waypoint", name: cleanName(this.name.value) || freeName(this.#all) });
    this.name.value = "";
  }

  /** @param {Waypoint[]} waypoints @param {number | null} target id of the waypoint that the robots move to */
  #show(waypoints, target) {
    this.#all = waypoints;
    write(this.section.note, waypoints.length > 0 ? String(waypoints.length) : "");
    this.name.placeholder = freeName(waypoints);
    this.play.disabled = this.record.disabled = waypoints.length < 2;
    press(this.play, target !== null);
    write(this.word, target === null ? "Play" : "Stop");
    show(this.play, target === null ? "play" : "close");
    if (!this.#renaming) this.#build();
    for (const row of this.list.children) {
      if (row.getAttribute("data-waypoint") === String(target)) row.setAttribute("aria-current", "true");
      else row.removeAttribute("aria-current");
    }
  }

  /** Build the rows anew where they differ; a button that has the focus keeps it. */
  #build() {
    const content = JSON.stringify(this.#all);
    if (content === this.#built) return;
    this.#built = content;
    const focused = document.activeElement instanceof HTMLElement && this.list.contains(document.activeElement) ? document.activeElement : null;
    const [id, action] = [focused?.closest("li")?.dataset.waypoint, focused?.dataset.action];
    this.list.replaceChildren(...this.#all.map((waypoint, i) => this.#row(waypoint, i)));
    if (focused !== null) this.#find(id, action)?.focus();
  }

  /** @param {string | undefined} id @param {string | undefined} action @returns {HTMLElement | null} */
  #find(id, action) {
    return this.list.querySelector(`[data-waypoint="${id}"] [data-action="${action}"]`);
  }

  /** @param {Waypoint} waypoint @param {number} index */
  #row({ id, name }, index) {
    const last = this.#all.length - 1;
    /**
     * @param {string} action
     * @param {string} icon
     * @param {string} title
     * @param {boolean} disabled
     * @param {() => void} click
     */
    const press = (action, icon, title, disabled, click) =>
      make("button", { type: "button", class: "icon", data: { action }, title, "aria-label": title, disabled, on: { click } }, sign(icon));
    const go = make(
      "button",
      { type: "button", class: "go", data: { action: "go" }, title: `Move all robots to ${name}`, on: { click: () => this.session.command({ type: "move_to_waypoint", waypoint: id }) } },
      name,
    );
    const row = make(
      "li",
      { data: { waypoint: String(id) } },
      go,
      press("rename", "edit", `Rename ${name}`, false, () => this.#rename(row, id, name)),
      press("up", "up", `Move ${name} up`, index === 0, () => this.session.command({ type: "change_waypoint", waypoint: id, index: index - 1 })),
      press("down", "down", `Move ${name} down`, index === last, () => this.session.command({ type: "change_waypoint", waypoint: id, index: index + 1 })),
      press("remove", "close", `Remove ${name}`, false, () => this.session.command({ type: "remove_waypoint", waypoint: id })),
    );
    return row;
  }

  /** @param {HTMLElement} row @param {number} id @param {string} name */
  #rename(row, id, name) {
    if (!this.session.mayAct()) return;
    this.#renaming = true;
    const field = make("input", { type: "text", class: "small", maxlength: LONGEST, "aria-label": `New name of ${name}` });
    field.value = name;
    let done = false;
    const end = (/** @type {boolean} */ taken) => {
      if (done) return;
      done = true;
      this.#renaming = false;
      const text = cleanName(field.value);
      if (taken && text !== "" && text !== name) this.session.send({ type: "change_waypoint", waypoint: id, name: text });
      this.#built = "";
      this.#build();
      this.#find(String(id), "rename")?.focus();
    };
    field.addEventListener("keydown", (event) => {
      if (event.key === "Enter") end(true);
      else if (event.key === "Escape") end(false);
      else return;
      event.preventDefault(); // otherwise Enter would press the button that has the focus now
      event.stopPropagation();
    });
    field.addEventListener("blur", () => end(true));
    row.replaceChildren(field);
    field.select();
  }
}

/** Return a name that no waypoint has. @param {Waypoint[]} waypoints */
export function freeName(waypoints) {
  const taken = new Set(waypoints.map(({ name }) => name));
  let number = waypoints.length + 1;
  while (taken.has(`Waypoint ${number}`)) number += 1;
  return `Waypoint ${number}`;
}
