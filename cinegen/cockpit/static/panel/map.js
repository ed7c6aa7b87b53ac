// Map: which quantity the cells show, how large they are, and where they are cut open.
//
// For tests: #section-map; #map-quantity, #map-shown, #map-axis, #map-cut, #map-layer, #map-share, #map-note.

import { make, write } from "../base/dom.js";
import { speak } from "../base/speech.js";
import { units } from "../base/units.js";
import { valueOf } from "../map/numbers.js";
import { Section } from "./section.js";
import { fill } from "./slider.js";

const HINT = "What the robot reaches. Click a cell: the robot goes there";
const STEPS = 100;

/** @typedef {import("../map/field.js").About} About */

export class MapSection {
  quantity = make("select");
  axis = make("select");
  shown = make("input");
  layer = make("input");
  share = make("input");
  cut = make("input");
  how = make("span");
  at = make("output", { class: "number", "aria-live": "off" });
  note = make("div", { id: "map-note", class: "description quiet" });

  /** @param {HTMLElement} panel @param {Field} field */
  constructor(panel, field) {
    this.field = field;
    this.section = new Section(panel, "map", "Map", HINT);
    this.section.element.hidden = true;
    field.on("cells", () => this.#show());
    units.on("change", () => {
      if (field.about !== null) this.#showCut();
    });
  }

  #show() {
    const { about } = this.field;
    if (about === null) return;
    if (this.section.element.hidden) this.#build(about);
    this.section.element.hidden = false;
    const part = about.cells > 0 ? about.done / about.cells : 1;
    write(this.section.note, part < 1 ? `${(100 * part).toFixed(0)} %` : "");
    const thin = about.axes.filter(({ every }) => every > 1).map(({ name, every }) => `1 of ${every} along ${name}`);
    const all = `${about.cells.toLocaleString("en")} cells`;
    const shown = about.shown.toLocaleString("en");
    const text = thin.length > 0 ? `${shown} shown of ${all} (${thin.join(", ")})` : `${shown} of ${all} reached`;
    write(this.note, about.shown === 0 ? `${text}: nothing to be seen` : text);
  }

  /** @param {About} about */
  #build(about) {
    const { field } = this;
    this.quantity = this.#choice("map-quantity", "What the colours show", about.quantities.map(({ name }) => name));
    this.quantity.value = field.quantity ?? "";
    this.quantity.addEventListener("change", () => field.choose({ quantity: this.quantity.value }));
    this.shown = this.#box("map-shown", field.shown);
    this.shown.addEventListener("change", () => field.choose({ shown: this.shown.checked }));
    this.share = this.#slider("map-share", "How large cells are", 5, STEPS, Math.round(STEPS * field.share));
    this.share.addEventListener("input", () => field.choose({ share: Number(this.share.value) / STEPS }));
    const axes = about.axes.filter(({ count }) => count > 1);
    this.axis = this.#choice("map-axis", "Along which axis the map is cut", axes.map(({ name }) => name));
    this.cut = this.#slider("map-cut", "Where it is cut", 0, 1, 1);
    this.layer = this.#box("map-layer", field.cut?.layer ?? false);
    const last = field.cut === null ? axes.at(-1) : about.axes[field.cut.axis];
    if (last !== undefined) this.axis.value = last.name;
    this.#range(field.cut?.index);
    this.axis.addEventListener("change", () => {
      this.#range();
      this.#choose();
    });
    for (const control of [this.cut, this.layer]) control.addEventListener("input", () => this.#choose());
    this.section.body.append(
      make(
        "div",
        { class: "pair", hidden: about.quantities.length === 0 },
        make("label", { for: "map-quantity" }, "Colours"),
        this.quantity,
      ),
      make("div", { class: "pair" }, make("label", { for: "map-share" }, "Cells"), this.share),
      make(
        "div",
        { class: "pair three", hidden: axes.length === 0 },
        make("label", { class: "cut" }, this.how, this.axis),
        this.cut,
        this.at,
      ),
      make(
        "div",
        { class: "ticks" },
        make("label", { title: "Only the cells at this value, not those up to it" }, this.layer, "one layer"),
        make("label", { title: "Show the cells" }, this.shown, "shown"),
      ),
      this.note,
    );
  }

  /** The axis that is cut. */
  get #axis() {
    return (this.field.about?.axes ?? []).findIndex(({ name }) => name === this.axis.value);
  }

  /** @param {number} [index] */
  #range(index) {
    const axis = this.field.about?.axes[this.#axis];
    if (axis === undefined) return;
    this.cut.max = String(axis.count - 1);
    this.cut.value = String(index ?? (this.layer.checked ? axis.count >> 1 : axis.count - 1));
    this.#showCut();
  }

  #choose() {
    const index = Number(this.cut.value);
    const layer = this.layer.checked;
    const whole = !layer && index === Number(this.cut.max);
    this.field.choose({ cut: whole ? null : { axis: this.#axis, index, layer } });
    this.#showCut();
  }

  #showCut() {
    const axis = this.field.about?.axes[this.#axis];
    if (axis === undefined) return;
    const text = this.field.cut === null ? "all" : valueOf(axis, Number(this.cut.value));
    write(this.how, this.layer.checked ? "Only at" : "Up to");
    write(this.at, text);
    speak(this.cut, text);
    fill(this.cut);
  }

  /** @param {string} id @param {string} title @param {string[]} names */
  #choice(id, title, names) {
    return make("select", { class: "small", id, title }, ...names.map((name) => make("option", { value: name }, name)));
  }

  /** @param {string} id @param {boolean} on */
  #box(id, on) {
    const box = make("input", { type: "checkbox", id });
    box.checked = on;
    return box;
  }

  /** @param {string} id @param {string} label @param {number} min @param {number} max @param {number} value */
  #slider(id, label, min, max, value) {
    const slider = make("input", { type: "range", id, min, max, step: 1, title: label, "aria-label": label });
    slider.value = String(value);
    const show = () => {
      fill(slider);
      if (id === "map-share") speak(slider, `${Math.round((100 * Number(slider.value)) / max)} %`);
    };
    slider.addEventListener("input", show);
    show();
    return slider;
  }
}
