// Colours on parts: lit up under the pointer, and shaded towards a colour near a limit. Parts are drawn by the server
// at any time, so what is shaded is looked after before every picture that shows something new.

import { Color } from "three";
import { keyOf } from "../base/session.js";

const SHARE = 0.85; // of the colour that a part is shaded with

export class Tint {
  #lit = null; // key of the node under the pointer
  #shades = new Map(); // key -> colour
  #dirty = new Map(); // key -> [robot, node] to be coloured anew

  constructor(view, session) {
    this.view = view;
    this.session = session;
    view.before((drawn) => this.#colour(drawn));
    session.on("hello", () => {
      this.#shades.clear();
      this.#lit = null;
    });
  }

  /** Lights one part up, or none: null. */
  light(part, colour) {
    const key = part === null ? null : keyOf(part.robot, part.node);
    if (key === (this.#lit?.key ?? null)) return;
    if (this.#lit !== null) this.#touch(this.#lit.robot, this.#lit.node);
    this.#lit = part === null ? null : { key, robot: part.robot, node: part.node, colour };
    if (part !== null) this.#touch(part.robot, part.node);
  }

  /** Shades a part with a colour; null gives it its own back. */
  shade(robot, node, colour) {
    const key = keyOf(robot, node);
    if ((this.#shades.get(key) ?? null) === colour) return;
    if (colour === null) this.#shades.delete(key);
    else this.#shades.set(key, colour);
    this.#touch(robot, node);
  }

  #touch(robot, node) {
    this.#dirty.set(keyOf(robot, node), [robot, node]);
    this.view.changed();
  }

  #colour(drawn) {
    if (drawn) {
      for (const key of this.#shades.keys()) this.#dirty.set(key, key.split("\n"));
      if (this.#lit !== null) this.#dirty.set(this.#lit.key, [this.#lit.robot, this.#lit.node]);
    }
    for (const [key, [robot, node]] of this.#dirty) this.#apply(key, robot, node);
    this.#dirty.clear();
  }

  #apply(key, robot, node) {
    if (!this.session.knows(robot, node)) return;
    const shade = this.#shades.get(key) ?? null;
    const lit = this.#lit?.key === key ? this.#lit.colour : null;
    for (const child of this.view.group(robot, node).children) {
      if (child.name.startsWith("loop ")) continue; // a loop's mark has a colour of its own
      child.traverse((object) => {
        for (const material of [object.material].flat()) {
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
