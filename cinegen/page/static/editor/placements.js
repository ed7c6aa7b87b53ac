// Where the bodies of a model are.

import { times, transform } from "../raff/kleinfinger.js";

/** @typedef {import("./reading.js").Model} Model */

/**
 * Return the bodies that the text names, in its order.
 *
 * @param {Model} model
 */
export function nodesOf({ bodies }) {
  return bodies.filter(({ isNode }) => isNode);
}

/**
 * Return the placements of all bodies in the robot's own world.
 *
 * @param {Model} model
 * @param {ArrayLike<number>} q
 */
export function placements({ bodies, joints }, q) {
  /** @type {Map<import("../raff/model.js").Body, import("../raff/kleinfinger.js").Placement>} */
  const placed = new Map();
  for (const body of bodies) {
    const waiting = [];
    for (let at = body; !placed.has(at); at = bodies[at.parent]) {
      waiting.push(at);
      if (at.parent < 0) break;
    }
    for (const one of waiting.reverse()) {
      const { parent, joint, parameters } = one;
      const moved = joint < 0 ? {} : { [joints[joint].type === "prismatic" ? "r" : "theta"]: q[joint] };
      const own = transform({ ...parameters, ...moved });
      const carrier = parent < 0 ? undefined : placed.get(bodies[parent]);
      placed.set(one, carrier === undefined ? own : times(carrier, own));
    }
  }
  return placed;
}
