// The legend of a map, at the bottom of the pane, so that pictures contain it.
//
// For tests: #legend, with .name, .low, .high and .cell (values of the cell under the pointer).

import { make, write } from "../base/dom.js";
import { units } from "../base/units.js";
import { GRADIENT } from "./colours.js";
import { formatted, valueOf } from "./numbers.js";

export class Legend {
  /** @type {number | null} */
  #cell = null;

  /** @param {{ view: View, field: Field }} parts */
  constructor({ view, field }) {
    this.field = field;
    this.name = make("div", { class: "name" });
    this.bar = make("div", { class: "colours" });
    this.bar.style.background = GRADIENT;
    this.low = make("span", { class: "number low" });
    this.high = make("span", { class: "number high" });
    this.ends = make("div", { class: "ends" }, this.low, this.high);
    this.cell = make("dl", { class: "cell" });
    this.element = make("div", { id: "legend", hidden: true, role: "img" }, this.name, this.bar, this.ends, this.cell);
    view.pane.parentElement?.append(this.element);
    for (const event of /** @type {const} */ (["cells", "change"])) field.on(event, () => this.#show());
    units.on("change", () => {
      if (field.about !== null) this.#show();
    });
  }

  /** Show the coordinates and values of a cell; null: of none. @param {number | null} cell */
  point(cell) {
    this.#cell = cell;
    this.#showCell();
  }

  #show() {
    const { field } = this;
    const described = field.description();
    this.element.hidden = !field.shown;
    this.bar.hidden = this.ends.hidden = described === null;
    write(this.name, described === null ? "reached" : described.text);
    if (described !== null) {
      write(this.low, `${(described.least ?? described.low) < described.low ? "≤ " : ""}${formatted(described.low, described.unit)}`);
      write(this.high, `${(described.most ?? described.high) > described.high ? "≥ " : ""}${formatted(described.high, described.unit)}`);
      this.element.setAttribute("aria-label", `${described.text}: ${this.low.textContent} to ${this.high.textContent}`);
    }
    this.#showCell();
  }

  #showCell() {
    const { field } = this;
    const { about } = field;
    const cell = this.#cell;
    this.cell.hidden = cell === null;
    if (cell === null || about === null) return;
    const rows = [
      ...about.axes.map((axis, k) => [axis.name, valueOf(axis, field.array("indices")[cell * about.axes.length + k])]),
      ...about.quantities.map(({ name, unit }) => [name, formatted(field.values(name)?.[cell] ?? NaN, unit)]),
    ];
    this.cell.replaceChildren(...rows.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
  }
}
