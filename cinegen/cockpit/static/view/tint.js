// Colours on parts: lit up under the pointer, and shaded towards a colour near a limit. Parts are drawn by the server
// at any time, so what is shaded is looked after before every picture that shows something new.

import { Color } from "three";
import { keyOf, partOf } from "../base/session.js";

const SHARE = 0.85; // of the colour that a part is shaded with

export class Tint {
  /** @type {{ key: string, robot: string, node: string, colour: number } | null} */
  #lit = null; // the node under the pointer
  /** @type {Map<string, number>} */
  #shades = new Map(); // key -> colour
  /** @type {Map<string, [string, string]>} */
  #dirty = new Map(); // key -> [robot, node] to be coloured anew

  /**
   * @param {import("./view.js").View} view
   * @param {import("../base/session.js").Session} session
   */
  constructor(view, session) {
    this.view = view;
    this.session = session;
    view.before((drawn) => this.#colour(drawn));
    session.on("hello", () => {
      this.#shades.clear();
      this.#lit = null;
    });
  }

  /**
   * Lights one part up, or none: null.
   *
   * @param {{ robot: string, node: string } | null} part
   * @param {number} colour
   */
  light(part, colour) {
    const key = part === null ? null : keyOf(part.robot, part.node);
    if (key === (this.#lit?.key ?? null)) return;
    if (this.#lit !== null) this.#touch(this.#lit.robot, this.#lit.node);
    this.#lit = part === null || key === null ? null : { key, robot: part.robot, node: part.node, colour };
    if (part !== null) this.#touch(part.robot, part.node);
  }

  /**
   * Shades a part with a colour; null gives it its own back.
   *
   * @param {string} robot
   * @param {string} node
   * @param {number | null} colour
   */
  shade(robot, node, colour) {
    const key = keyOf(robot, node);
    if ((this.#shades.get(key) ?? null) === colour) return;
    if (colour === null) this.#shades.delete(key);
    else this.#shades.set(key, colour);
    this.#touch(robot, node);
  }

  /**
   * @param {string} robot
   * @param {string} node
   */
  #touch(robot, node) {
    this.#dirty.set(keyOf(robot, node), [robot, node]);
    this.view.changed();
  }

  /** @param {boolean} drawn */
  #colour(drawn) {
    if (drawn) {
      for (const key of this.#shades.keys()) this.#dirty.set(key, partOf(key));
      if (this.#lit !== null) this.#dirty.set(this.#lit.key, [this.#lit.robot, this.#lit.node]);
    }
    for (const [key, [robot, node]] of this.#dirty) this.#apply(key, robot, node);
    this.#dirty.clear();
  }

  /**
   * @param {string} key
   * @param {string} robot
   * @param {string} node
   */
  #apply(key, robot, node) {
    if (!this.session.knows(robot, node)) return;
    const shade = this.#shades.get(key) ?? null;
    const lit = this.#lit?.key === key ? this.#lit.colour : null;
    for (const child of this.view.group(robot, node).children) {
      if (child.name.startsWith("loop ")) continue; // a loop's mark has a colour of its own
      child.traverse((object) => {
        const { material: given } = /** @type {{ material?: import("three").MeshLambertMaterial }} */ (object);
        for (const material of [given].flat()) {
          if (material?.emissive === undefined) continue;
          material.userData.own ??= { colour: material.color.clone(), emissive: material.emissive.clone() };
          const { own } = material.userData;
          material.color.copy(own.colour);
          material.emissive.copy(own.emissive);
          if (shade !== null) material.color.lerp(new Color(shade), SHARE);
          if (lit !== null) material.emissive.add(new Color(lit).multiplyScalar(0.28));
        }
      });
    }
  }
}
