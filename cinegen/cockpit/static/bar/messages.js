// Messages to the user: notices for some seconds, who has control, a lost connection.
//
// For tests: #toasts .toast, #crowd with #take-control, #cover.

import { byId, make } from "../base/dom.js";

const LOST = "The connection is lost: the page tries again.";
const SILENT = {
  gone: "Nothing answers at this address: start cinegen drive again, and open the address that it prints.",
  refused: "This address has another session's token: open the address that cinegen drive printed last.",
};
const DENIED = "Another browser has control. Take control to drag and switch.";
const VIEW_ONLY = "This page only shows the robots: ask for the address with which to drive them.";
const STAYS = 6000; // ms
const MOST = 4;

export class Messages {
  #driven = ""; // names of the robots
  /** @type {WeakMap<Element, ReturnType<typeof setTimeout>>} */
  #timers = new WeakMap();

  /** @param {Session} session */
  constructor(session) {
    this.toasts = byId("toasts");
    this.cover = byId("cover");
    session.on("hello", () => {
      this.cover.hidden = true;
      for (const { lost } of session.robots) if (lost) this.toast(lost, "warning");
      const now = session.robots.map(({ name }) => name).join(", ");
      if (this.#driven !== "" && this.#driven !== now) this.toast(`This is another session now: it drives ${now}.`);
      this.#driven = now;
    });
    session.on("notice", ({ text, level, action }) => this.toast(text, level, action));
    session.on("lost", () => this.cover.hidden && this.#cover(LOST));
    session.on("silent", (why) => this.#cover(SILENT[why]));
    session.on("dropped", (reason) =>
      this.#cover(`The server closed the connection: ${reason}. Load the page again to go on.`),
    );
    session.on("control", (control) => {
      byId("crowd").hidden = control !== "other";
      byId("take-control").hidden = session.viewOnly;
      byId("who").textContent = session.viewOnly ? "This page only shows the robots." : "Another browser has control.";
    });
    session.on("denied", () => this.toast(session.viewOnly ? VIEW_ONLY : DENIED, "warning"));
    byId("take-control").addEventListener("click", () => session.send({ type: "request_control", on: true }));
  }

  /**
   * Show a text for some seconds, with a button for an action; a text that is repeated stays longer.
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

  /** @param {string} text */
  #cover(text) {
    this.cover.textContent = text;
    this.cover.hidden = false;
  }
}
