// The bar's commands.
//
// For tests: #undo #redo #pause (aria-pressed) #home #frame (select) #fit #units #fold #snapshot #picture #help.

import { pageUrl } from "../base/address.js";
import { byId, make, memory, write } from "../base/dom.js";
import { units } from "../base/units.js";

/** @type {Record<string, string>} */
const FRAMES = {
  world: "world",
  base: "base of the robot",
  tool: "tool",
  view: "my view",
};

export class Commands {
  #chosen = -Infinity; // when a command frame was chosen

  /**
   * @param {{ view: import("../view/view.js").View, session: import("../base/session.js").Session,
   *   endDrag: (pinned?: boolean) => boolean }} parts
   */
  constructor({ view, session, endDrag }) {
    this.view = view;
    this.session = session;
    this.endDrag = endDrag;
    this.button("undo", () => this.undo());
    this.button("redo", () => this.redo());
    this.button("pause", () => this.pause());
    this.button("home", () => this.home());
    this.button("fit", () => view.frame());
    this.button("units", () => units.toggle());
    this.button("picture", () => this.picture());
    this.button("help", () => this.help());
    this.button("fold", () => this.fold());
    this.#frames();
    this.#fold(memory.get("panel", !window.matchMedia("(max-width: 760px)").matches));
    const named = () => write(byId("units"), units.name);
    units.on("change", named);
    named();
    if (location.search !== "") /** @type {HTMLAnchorElement} */ (byId("page-copy")).href = pageUrl("snapshot.html");
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

  fold() {
    this.#fold(document.body.classList.contains("folded"));
  }

  picture() {
    const link = make("a", { href: this.view.picture(), download: `${this.session.hello?.title ?? "cinegen"}.png` });
    document.body.append(link);
    link.click();
    link.remove();
  }

  /** @param {import("../base/link.js").ClientMessage} command */
  #send(command) {
    if (this.session.mayAct()) this.session.send(command);
  }

  /** @param {boolean} open */
  #fold(open) {
    memory.set("panel", open);
    document.body.classList.toggle("folded", !open);
    byId("fold").setAttribute("aria-expanded", String(open));
  }

  #frames() {
    const select = /** @type {HTMLSelectElement} */ (byId("frame"));
    this.session.on("hello", ({ frames = [] }) => {
      select.replaceChildren(...frames.map((frame) => make("option", { value: frame }, FRAMES[frame] ?? frame)));
    });
    select.addEventListener("change", () => {
      this.#chosen = performance.now();
      this.#send({ type: "change_settings", frame: /** @type {import("../base/messages").Settings["frame"]} */ (select.value) });
    });
  }

  /** @param {import("../base/link.js").Report} report */
  #show({ undo = 0, redo = 0, paused = false, settings }) {
    /** @type {HTMLButtonElement} */ (byId("undo")).disabled = !(undo > 0);
    /** @type {HTMLButtonElement} */ (byId("redo")).disabled = !(redo > 0);
    const pause = byId("pause");
    if (pause.getAttribute("aria-pressed") !== String(paused)) {
      pause.setAttribute("aria-pressed", String(paused));
      pause.querySelector("use")?.setAttribute("href", paused ? "#sign-play" : "#sign-pause");
    }
    const select = /** @type {HTMLSelectElement} */ (byId("frame"));
    const recent = performance.now() - this.#chosen < 800;
    if (settings?.frame && select.value !== settings.frame && !recent) select.value = settings.frame;
  }
}
