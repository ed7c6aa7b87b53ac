// The map that is shown with a robot: its cells, their values, and which of them are shown.
//
// Events: cells (there are others), change (others of them are to be seen, or otherwise).

import { memory } from "../base/dom.js";
import { Events } from "../base/events.js";
import { pageUrl } from "../base/address.js";

const GROWING = 2000; // ms until a map that is being made is looked at again
const SHARE = { cloud: 0.6, surface: 0.96 }; // of a cell's width, that is drawn of it

/**
 * Description of a map by the server; its types are generated from cinegen/cockpit/messages.py.
 * @typedef {import("../base/messages").AxisShown} Axis
 * @typedef {import("../base/messages").MapDescription} About
 * @typedef {{ axis: number, index: number, layer: boolean }} Cut
 * @typedef {{ quantity: string | null, shown: boolean, cut: Cut | null, share: number }} Choice
 * @typedef {Uint32Array | Float32Array} Numbers
 */

/** @extends {Events<{ cells: undefined, change: undefined }>} */
export class Field extends Events {
  /** @type {About | null} */
  about = null; // description of the map; null without one
  /** @type {string | null} */
  quantity = null; // name of what the colours show
  shown = true;
  /** @type {Cut | null} */
  cut = null; // { axis, index, layer }: cells beyond an index of an axis are left out, or all but those at it
  share = 1; // of a cell's width
  /** @type {Map<string, Numbers>} */
  #numbers = new Map();
  #seen = new Uint32Array(0);
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #timer;

  /** @param {Session} session */
  constructor(session) {
    super();
    /** @type {boolean | null} */
    this.expected = null; // whether there is a map; null until that is known
    session.on("hello", ({ map = null }) => {
      this.expected = map !== null;
      clearTimeout(this.#timer);
      if (this.expected) this.#load();
    });
  }

  /** Whether nothing more is to be waited for before the first picture. */
  get ready() {
    return this.expected === false || this.about !== null;
  }

  /** An array of numbers of all cells. @param {string} name */
  array(name) {
    const numbers = this.#numbers.get(name);
    if (numbers === undefined) throw new Error(`the map has no numbers called "${name}"`);
    return numbers;
  }

  /** The values of a quantity; null where there are none. @param {string | null} name */
  values(name = this.quantity) {
    return this.#numbers.get(`value ${name}`) ?? null;
  }

  /** Return the description of the quantity that is shown; null without one. @param {string | null} name */
  description(name = this.quantity) {
    return this.about?.quantities.find((quantity) => quantity.name === name) ?? null;
  }

  /** Cells that are to be seen. */
  get seen() {
    return this.shown ? this.#seen : this.#seen.subarray(0, 0);
  }

  /** Chooses what is seen. @param {Partial<Choice>} choice */
  choose(choice) {
    Object.assign(this, choice);
    if ("share" in choice) memory.set(`map.share.${this.#kind}`, this.share);
    this.#look();
    this.emit("change");
  }

  get #kind() {
    return this.about?.surface ? "surface" : "cloud";
  }

  async #load() {
    try {
      if (await this.#grown()) {
        const first = this.about === null;
        this.about = this.#take(await (await got("map/cells.bin")).arrayBuffer());
        if (first) this.#begin(this.about);
        this.#look();
        this.emit("cells");
      }
    } catch (error) {
      console.warn("map:", error);
    }
    if (this.about === null || this.about.done < this.about.cells) {
      this.#timer = setTimeout(() => this.#load(), GROWING);
    }
  }

  /** Whether there is more of the map than is known here. */
  async #grown() {
    const { done } = await (await got("map/about.json")).json();
    return this.about?.done !== done;
  }

  /** Description of the map, followed by the arrays that it describes. @param {ArrayBuffer} block @returns {About} */
  #take(block) {
    const size = new DataView(block).getUint32(0, true);
    const about = JSON.parse(new TextDecoder().decode(new Uint8Array(block, 4, size)));
    this.#numbers = new Map(
      Object.entries(/** @type {About} */ (about).arrays).map(([name, { at, count, integer }]) => [
        name,
        new (integer ? Uint32Array : Float32Array)(block, 4 + size + at, count),
      ]),
    );
    return about;
  }

  /** @param {About} about */
  #begin({ quantity, axes }) {
    this.quantity = quantity;
    this.share = memory.get(`map.share.${this.#kind}`, SHARE[this.#kind]);
    const angle = axes.findIndex(({ translates, count }) => !translates && count > 1);
    if (angle >= 0 && axes.some(({ translates }) => translates)) {
      this.cut = { axis: angle, index: axes[angle].count >> 1, layer: true }; // otherwise all rotations are at one point
    } else if (axes.length > 2 && this.#surrounds()) {
      this.cut = { axis: 0, index: (axes[0].count - 1) >> 1, layer: false };
    }
  }

  /** Whether the cells are all around where the robot stands: then they would hide it. */
  #surrounds() {
    const points = this.array("points");
    const sides = new Set();
    for (let i = 0; i < points.length; i += 3) {
      for (let k = 0; k < 3; k += 1) if (points[i + k] !== 0) sides.add(points[i + k] > 0 ? k : -1 - k);
    }
    return sides.size === 6;
  }

  #look() {
    const { about, cut } = this;
    if (about === null) return;
    const indices = this.array("indices");
    const count = about.shown;
    const wide = about.axes.length;
    const seen = new Uint32Array(count);
    let n = 0;
    for (let i = 0; i < count; i += 1) {
      if (cut !== null) {
        const index = indices[wide * i + cut.axis];
        if (cut.layer ? index !== cut.index : index > cut.index) continue;
      }
      seen[n] = i;
      n += 1;
    }
    this.#seen = seen.subarray(0, n);
  }
}

/** Fetch a file that the server has next to the page. @param {string} name */
export async function got(name) {
  const answer = await fetch(pageUrl(name));
  if (!answer.ok) throw new Error(`${name}: ${answer.status}`);
  return answer;
}
