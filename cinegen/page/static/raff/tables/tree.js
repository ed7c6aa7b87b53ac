// A model's joints as the kernels have them: parents before children, each with its placement on its parent at zero. The
// order is Pinocchio's: depth first, joints on one body by their names.

import { times, transform } from "../kleinfinger.js";

/** @typedef {import("../kleinfinger.js").Placement} Placement */
/** @typedef {import("../model.js").Model} Model */

/**
 * A joint: `joint` is its index in `model.joints`, `parent` that of its parent in the tree's joints, -1 for the world;
 * `movers` are the indices of the joints from the world to this one.
 *
 * @typedef {{ joint: number, parent: number, offset: Placement, slides: boolean, movers: number[] }} TreeJoint
 */

export class JointTree {
  /** @type {TreeJoint[]} */
  joints = [];
  /** Of each body the joint that carries it, -1 for the world, and its placement there. @type {{ on: number, at: Placement }[]} */
  bodies = [];

  /** @param {Model} model */
  constructor(model) {
    this.model = model;
    const waiting = [0];
    const children = childrenOf(model);
    for (let i = waiting.pop(); i !== undefined; i = waiting.pop()) {
      this.bodies[i] = this.#place(i);
      waiting.push(...children[i].toReversed());
    }
    this.index = new Map(this.joints.map(({ joint }, k) => [joint, k]));
  }

  /**
   * Return the index of a joint of the model here.
   *
   * @param {number} joint
   */
  at(joint) {
    return /** @type {number} */ (this.index.get(joint));
  }

  /** @param {number} i index of a body whose parent is placed */
  #place(i) {
    const { parent, joint, parameters, placement } = this.model.bodies[i];
    const { on, at } = parent < 0 ? { on: -1, at: null } : this.bodies[parent];
    const placed = (/** @type {Placement} */ own) => (at === null ? own : times(at, own));
    if (joint < 0) return { on, at: placed(placement) };
    const slides = this.model.joints[joint].type === "prismatic";
    const offset = placed(transform({ ...parameters, [slides ? "r" : "theta"]: 0 }));
    const movers = [...(on < 0 ? [] : this.joints[on].movers), this.joints.length];
    this.joints.push({ joint, parent: on, offset, slides, movers });
    return { on: this.joints.length - 1, at: IDENTITY };
  }

  /**
   * Return the placements of all joints in the robot's own world.
   *
   * @param {ArrayLike<number>} q in the tree's order
   */
  placements(q) {
    /** @type {Placement[]} */
    const found = [];
    this.joints.forEach(({ parent, offset, slides }, k) => {
      const moved = times(offset, transform({ gamma: 0, epsilon: 0, d: 0, alpha: 0, ...(slides ? { theta: 0, r: q[k] } : { theta: q[k], r: 0 }) }));
      found.push(parent < 0 ? moved : times(found[parent], moved));
    });
    return found;
  }

  /**
   * Return how joints move the second of two bodies against the first: 1, -1 where they move the first, 0.
   *
   * @param {number} first index of a body
   * @param {number} second
   */
  signs(first, second) {
    const signs = new Array(this.joints.length).fill(0);
    for (const k of this.movers(second)) signs[k] += 1;
    for (const k of this.movers(first)) signs[k] -= 1;
    return signs;
  }

  /** @param {number} body */
  movers(body) {
    const { on } = this.bodies[body];
    return on < 0 ? [] : this.joints[on].movers;
  }
}

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];

/**
 * Return the children of each body by the names of their joints.
 *
 * @param {Model} model
 */
function childrenOf({ bodies }) {
  /** @type {number[][]} */
  const children = bodies.map(() => []);
  bodies.forEach(({ parent }, i) => parent >= 0 && children[parent].push(i));
  const name = (/** @type {number} */ i) => /** @type {string} */ (bodies[i].jointName);
  return children.map((own) => own.sort((a, b) => (name(a) < name(b) ? -1 : 1)));
}

/**
 * Return a placement as the kernels have it: three axes, then the origin.
 *
 * @param {Placement} rows
 */
export function frameOf([a, b, c, x, d, e, f, y, g, h, i, z]) {
  return [a, d, g, b, e, h, c, f, i, x, y, z];
}
