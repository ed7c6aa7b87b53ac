// The bar's commands.
//
// For tests: #undo #redo #pause (aria-pressed) #home #frame (select) #fit #units #fold #snapshot #picture #help.

import { byId, make, memory, write } from "../base/dom.js";
import { units } from "../base/units.js";

const FRAMES = {
  world: "world",
  base: "base of the robot",
  tool: "tool",
  view: "my view",
};

export class Commands {
  constructor({ view, session, endDrag }) {
    Object.assign(this, { view, session, endDrag });
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
    const token = new URLSearchParams(location.search).get("token");
    if (token !== null) byId("page-copy").href = `snapshot.html?${new URLSearchParams({ token })}`;
    session.on("report", (report) => this.#show(report));
  }

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
    byId("keys").showModal();
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

  #send(command) {
    if (this.session.mayAct()) this.session.send(command);
  }

  #fold(open) {
    memory.set("panel", open);
    document.body.classList.toggle("folded", !open);
    byId("fold").setAttribute("aria-expanded", String(open));
  }

  #frames() {
    const select = byId("frame");
    this.session.on("hello", ({ frames = [] }) => {
      select.replaceChildren(...frames.map((frame) => make("option", { value: frame }, FRAMES[frame] ?? frame)));
    });
    select.addEventListener("change", () => {
      this.chosen = performance.now();
      this.#send({ type: "change_settings", frame: select.value });
    });
  }

  #show({ undo = 0, redo = 0, paused = false, settings }) {
    byId("undo").disabled = !(undo > 0);
    byId("redo").disabled = !(redo > 0);
    const pause = byId("pause");
    if (pause.getAttribute("aria-pressed") !== String(paused)) {
      pause.setAttribute("aria-pressed", String(paused));
      pause.querySelector("use").setAttribute("href", paused ? "#sign-play" : "#sign-pause");
    }
    const select = byId("frame");
    const recent = performance.now() - (this.chosen ?? -Infinity) < 800;
    if (settings?.frame && select.value !== settings.frame && !recent) select.value = settings.frame;
  }
}
