// The part under the pointer, lit up. The server may draw it anew at any time.

import { Color } from "three";

const AMOUNT = 0.28; // of the colour that is added

export class Highlight {
  /** @type {{ robot: string, node: string, colour: number } | null} */
  #part = null;
  /** @type {Set<import("three").MeshStandardMaterial>} */
  #lit = new Set(); // materials, which emit nothing themselves

  /** @param {View} view @param {Session} session */
  constructor(view, session) {
    this.view = view;
    this.session = session;
    view.before((drawn) => {
      if (drawn) this.#show();
    });
    session.on("hello", () => {
      this.#part = null;
    });
  }

  /** Light one part up, or none: null. @param {{ robot: string, node: string } | null} part @param {number} colour */
  light(part, colour) {
    const before = this.#part;
    if (part?.robot === before?.robot && part?.node === before?.node) return;
    this.#part = part && { robot: part.robot, node: part.node, colour };
    this.#show();
    this.view.changed();
  }

  #show() {
    for (const { emissive } of this.#lit) emissive.setHex(0);
    this.#lit.clear();
    if (this.#part === null || !this.session.knows(this.#part.robot, this.#part.node)) return;
    const colour = new Color(this.#part.colour).multiplyScalar(AMOUNT);
    this.view.group(this.#part.robot, this.#part.node).traverse((object) => {
      const { material } = /** @type {import("three").Mesh<any, any>} */ (object);
      for (const paint of [material].flat()) {
        if (paint?.emissive === undefined) continue;
        paint.emissive.copy(colour);
        this.#lit.add(paint);
      }
    });
  }
}
