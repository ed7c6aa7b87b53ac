// Parts that are hidden in this browser: they are neither drawn nor picked.

import { keyOf, partOf } from "../base/session.js";

export class Hidden {
  /** @type {Set<string>} */
  #keys = new Set();

  /** @param {{ view: View, session: Session }} parts */
  constructor({ view, session }) {
    this.view = view;
    this.session = session;
    view.before((drawn) => {
      if (drawn) this.#apply();
    });
    session.on("hello", () => {
      this.#keys = new Set([...this.#keys].filter((key) => session.knows(...partOf(key))));
      this.#apply();
    });
  }

  /** @param {Part | null} part */
  hide(part) {
    if (part === null) return;
    const { robot, node } = part;
    this.#keys.add(keyOf(robot, node));
    this.#apply();
    this.session.select(null, null);
    const action = { label: "Show all", run: () => this.showAll() };
    this.session.emit("notice", { text: `${this.session.called(robot, node)} is hidden.`, action });
  }

  showAll() {
    for (const key of this.#keys) this.view.group(...partOf(key)).visible = true;
    this.#keys.clear();
    this.view.changed();
  }

  get count() {
    return this.#keys.size;
  }

  #apply() {
    for (const key of this.#keys) this.view.group(...partOf(key)).visible = false;
    if (this.count > 0) this.view.changed();
  }
}
