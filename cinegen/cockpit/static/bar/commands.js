// The bar's commands.
//
// For tests: #undo #redo #pause (aria-pressed) #home.

import { byId, press, show } from "../base/dom.js";

export class Commands {
  /** @param {{ session: Session, endDrag: (pinned?: boolean) => boolean }} parts */
  constructor({ session, endDrag }) {
    this.session = session;
    this.endDrag = endDrag;
    for (const id of /** @type {const} */ (["undo", "redo", "pause", "home", "help"])) byId(id).addEventListener("click", () => this[id]());
    session.on("report", (report) => this.#show(report));
  }

  undo() {
    this.session.command({ type: "undo" });
  }

  redo() {
    this.session.command({ type: "redo" });
  }

  pause() {
    this.session.command({ type: "pause", on: !this.session.report?.paused });
  }

  home() {
    if (!this.session.mayAct()) return;
    this.endDrag();
    this.session.send({ type: "move_home" });
  }

  help() {
    /** @type {HTMLDialogElement} */ (byId("keys")).showModal();
  }

  /** @param {SessionReport} report */
  #show({ undo = 0, redo = 0, paused = false }) {
    /** @type {HTMLButtonElement} */ (byId("undo")).disabled = !(undo > 0);
    /** @type {HTMLButtonElement} */ (byId("redo")).disabled = !(redo > 0);
    press(byId("pause"), paused);
    show(byId("pause"), paused ? "play" : "pause");
  }
}
