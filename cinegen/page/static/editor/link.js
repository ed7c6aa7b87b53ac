// The line of a page with an editor: its session is made anew from every text without errors. The text is in the fragment
// of the page's address.

import { byId, make } from "../../../cockpit/static/base/dom.js";
import { decode, encode, FragmentError } from "../raff/fragment.js";
import { Link as LocalLink } from "../session/link.js";
import { helloOf } from "./description.js";
import { Editor } from "./editor.js";
import { Reader } from "./reading.js";
import { Skeletons } from "./skeleton.js";
import { ModelSolver } from "./solver.js";

const KEY = "#raff=";
const RATE = 60; // ticks per second
const QUIET = 200; // ms after a change of the text
const NO_DRAG = "an edited robot moves by the sliders of its joints: cinegen page FILE makes a page in which parts can be dragged";

/** @typedef {{ text: string, name: string, title: string, worker: string }} EditedText */

export class Link extends LocalLink {
  /** @param {import("../../../cockpit/static/view/view.js").View} view */
  constructor(view) {
    super(view);
    this.scene = new Skeletons(view);
  }

  /** @type {EditedText} */
  #content = JSON.parse(byId("cinegen-page").textContent ?? "");
  #timer = 0;
  #written = "";

  async connect() {
    const { text, worker } = this.#content;
    const main = byId("pane").parentElement;
    const section = make("section", { id: "editor", "aria-label": "Editor" });
    main?.prepend(section);
    const reader = new Reader(worker, (reading) => {
      editor.show(reading.notes);
      document.documentElement.dataset.read = reading.robots.length > 0 ? "yes" : "no";
      if (reading.robots.length === 0) return;
      this.scene.draw(reading.robots);
      this.begin(
        {
          hello: helloOf(this.#content.title, reading.robots), rate: RATE, scene: [],
          robots: reading.robots.map(({ model, analysis }) => ({
            name: model.robot, module: "", start: analysis.home, base: { robot: null, node: null, placement: [0, 0, 0, 0, 0, 0, 1] },
          })),
        },
        reading.robots.map(({ model, analysis }) => new ModelSolver(model, analysis)),
      );
    });
    const read = (/** @type {string} */ changed) => {
      document.documentElement.dataset.read = "";
      reader.take(changed, this.#content.name);
    };
    const editor = new Editor(section, text, (changed) => {
      clearTimeout(this.#timer);
      document.documentElement.dataset.read = "";
      this.#timer = window.setTimeout(() => {
        read(changed);
        this.#write(changed);
      }, QUIET);
    });
    const restore = async () => {
      if (!location.hash.startsWith(KEY) || location.hash === this.#written) return false;
      try {
        editor.text = await decode(location.hash.slice(KEY.length));
        return true;
      } catch (error) {
        if (!(error instanceof FragmentError)) throw error;
        this.emit("notice", { text: error.message, level: "warning" });
        return false;
      }
    };
    window.addEventListener("hashchange", restore);
    if (!(await restore())) read(editor.text);
  }

  /** @param {import("../../../cockpit/static/base/link.js").ClientMessage} message */
  send(message) {
    if (message.type === "start_drag" || message.type === "pin") this.emit("notice", { text: NO_DRAG, level: "warning" });
    else super.send(message);
  }

  /** The configuration is in no link: the address holds the text. */
  writeAddress() {}

  /** @param {string} text */
  async #write(text) {
    try {
      this.#written = KEY + (await encode(text));
      history.replaceState(null, "", this.#written);
    } catch (error) {
      if (!(error instanceof FragmentError)) throw error;
      this.emit("notice", { text: error.message, level: "warning" });
    }
  }
}
