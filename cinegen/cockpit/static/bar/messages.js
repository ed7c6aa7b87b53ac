// Messages to the user: an initial hint, notices for some seconds, who has control, a lost connection.
//
// For tests: #hint, #toasts .toast, #crowd with #take-control, #cover.

import { byId, make } from "../base/dom.js";

const HINT = "Drag any part of the robot.";
const ON_MAP = "Drag any part of the robot, or click a cell: it goes there.";
const DENIED = "Another browser has control. Take control to drag and switch.";
const VIEW_ONLY = "This page only shows the robots: ask for the address with which to drive them.";
const DRAGGING = "Esc ends the drag";
const STAYS = 6000; // ms
const MOST = 4;

/** @typedef {{ on: (name: "drag", listener: (part: object | null) => void) => unknown }} Dragging */

export class Messages {
  dragged = false; // whether a part was dragged before
  /** @type {WeakMap<Element, ReturnType<typeof setTimeout>>} */
  #timers = new WeakMap();

  /**
   * @param {{ session: import("../base/session.js").Session, drag: Dragging, gizmo: Dragging, handDrags: Dragging }} parts
   */
  constructor({ session, drag, gizmo, handDrags }) {
    this.session = session;
    this.hint = byId("hint");
    this.toasts = byId("toasts");
    this.cover = byId("cover");
    session.on("hello", () => {
      this.cover.hidden = true;
      const { map, playback, caption } = session.hello ?? {};
      if (!this.dragged) this.hint.textContent = playback ? (caption ?? "") : map ? ON_MAP : HINT;
      this.#hint();
    });
    session.on("notice", ({ text, level, action }) => this.toast(text, level, action));
    session.on("lost", () => this.#cover("Connection lost, trying again."));
    session.on("dropped", (reason) =>
      this.#cover(`The server closed the connection: ${reason}. Load the page again to go on.`),
    );
    session.on("control", (control) => {
      byId("crowd").hidden = control !== "other";
      byId("take-control").hidden = session.viewOnly;
      byId("who").textContent = session.viewOnly ? "This page only shows the robots." : "Another browser has control.";
      this.#hint();
    });
    session.on("denied", () => this.toast(session.viewOnly ? VIEW_ONLY : DENIED, "warning"));
    byId("take-control").addEventListener("click", () => session.send({ type: "request_control", on: true }));
    for (const one of [drag, gizmo, handDrags]) one.on("drag", (part) => this.#dragged(part));
  }

  /**
   * Show a text for some seconds, with a button for an action; a text that is repeated stays longer.
   *
   * @param {string} text
   * @param {string} level
   * @param {{ label: string, run: () => void } | null} action
   */
  toast(text, level = "info", action = null) {
    if (!text) return;
    const same = [...this.toasts.children].find((toast) => toast.getAttribute("data-text") === text);
    const toast = same ?? make("div", { class: `toast ${level === "warning" ? "warning" : ""}`, data: { text } }, text);
    if (action !== null && same === undefined) {
      const run = () => {
        action.run();
        toast.remove();
      };
      toast.append(
        make("button", { class: "small", type: "button", title: action.label, on: { click: run } }, action.label),
      );
    }
    clearTimeout(this.#timers.get(toast));
    this.#timers.set(toast, setTimeout(() => toast.remove(), action === null ? STAYS : 2 * STAYS));
    if (same === undefined) this.toasts.append(toast);
    while (this.toasts.childElementCount > MOST) this.toasts.firstElementChild?.remove();
  }

  #hint() {
    this.hint.hidden = this.dragged || this.session.control === "other" || this.hint.textContent === "";
  }

  /** @param {string} text */
  #cover(text) {
    this.cover.textContent = text;
    this.cover.hidden = false;
  }

  /** @param {object | null} part */
  #dragged(part) {
    if (part === null) {
      this.hint.hidden = true;
    } else if (!this.dragged) {
      this.dragged = true; // the first drag: the hint has done its work
      this.hint.textContent = DRAGGING;
    }
  }
}
