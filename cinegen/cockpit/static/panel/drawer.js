// The drawer: everything that isn't in the bar, on tabs. It is closed at first; the tab that was open last opens again.
//
// For tests: #fold opens and closes it; #tab-pose, #tab-tasks, #tab-analyse, #tab-record and #tab-view (role tab); #help.

import { byId, make, memory, sign } from "../base/dom.js";

const TABS = { pose: "Pose", tasks: "Tasks", analyse: "Analyse", record: "Record", view: "View" };
const STEPS = /** @type {Record<string, number>} */ ({ ArrowRight: 1, ArrowLeft: -1 });

/** @typedef {keyof typeof TABS} Tab */

export class Drawer {
  pages = /** @type {Record<Tab, HTMLElement>} */ ({});
  /** @type {Map<string, HTMLElement>} */
  #tabs = new Map();

  constructor() {
    this.panel = byId("panel");
    this.button = byId("fold");
    for (const [id, name] of Object.entries(TABS)) {
      const on = { click: () => this.open(id) };
      this.#tabs.set(id, make("button", { type: "button", role: "tab", id: `tab-${id}`, "aria-controls": `page-${id}`, title: `${name} (arrow keys: the next)`, on }, name));
      this.pages[/** @type {Tab} */ (id)] = make("div", { role: "tabpanel", class: "page", id: `page-${id}`, "aria-labelledby": `tab-${id}` });
    }
    const list = make("div", { role: "tablist", "aria-label": "Tools" }, ...this.#tabs.values());
    list.addEventListener("keydown", (event) => this.#step(event));
    const help = make("button", { type: "button", id: "help", title: "Mouse, fingers and keys (?)", "aria-label": "Help" }, sign("help"));
    this.panel.append(make("div", { class: "tabs" }, list, help), ...Object.values(this.pages));
    this.button.addEventListener("click", () => this.toggle());
    this.#select(memory.get("tab", "pose"));
  }

  /** Open the drawer, or close it. */
  toggle(open = document.body.classList.contains("folded")) {
    document.body.classList.toggle("folded", !open);
    this.button.setAttribute("aria-expanded", String(open));
    if (open) this.#refresh();
    else if (this.panel.contains(document.activeElement)) this.button.focus();
  }

  /** @param {string} id of a tab */
  open(id) {
    this.#select(id);
    memory.set("tab", id);
    this.toggle(true);
  }

  /** @param {string} wanted */
  #select(wanted) {
    const chosen = this.#tabs.has(wanted) ? wanted : "pose";
    for (const [id, tab] of this.#tabs) {
      tab.setAttribute("aria-selected", String(id === chosen));
      tab.tabIndex = id === chosen ? 0 : -1;
      this.pages[/** @type {Tab} */ (id)].hidden = id !== chosen;
    }
  }

  /** What is not seen isn't kept up to date: sections listen for this. */
  #refresh() {
    for (const section of this.panel.querySelectorAll(".page:not([hidden]) > .section")) section.dispatchEvent(new Event("toggle"));
  }

  /** @param {KeyboardEvent} event */
  #step(event) {
    const all = [...this.#tabs.keys()];
    const at = all.findIndex((id) => this.#tabs.get(id) === event.target) + (STEPS[event.key] ?? 0);
    if (STEPS[event.key] === undefined) return;
    const next = all[(at + all.length) % all.length];
    this.open(next);
    this.#tabs.get(next)?.focus();
    event.preventDefault();
  }
}
