// Labels next to points of the scene.

import { Vector3 } from "three";
import { make, write } from "../base/dom.js";

const HIGH = 1.7; // of the page's type: a label with its room (they overlap where they are nearer by a pixel and more)
const ASIDE = 16;

/** @typedef {{ element: HTMLElement, point: Vector3, text: string, wide: number }} Label */

export class Labels {
  /** @type {Map<string, Label>} */
  #shown = new Map();
  #where = new Vector3();
  #type = 13; // pixels

  /** @type {string | null} */
  only = null; // key of the only one that is shown; null: all are

  /** @param {View} view */
  constructor(view) {
    this.view = view;
    this.layer = make("div", { class: "labels", "aria-hidden": "true" });
    view.pane.append(this.layer);
    view.last(() => this.#place());
    const measure = () => {
      this.#type = parseFloat(getComputedStyle(document.body).fontSize);
      for (const label of this.#shown.values()) label.wide = label.element.offsetWidth;
    };
    window.addEventListener("resize", measure);
    measure();
  }

  /**
   * Shows a text at a point of the world (a vector that may go on moving); an empty text takes it away.
   * @param {string} key
   * @param {string} text
   * @param {Vector3} point
   * @param {string} kind a CSS class
   */
  put(key, text, point = new Vector3(), kind = "") {
    let label = this.#shown.get(key);
    if (!text) {
      label?.element.remove();
      this.#shown.delete(key);
      return;
    }
    if (label === undefined) {
      label = { element: make("span", { class: `label ${kind}` }), point, text: "", wide: 0 };
      this.layer.append(label.element);
      this.#shown.set(key, label);
    }
    label.point = point;
    if (label.text !== text) {
      label.text = text;
      write(label.element, text);
      label.wide = label.element.offsetWidth;
    }
    this.view.changed();
  }

  /** All of them, for who draws them elsewhere. */
  get all() {
    return this.#shown;
  }

  /** Beside their points, a hint below the middle of its, within the pane, one below the other where they would overlap. */
  #place() {
    if (this.view.headset !== null) return; // it shows them in the scene
    const { clientWidth: wide, clientHeight: high } = this.view.pane;
    const row = Math.round(HIGH * this.#type);
    /** @type {{ x: number, y: number, wide: number }[]} */
    const taken = [];
    for (const [key, label] of this.#shown) {
      const pixels = this.only === null || this.only === key ? this.view.pixels(label.point, this.#where) : null;
      label.element.hidden = pixels === null;
      if (pixels === null) continue;
      label.wide ||= label.element.offsetWidth; // it was not laid out before
      let x = pixels.x + (key === "hint" ? -label.wide / 2 : ASIDE);
      if (x + label.wide > wide - 4) x = pixels.x - ASIDE - label.wide;
      x = Math.max(4, Math.min(wide - label.wide - 4, x));
      let y = Math.max(4, Math.min(high - row - 8, pixels.y + (key === "hint" ? row / 2 : -row / 2)));
      /** @param {{ x: number, y: number, wide: number }} other */
      const meets = (other) => Math.abs(other.y - y) < row - 1 && x < other.x + other.wide && other.x < x + label.wide;
      for (let other; (other = taken.find(meets)) !== undefined;) y = other.y + row;
      taken.push({ x, y, wide: label.wide });
      label.element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    }
  }
}
