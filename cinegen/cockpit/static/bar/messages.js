// What is said to the person: the hint of the first sight, notices for some seconds, who holds the hand, a cut line.
//
// For tests: #hint, #toasts .toast, #crowd with #take-hand, #cover.

import { byId, make } from "../base/dom.js";

const HINT = "Drag any part of the robot.";
const ON_MAP = "Drag any part of the robot, or click a cell: it goes there.";
const HOLDING = "Esc lets go";
const STAYS = 6000; // ms
const MOST = 4;

export class Messages {
  knows = false; // whether a part was dragged before

  constructor({ session, drag, gizmo }) {
    this.session = session;
    this.hint = byId("hint");
    this.toasts = byId("toasts");
    this.cover = byId("cover");
    session.on("hello", () => {
      this.cover.hidden = true;
      if (!this.knows) this.hint.textContent = session.hello.map ? ON_MAP : HINT;
      this.#hint();
    });
    session.on("notice", ({ words, level, action }) => this.toast(words, level, action));
    session.on("lost", () => this.#tell("Connection lost, trying again."));
    session.on("dropped", (words) =>
      this.#tell(`The server closed the connection: ${words}. Load the page again to go on.`),
    );
    session.on("hand", (hand) => {
      byId("crowd").hidden = hand !== "other";
      this.#hint();
    });
    session.on("denied", () => this.toast("Another browser holds the hand. Take it to drag and switch.", "warning"));
    byId("take-hand").addEventListener("click", () => session.send({ hand: true }));
    for (const hand of [drag, gizmo]) hand.on("drag", (part) => this.#dragged(part));
  }

  /** Shows words for some seconds, with a button if there is something to do; what is said again stays longer. */
  toast(words, level = "info", action = null) {
    if (!words) return;
    const same = [...this.toasts.children].find((toast) => toast.dataset.words === words);
    const toast =
      same ?? make("div", { class: `toast ${level === "warning" ? "warning" : ""}`, data: { words } }, words);
    if (action !== null && same === undefined) {
      const run = () => {
        action.run();
        toast.remove();
      };
      toast.append(
        make("button", { class: "small", type: "button", title: action.words, on: { click: run } }, action.words),
      );
    }
    clearTimeout(toast.timer);
    toast.timer = setTimeout(() => toast.remove(), action === null ? STAYS : 2 * STAYS);
    if (same === undefined) this.toasts.append(toast);
    while (this.toasts.childElementCount > MOST) this.toasts.firstElementChild.remove();
  }

  #hint() {
    this.hint.hidden = this.knows || this.session.hand === "other" || Boolean(this.session.hello?.replay);
  }

  #tell(words) {
    this.cover.textContent = words;
    this.cover.hidden = false;
  }

  #dragged(part) {
    if (part === null) {
      this.hint.hidden = true;
    } else if (!this.knows) {
      this.knows = true; // the first drag: the hint has done its work
      this.hint.textContent = HOLDING;
    }
  }
}
