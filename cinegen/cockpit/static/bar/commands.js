// The bar's commands.
//
// For tests: #undo #redo #pause (aria-pressed) #home.

import { byId } from "../base/dom.js";

export class Commands {
  /** @param {{ session: import("../base/session.js").Session, endDrag: (pinned?: boolean) => boolean }} parts */
  constructor({ session, endDrag }) {
    this.session = session;
    this.endDrag = endDrag;
    this.button("undo", () => this.undo());
    this.button("redo", () => this.redo());
    this.button("pause", () => this.pause());
    this.button("home", () => this.home());
    this.button("help", () => this.help());
    session.on("report", (report) => this.#show(report));
  }

  /**
   * @param {string} id
   * @param {() => void} action
   */
  button(id, action) {
    byId(id).addEventListener("click", action);
  }

  undo() {
    this.#send({ type: "undo" });
  }

  redo() {
    this.#send({ type: "redo" });
  }

  pause() {
    this.#send({ type: "pause", on: !this.session.report?.paused });
  }

  home() {
    if (!this.session.mayAct()) return;
    this.endDrag();
    this.session.send({ type: "move_home" });
  }

  help() {
    /** @type {HTMLDialogElement} */ (byId("keys")).showModal();
  }

  /** @param {import("../base/link.js").ClientMessage} command */
  #send(command) {
    if (this.session.mayAct()) this.session.send(command);
  }

  /** @param {import("../base/link.js").Report} report */
  #show({ undo = 0, redo = 0, paused = false }) {
    /** @type {HTMLButtonElement} */ (byId("undo")).disabled = !(undo > 0);
    /** @type {HTMLButtonElement} */ (byId("redo")).disabled = !(redo > 0);
    const pause = byId("pause");
    if (pause.getAttribute("aria-pressed") !== String(paused)) {
      pause.setAttribute("aria-pressed", String(paused));
      pause.querySelector("use")?.setAttribute("href", paused ? "#sign-play" : "#sign-pause");
    }
  }
}
