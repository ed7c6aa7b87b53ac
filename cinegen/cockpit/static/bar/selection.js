// What is selected, and what can be done with it.
//
// For tests: #selection with #move #turn (aria-pressed), #axes (select), #upright (checkbox), #pin, #deselect.

import { byId, make, sign, write } from "../base/dom.js";
import { AXES } from "../pointer/gizmo.js";

/** @type {Record<string, string>} */
const LABELS = { world: "world axes", local: "its own axes", view: "view axes" };

export class Selection {
  /**
   * @param {{ session: import("../base/session.js").Session, gizmo: import("../pointer/gizmo.js").Gizmo, pin: () => void }} parts
   */
  constructor({ session, gizmo, pin }) {
    this.session = session;
    this.gizmo = gizmo;
    /**
     * @param {string} id
     * @param {() => void} action
     * @param {string} title
     * @param {...(Node | string)} children
     */
    const press = (id, action, title, ...children) =>
      make("button", { type: "button", id, title, on: { click: action } }, ...children);
    const word = (/** @type {string} */ text) => make("span", { class: "word" }, text);
    this.name = make("span", { class: "name" });
    this.move = press("move", () => gizmo.setMode("translate"), "Move it (W)", sign("move"), word("Move"));
    this.turn = press("turn", () => gizmo.setMode("rotate"), "Rotate it (E)", sign("turn"), word("Rotate"));
    this.axes = make(
      "select",
      {
        id: "axes",
        class: "small",
        title: "Along whose axes the arrows are (Q)",
        "aria-label": "Axes of the gizmo",
        on: { change: () => gizmo.setAxes(this.axes.value) },
      },
      ...AXES.map((axes) => make("option", { value: axes }, LABELS[axes])),
    );
    this.upright = make("input", {
      type: "checkbox",
      id: "upright",
      on: { change: () => gizmo.setUpright(this.upright.checked) },
    });
    this.keep = make(
      "label",
      { class: "field", title: "Constrain its orientation while it is moved" },
      this.upright,
      "keep orientation",
    );
    this.bar = byId("selection");
    this.bar.append(
      this.name,
      make("span", { class: "segments" }, this.move, this.turn),
      this.axes,
      this.keep,
      press("pin", pin, "Keep it where it is while other parts are dragged (P)", sign("pin"), word("Pin")),
      press("deselect", () => session.select(null, null), "Select nothing (Esc)", sign("close")),
    );
    byId("deselect").setAttribute("aria-label", "Select nothing");
    session.on("select", () => this.#show());
    gizmo.on("change", () => this.#show());
  }

  #show() {
    const { selected } = this.session;
    this.bar.hidden = selected === null;
    if (selected === null) return;
    write(this.name, this.session.called(selected.robot, selected.node));
    const turning = this.gizmo.mode === "rotate";
    this.move.setAttribute("aria-pressed", String(!turning));
    this.turn.setAttribute("aria-pressed", String(turning));
    this.axes.value = this.gizmo.axes;
    this.upright.checked = this.gizmo.upright;
    this.keep.hidden = turning;
  }
}
