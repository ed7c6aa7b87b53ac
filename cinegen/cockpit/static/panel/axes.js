// The axes of a sensor: which of them commands each axis of a node, inverted or scaled. The text is that of RAFF files.
//
// For tests: [data-axis="x"] with a select (value: an axis or "0"), a checkbox (inverted) and a number (factor).

import { choice, make } from "../base/dom.js";

export const AXES = ["x", "y", "z", "rx", "ry", "rz"];
const LARGEST = 100;

/** @typedef {{ source: string, negative: boolean, factor: number }} Entry */

/** @param {string} text with all entries, as the session reports it @returns {Entry[]} */
export function parseAxes(text) {
  return text.split(", ").map((entry) => {
    const [, sign, factor = "1", source] = /^(-?)(?:(.+)\*)?(\w+)$/.exec(entry) ?? ["", "", "1", "0"];
    return { source, negative: sign === "-", factor: Number(factor) };
  });
}

/** @param {Entry[]} entries */
export function formatAxes(entries) {
  return entries.map(({ source, negative, factor }) =>
      source === "0" ? "0" : `${negative ? "-" : ""}${factor === 1 ? "" : `${factor}*`}${source}`,
    ).join(", ");
}

/**
 * Return the entries after another source was selected for one: translations or rotations that had it swap theirs.
 * @param {Entry[]} entries
 * @param {number} index
 * @param {string} source
 */
export function swapped(entries, index, source) {
  const before = entries[index].source;
  return entries.map((entry, i) => {
    if (i === index) return { ...entry, source };
    const taken = source !== "0" && entry.source === source && i < 3 === index < 3;
    return taken ? { ...entry, source: before } : entry;
  });
}

export class AxesControl {
  /** @type {Entry[]} */
  #entries = [];
  #changed = -Infinity;

  /** @param {string} whose @param {(axes: string) => void} changed takes the text */
  constructor(whose, changed) {
    const change = (/** @type {Entry[]} */ entries) => {
      this.#changed = performance.now();
      this.#fill(entries);
      changed(formatAxes(entries));
    };
    const edit = (/** @type {number} */ i, /** @type {Partial<Entry>} */ part) =>
      change(this.#entries.map((entry, k) => (k === i ? { ...entry, ...part } : entry)));
    this.rows = AXES.map((axis, i) => {
      const on = { change: () => change(swapped(this.#entries, i, source.value)) };
      const options = [...AXES, "0"].map((value) => /** @type {[string, string]} */ ([value, value === "0" ? "none" : value]));
      const source = choice({ "aria-label": `Axis of ${whose} that commands ${axis}`, on }, options);
      const negative = make("input", { type: "checkbox", on: { change: () => edit(i, { negative: negative.checked }) } });
      const factor = make("input", {
        type: "number",
        class: "number",
        min: 0,
        max: LARGEST,
        step: 0.1,
        "aria-label": `Factor of ${axis}`,
        on: {
          change: () => {
            const value = Math.min(LARGEST, Math.abs(Number(factor.value)));
            edit(i, value > 0 ? { factor: value } : { source: "0", factor: 1 });
          },
        },
      });
      const element = make(
        "div",
        { class: "pair", data: { axis } },
        make("span", { class: "description" }, axis),
        source,
        make("label", {}, negative, "inverted"),
        factor,
      );
      return { element, source, negative, factor };
    });
    this.element = make(
      "details",
      { class: "axes", title: "Axes of the sensor that command x, y, z and rotations about them" },
      make("summary", {}, "Axes"),
      ...this.rows.map(({ element }) => element),
    );
  }

  /** @param {string | null | undefined} text as the session reports it; null: the sensor has no axes */
  show(text) {
    this.element.hidden = !text;
    if (!text || performance.now() - this.#changed < 800) return;
    this.#fill(parseAxes(text));
  }

  /** @param {Entry[]} entries */
  #fill(entries) {
    this.#entries = entries;
    this.rows.forEach(({ source, negative, factor }, i) => {
      const { source: wanted, negative: inverted, factor: scale } = entries[i];
      if (source.value !== wanted) source.value = wanted;
      negative.checked = inverted;
      negative.disabled = factor.disabled = wanted === "0";
      if (document.activeElement !== factor) factor.value = String(scale);
    });
  }
}
