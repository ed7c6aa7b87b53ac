// Loops and couplings that share joints, as equations c(q) = 0 of these joints: see `Cluster` in raff2urdf/tree.py.

import { IDENTITY, times, transform } from "../kleinfinger.js";
import { cross } from "./linear_algebra.js";
import { loopResidual } from "./residual.js";

/** @typedef {import("../kleinfinger.js").Placement} Placement */
/** @typedef {import("../model.js").Model} Model */
/** @typedef {import("../couplings.js").CouplingTable} CouplingTable */

const EXACT = 1e-14; // rad or m: a follower that is off by less stays as written

/**
 * Group the loops and couplings of a model into those that share bodies, in the order of their first equations: each group
 * can be closed by itself.
 *
 * @param {Model} model
 * @param {number} length characteristic length, m
 */
export function clusters(model, length) {
  const depth = depths(model);
  const branches = model.loops.map(({ first, second }) => branchesOf(model, depth, first, second));
  const found = [
    ...branches.map((pair, loop) => ({ bodies: new Set(pair.flat()), loops: [loop], couplings: /** @type {number[]} */ ([]) })),
    ...model.couplings.map(({ terms }, i) => ({
      bodies: new Set(terms.map(({ joint }) => model.joints[joint].body)), loops: /** @type {number[]} */ ([]), couplings: [i],
    })),
  ];
  /** @type {typeof found} */
  let groups = [];
  for (const one of found) {
    const apart = groups.filter((group) => ![...group.bodies].some((body) => one.bodies.has(body)));
    for (const group of groups.filter((other) => !apart.includes(other))) {
      for (const body of group.bodies) one.bodies.add(body);
      one.loops.push(...group.loops);
      one.couplings.push(...group.couplings);
    }
    groups = [...apart, one];
  }
  const first = (/** @type {typeof found[0]} */ { loops, couplings }) => Math.min(...loops, ...couplings.map((i) => model.loops.length + i));
  return groups.sort((a, b) => first(a) - first(b)).map((group) => new Cluster(model, group, branches, depth, length));
}

export class Cluster {
  /**
   * @param {Model} model
   * @param {{ bodies: Set<number>, loops: number[], couplings: number[] }} group
   * @param {[number[], number[]][]} branches of all loops
   * @param {number[]} depth of all bodies
   * @param {number} length
   */
  constructor(model, { bodies, loops, couplings }, branches, depth, length) {
    this.model = model;
    this.length = length;
    /** Bodies, parents first. */
    this.bodies = [...bodies].sort((a, b) => depth[a] - depth[b] || a - b);
    this.loops = loops.sort((a, b) => a - b);
    this.couplings = couplings.sort((a, b) => a - b);
    /** Indices in `model.joints`, in file order. */
    this.joints = model.joints.map((_, i) => i).filter((i) => bodies.has(model.joints[i].body));
    this.columns = new Map(this.joints.map((joint, i) => [joint, i]));
    this.isPrismatic = this.joints.map((i) => model.joints[i].type === "prismatic");
    this.signs = this.loops.map((loop) => {
      const [first, second] = branches[loop].map((side) => new Set(side));
      return this.joints.map((i) => {
        const { body } = model.joints[i];
        return second.has(body) ? 1 : first.has(body) ? -1 : 0;
      });
    });
    const scales = this.coupledScales();
    /** Size of a dimensionless step of each joint, rad or m. */
    this.scale = this.joints.map((joint) => /** @type {number} */ (scales.get(joint)));
    this.sizes = this.couplings.map((i) =>
      Math.sqrt(
        model.couplings[i].terms.reduce((sum, { joint, coefficients }) => {
          const scale = /** @type {number} */ (scales.get(joint));
          return sum + Math.max(...coefficients.map((c, power) => Math.abs(c) * scale ** (power + 1))) ** 2;
        }, 0),
      ),
    );
  }

  /** Home as written. */
  get home() {
    return this.joints.map((i) => this.model.joints[i].home);
  }

  /** The same, but with joints that follow others in couplings where these lead them. */
  get start() {
    const q = this.home;
    const pending = this.couplings.map((i) => this.model.couplings[i]);
    while (pending.length) {
      const followers = new Set(pending.map(({ terms }) => terms[0].joint));
      const ready = pending.filter(({ terms }) => terms.slice(1).every(({ joint }) => !followers.has(joint)));
      for (const one of ready.length ? ready : pending.slice(0, 1)) {
        pending.splice(pending.indexOf(one), 1);
        const { joint, coefficients: [own, ...powers] } = one.terms[0];
        const lack = this.equation(one, q).value;
        if (!powers.length && Math.abs(lack) > EXACT * Math.abs(own)) q[this.column(joint)] -= lack / own;
      }
    }
    return q;
  }

  /**
   * The joint values reached by a dimensionless step.
   *
   * @param {number[]} q
   * @param {number[]} step
   */
  integrate(q, step) {
    return q.map((value, i) => value + step[i] * this.scale[i]);
  }

