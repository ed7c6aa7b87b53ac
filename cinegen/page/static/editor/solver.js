// The solver of a robot whose text is edited: forward kinematics and closing of loops by the reader's own mathematics
// (raff/closing). It has no tasks: its joints move by sliders.

import { Matrix4, Quaternion } from "three";
import { close, CLOSED } from "../raff/closing/closure.js";
import { clusters } from "../raff/closing/cluster.js";
import { largest } from "../raff/closing/linear_algebra.js";
import { times, transform } from "../raff/kleinfinger.js";

const STEP = 0.05; // rad or characteristic lengths
const BRANCH = 0.5; // a passive joint that moves further in a step has changed its branch

/** @typedef {import("../session/solver_interface").Solver} Solver */
/** @typedef {import("./reading.js").Model} Model */
/** @typedef {import("./reading.js").Analysis} Analysis */

/** @implements {Solver} */
export class ModelSolver {
  mostTasks = 0;

  /**
   * @param {Model} model
   * @param {Analysis} analysis
   */
  constructor(model, { home, actuated, length }) {
    this.model = model;
    this.q = Float64Array.from(home);
    this.nq = home.length;
    this.names = { joints: model.joints.map(({ name }) => name), nodes: nodesOf(model).map(({ name }) => name) };
    this.actuated = [...actuated.keys()].filter((i) => actuated[i]);
    this.scale = model.joints.map(({ type }) => (type === "prismatic" ? length : 1));
    this.clusters = clusters(model, length);
  }

  /** @param {Float64Array} q */
  fk(q) {
    const placed = placements(this.model, q);
    return Float64Array.from(nodesOf(this.model).flatMap((body) => poseOf(placed.get(body) ?? [])));
  }

  /**
   * @param {Float64Array} q
   * @param {Uint8Array} locked
   */
  close(q, locked) {
    let gap = 0;
    for (const cluster of this.clusters) {
      const found = close(cluster, cluster.joints.map((i) => q[i]), cluster.joints.map((i) => !locked[i]));
      cluster.joints.forEach((i, k) => (q[i] = found.q[k]));
      gap = Math.max(gap, found.gap);
    }
    return gap;
  }

  /**
   * @param {Float64Array} q
   * @param {ArrayLike<number>} goal
   */
  follow(q, goal) {
    const locked = new Uint8Array(this.nq);
    for (const i of this.actuated) locked[i] = 1;
    const far = largest(this.actuated.map((i, k) => (goal[k] - q[i]) / this.scale[i]));
    const steps = Math.max(1, Math.ceil(far / STEP));
    let here = q.slice();
    for (let step = 1; step <= steps; step += 1) {
      const there = here.slice();
      this.actuated.forEach((i, k) => (there[i] = q[i] + ((goal[k] - q[i]) * step) / steps));
      if (this.close(there, locked) > CLOSED) return null;
      if (there.some((value, i) => Math.abs(value - here[i]) > BRANCH * this.scale[i])) return null;
      here = there;
    }
    return here;
  }

  /** @param {Float64Array} q */
  tick(q) {
    return { status: "IDLE", saturated: [], errors: [], closure: this.close(q.slice(), new Uint8Array(this.nq).fill(1)) };
  }

  sigma() {
    return { type1: null, type2: null };
  }
}

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

/** @param {import("../raff/kleinfinger.js").Placement} rows */
function poseOf([a, b, c, x, d, e, f, y, g, h, i, z]) {
  const rotation = new Matrix4().set(a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1);
  return [x, y, z, ...new Quaternion().setFromRotationMatrix(rotation).toArray()];
}
