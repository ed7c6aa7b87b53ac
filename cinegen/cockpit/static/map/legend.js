// What the colours of a map mean: at the foot of the pane, so that pictures have it, too.
//
// For tests: #legend, with .name, .low, .high and .cell (what is known of the cell under the pointer).

import { make, write } from "../base/dom.js";
import { units } from "../base/units.js";
import { GRADIENT } from "./colours.js";
import { spelled, valueOf } from "./words.js";

export class Legend {
  /** @type {number | null} */
  #cell = null;

  /** @param {{ view: import("../view/view.js").View, field: import("../map/field.js").Field }} parts */
  constructor({ view, field }) {
    this.field = field;
    this.name = make("div", { class: "name" });
    this.bar = make("div", { class: "colours" });
    this.bar.style.background = GRADIENT;
    this.low = make("span", { class: "number low" });
    this.high = make("span", { class: "number high" });
    this.ends = make("div", { class: "ends" }, this.low, this.high);
    this.cell = make("dl", { class: "cell" });
    this.element = make(
      "div",
      { id: "legend", hidden: true, role: "img" },
      this.name,
      this.bar,
      this.ends,
      this.cell,
    );
    view.pane.append(this.element);
    for (const event of /** @type {const} */ (["cells", "change"])) field.on(event, () => this.#show());
    units.on("change", () => {
      if (field.about !== null) this.#show();
    });
  }

  /**
   * Tells of a cell, or of none: null.
   *
   * @param {number | null} cell
   */
  tell(cell) {
    this.#cell = cell;
    this.#tell();
  }

  #show() {
    const { field } = this;
    const described = field.description();
    this.element.hidden = !field.shown;
    this.bar.hidden = this.ends.hidden = described === null;
    write(this.name, described === null ? "reached" : described.text);
    if (described !== null) {
      write(this.low, `${(described.least ?? described.low) < described.low ? "≤ " : ""}${spelled(described.low, described.unit)}`);
      write(this.high, `${(described.most ?? described.high) > described.high ? "≥ " : ""}${spelled(described.high, described.unit)}`);
      this.element.setAttribute("aria-label", `${described.text}: ${this.low.textContent} to ${this.high.textContent}`);
    }
    this.#tell();
  }

  #tell() {
    const { field } = this;
    const { about } = field;
    const cell = this.#cell;
    this.cell.hidden = cell === null;
    if (cell === null || about === null) return;
    const rows = [
      ...about.axes.map((axis, k) => [axis.name, valueOf(axis, field.array("indices")[cell * about.axes.length + k])]),
      ...about.quantities.map(({ name, unit }) => [name, spelled(field.values(name)?.[cell] ?? NaN, unit)]),
    ];
    this.cell.replaceChildren(...rows.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
  }
}