  /**
   * The residual of the loops and couplings, and its derivative by the dimensionless step.
   *
   * @param {number[]} q
   */
  evaluate(q) {
    const placed = this.place(q);
    const at = (/** @type {number} */ body) => placed.get(body) ?? IDENTITY;
    /** @type {number[]} */
    const c = [];
    /** @type {number[][]} */
    const rows = [];
    for (const [k, index] of this.loops.entries()) {
      const { kind, first, second } = this.model.loops[index];
      const m = at(first);
      const part = loopResidual(kind, relative(m, at(second)), this.length);
      const twists = this.joints.map((joint, i) => {
        const own = at(this.model.joints[joint].body);
        const z = [own[2], own[6], own[10]].map((x) => x * this.signs[k][i]);
        const arm = [m[3] - own[3], m[7] - own[7], m[11] - own[11]];
        const [linear, angular] = this.isPrismatic[i] ? [z, [0, 0, 0]] : [cross(z, arm), z];
        return [...inAxes(m, linear), ...inAxes(m, angular)];
      });
      c.push(...part.c);
      for (const row of part.derivative) {
        rows.push(twists.map((twist, i) => row.reduce((sum, x, j) => sum + x * twist[j], 0) * this.scale[i]));
      }
    }
    for (const [k, index] of this.couplings.entries()) {
      const { value, slopes } = this.equation(this.model.couplings[index], q);
      c.push(value / this.sizes[k]);
      rows.push(slopes.map((slope, i) => (slope / this.sizes[k]) * this.scale[i]));
    }
    return { c, jacobian: rows };
  }

  /** @param {number[]} q */
  place(q) {
    /** @type {Map<number, Placement>} */
    const placed = new Map();
    for (const i of this.bodies) {
      const { parameters, parent, joint } = this.model.bodies[i];
      const column = joint < 0 ? undefined : this.columns.get(joint);
      const own =
        column === undefined ? parameters : { ...parameters, [this.isPrismatic[column] ? "r" : "theta"]: q[column] };
      placed.set(i, times(placed.get(parent) ?? IDENTITY, transform(own)));
    }
    return placed;
  }

  /**
   * The residual of a coupling, not divided by its size, and its derivative by each joint.
   *
   * @param {CouplingTable} coupling
   * @param {number[]} q
   */
  equation({ terms, constant }, q) {
    let value = -constant;
    const slopes = q.map(() => 0);
    for (const { joint, coefficients } of terms) {
      const column = this.column(joint);
      let [sum, slope] = [0, 0];
      for (const coefficient of [...coefficients].reverse()) {
        slope = slope * q[column] + sum + coefficient;
        sum = (sum + coefficient) * q[column];
      }
      value += sum;
      slopes[column] = slope;
    }
    return { value, slopes };
  }

  /** @param {number} joint */
  column(joint) {
    return /** @type {number} */ (this.columns.get(joint));
  }

  /** Sizes of dimensionless steps by joint: see `coupled_scales` in raff2urdf/coupling.py. */
  coupledScales() {
    const own = new Map(this.joints.map((joint, i) => [joint, this.isPrismatic[i] ? this.length : 1]));
    const found = new Map(own);
    const inner = innerBodies(this.model);
    for (const { terms } of this.couplings.map((i) => this.model.couplings[i])) {
      const driven = (/** @type {number} */ joint) =>
        Math.max(0, ...terms.filter((one) => one.joint !== joint).map((one) => Math.abs(one.coefficients[0]) * (own.get(one.joint) ?? 1)));
      for (const { joint, coefficients: [first] } of terms) {
        if (inner.has(this.model.joints[joint].body) || first === 0) continue;
        found.set(joint, Math.max(found.get(joint) ?? 0, driven(joint) / Math.abs(first)));
      }
    }
    return found;
  }
}

/**
 * The number of joints, fixed ones too, between the base and each body.
 *
 * @param {Model} model
 */
function depths({ bodies }) {
  /** @type {number[]} */
  const found = new Array(bodies.length).fill(-1);
  for (let i = 0; i < bodies.length; i++) {
    const trail = [];
    let at = i;
    for (; at >= 0 && found[at] < 0; at = bodies[at].parent) trail.push(at);
    let depth = at < 0 ? -1 : found[at];
    for (const body of trail.reverse()) found[body] = depth += 1;
  }
  return found;
}

/**
 * The bodies from each end of a loop (included) to their nearest common ancestor (excluded).
 *
 * @param {Model} model
 * @param {number[]} depth
 * @param {number} first
 * @param {number} second
 * @returns {[number[], number[]]}
 */
function branchesOf({ bodies }, depth, first, second) {
  /** @type {[number[], number[]]} */
  const sides = [[], []];
  const heads = [first, second];
  while (heads[0] !== heads[1]) {
    const deeper = Number(depth[heads[1]] > depth[heads[0]]);
    sides[deeper].push(heads[deeper]);
    heads[deeper] = bodies[heads[deeper]].parent;
  }
  return sides;
}

/**
 * Bodies behind which there are other joints, or ends of loops, with all their ancestors.
 *
 * @param {Model} model
 */
function innerBodies({ bodies, joints, loops }) {
  const inner = new Set([0]);
  for (let at of [...joints.map(({ body }) => bodies[body].parent), ...loops.flatMap(({ first, second }) => [first, second])]) {
    for (; !inner.has(at); at = bodies[at].parent) inner.add(at);
  }
  return inner;
}

/**
 * A vector in the axes of a placement.
 *
 * @param {Placement} m
 * @param {number[]} v
 */
function inAxes(m, [x, y, z]) {
  return [0, 1, 2].map((j) => m[j] * x + m[4 + j] * y + m[8 + j] * z);
}

/**
 * A placement seen from another one.
 *
 * @param {Placement} a
 * @param {Placement} b
 * @returns {Placement}
 */
function relative(a, b) {
  const [x, y, z] = inAxes(a, [b[3] - a[3], b[7] - a[7], b[11] - a[11]]);
  const found = [0, 1, 2].flatMap((i) => [...[0, 1, 2].map((j) => a[i] * b[j] + a[4 + i] * b[4 + j] + a[8 + i] * b[8 + j]), 0]);
  [found[3], found[7], found[11]] = [x, y, z];
  return found;
}
