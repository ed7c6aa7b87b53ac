// The part under the pointer, lit up. Parts are drawn by the server at any time, so it is looked after before every picture that
// shows something new.

import { Color } from "three";
import { keyOf } from "../base/session.js";

export class Tint {
  /** @type {{ key: string, robot: string, node: string, colour: number } | null} */
  #lit = null; // the node under the pointer
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
   * @param {string} robot
   * @param {string} node
   */
  #touch(robot, node) {
    this.#dirty.set(keyOf(robot, node), [robot, node]);
    this.view.changed();
  }

  /** @param {boolean} drawn */
  #colour(drawn) {
    if (drawn && this.#lit !== null) this.#dirty.set(this.#lit.key, [this.#lit.robot, this.#lit.node]);
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
    const lit = this.#lit?.key === key ? this.#lit.colour : null;
    for (const child of this.view.group(robot, node).children) {
      if (child.name.startsWith("loop ")) continue; // a loop's mark has a colour of its own
      child.traverse((object) => {
        const { material: given } = /** @type {{ material?: import("three").MeshLambertMaterial }} */ (object);
        for (const material of [given].flat()) {
          if (material?.emissive === undefined) continue;
          material.userData.own ??= { emissive: material.emissive.clone() };
          material.emissive.copy(material.userData.own.emissive);
          if (lit !== null) material.emissive.add(new Color(lit).multiplyScalar(0.28));
        }
      });
    }
  }
}
