// The effect of a model's loops on its motion: home with all loops closed, mobility, actuated joints, and the
// characteristic length; see raff2urdf/analysis.py.

import { loopKinds, rows, texts } from "../definitions.js";
import { CLOSED, closeFromAfar, closeWithin, genericRank, passive } from "./closure.js";
import { clusters } from "./cluster.js";
import { times, transform } from "../kleinfinger.js";
import { characteristicLength, screwsOf } from "./length.js";
import { largest } from "./linear_algebra.js";
import { fill, significant } from "../texts.js";

/** @typedef {import("./cluster.js").Cluster} Cluster */
/** @typedef {import("../kleinfinger.js").Placement} Placement */
/** @typedef {import("../model.js").Model} Model */

/**
 * `home`: of each joint, rad or m, where all loops are closed, within the limits if possible; `gap`: the largest gap as
 * written, `closure` at home (rad or characteristic lengths); `ranks` of `clusters`, and random closed configurations that
 * each has `met`; `actuated`: of each joint; `length` in m.
 *
 * @typedef {{
 *   home: number[], gap: number, closure: number, rows: number, rank: number, ranks: number[], met: number[][][],
 *   mobility: number, actuated: boolean[], length: number,
 * }} Analysis
 */

/** Loops that can't be closed. */
export class OpenLoops extends Error {}

/**
 * Close a model's loops, beginning at the configuration as written, and count its degrees of freedom.
 *
 * @param {Model} model
 * @returns {Analysis}
 * @throws {OpenLoops}
 */
export function analyse(model) {
  const { joints } = model;
  const home = joints.map((joint) => joint.home);
  let length = lengthOf(model, home);
  let [gap, closure, equations] = [0, 0, 0];
  /** @type {number[]} */
  const ranks = [];
  /** @type {number[][][]} */
  const met = [];
  /** @type {Set<number>} joints that the others move */
  const determined = new Set();
  for (const cluster of clusters(model, length)) {
    gap = Math.max(gap, largest(cluster.evaluate(cluster.home).c));
    const closing = closeFromAfar(cluster, cluster.start);
    if (closing.gap > CLOSED) throw new OpenLoops(whyOpen(model, cluster, closing.q));
    const inside = closeWithin(cluster, closing.q);
    closure = Math.max(closure, largest(cluster.evaluate(inside).c));
    cluster.joints.forEach((joint, i) => (home[joint] = inside[i]));
    const generic = genericRank(cluster, closing.q);
    const { jacobian } = cluster.evaluate(generic.q);
    equations += jacobian.length;
    ranks.push(generic.rank);
    met.push(generic.met);
    for (const i of passive(jacobian, outermostFirst(cluster))) determined.add(cluster.joints[i]);
  }
  if (equations) length = lengthOf(model, home);
  const actuated = joints.map((joint, i) => joint.actuated ?? !determined.has(i));
  const rank = ranks.reduce((sum, one) => sum + one, 0);
  const mobility = joints.length + (model.movable ? 6 : 0) - rank;
  return { home, gap, closure, rows: equations, rank, ranks, met, mobility, actuated, length };
}

/**
 * The characteristic length at joint values, m.
 *
 * @param {Model} model
 * @param {number[]} q
 */
function lengthOf({ bodies, joints, balls, loops }, q) {
  const axes = new Map(balls.flatMap((ball) => ball.joints.map((name, i) => [name, i])));
  /** @type {Placement[]} */
  const placed = [];
  /** @type {Set<number>[]} joints that move each body */
  const movers = [];
  for (const i of outward(bodies)) {
    const { parent, joint, parameters } = bodies[i];
    const variable = joint < 0 ? {} : { [joints[joint].type === "prismatic" ? "r" : "theta"]: q[joint] };
    const own = transform({ ...parameters, ...variable });
    placed[i] = parent < 0 ? own : times(placed[parent], own);
    movers[i] = new Set([...(parent < 0 ? [] : movers[parent]), ...(joint < 0 ? [] : [joint])]);
  }
  const screws = joints.flatMap(({ name, type, body }) => {
    const axis = axes.get(name); // one of three about a point
    return axis === undefined ? screwsOf(type, placed[body]) : [screwsOf("ball", placed[body])[axis]];
  });
  const cut = loops.flatMap(({ kind, first }) => screwsOf(kind, placed[first]));
  const nodes = bodies.map((_, i) => i).filter((i) => bodies[i].isNode);
  const points = nodes.map((i) => [placed[i][3], placed[i][7], placed[i][11]]);
  const all = [...screws, ...cut];
  return characteristicLength(all, points, nodes.map((i) => all.map((_, k) => movers[i].has(k))));
}

/**
 * Indices of bodies, parents before their children.
 *
 * @param {Model["bodies"]} bodies
 */
function outward(bodies) {
  /** @type {number[][]} */
  const children = bodies.map(() => []);
  bodies.forEach(({ parent }, i) => parent >= 0 && children[parent].push(i));
  const order = [0];
  for (let i = 0; i < order.length; i++) for (const child of children[order[i]]) order.push(child);
  return order;
}

/**
 * The cluster's joints from the outermost inwards, beginning with those that the file declares passive, and then those
 * that follow others in couplings.
 *
 * @param {Cluster} cluster
 */
function outermostFirst(cluster) {
  const { model, joints } = cluster;
  /** @type {Map<number, number>} */
  const depth = new Map();
  for (const body of cluster.bodies) {
    const { parent, joint } = model.bodies[body];
    depth.set(body, (depth.get(parent) ?? 0) + Number(joint >= 0));
  }
  const followers = new Set(cluster.couplings.map((i) => model.couplings[i].terms[0].joint));
  const keys = joints.map((joint, i) => [
    Number(model.joints[joint].actuated !== false), Number(!followers.has(joint)),
    -(depth.get(model.joints[joint].body) ?? 0), -i,
  ]);
  const compare = (/** @type {number[]} */ a, /** @type {number[]} */ b) => a.map((x, i) => x - b[i]).find((x) => x !== 0) ?? 0;
  return joints.map((_, i) => i).sort((a, b) => compare(keys[a], keys[b]));
}

/**
 * Which loops and couplings of a cluster can't be closed, and their least gaps.
 *
 * @param {Model} model
 * @param {Cluster} cluster
 * @param {number[]} q the best attempt
 */
function whyOpen(model, cluster, q) {
  const all = [
    ...cluster.loops.map((i) => model.loops[i]),
    ...cluster.couplings.map((i) => ({ name: model.couplings[i].name, kind: "coupling" })),
  ];
  const { c } = cluster.evaluate(q);
  let row = 0;
  const open = all
    .map(({ name, kind }) => ({ name, kind, gap: largest(c.slice(row, (row += ROWS.get(kind) ?? 0))) }))
    .filter((one) => one.gap > CLOSED);
  const listed = open.slice(0, 8).map(({ name, kind, gap }) => `'${name}' (${kind}, ${significant(gap, 3)})`).join(", ");
  const what = cluster.couplings.length ? texts.LOOPS_AND_COUPLINGS : texts.LOOPS;
  const more = open.length > 8 ? fill(texts.MORE_OPEN, { count: open.length - 8 }) : "";
  return `robot '${model.robot}': ${fill(texts.STAY_OPEN, { what, listed, more })}`;
}

/** @type {Map<string, number>} equations of each kind */
const ROWS = new Map([...loopKinds.map((kind, i) => /** @type {[string, number]} */ ([kind, rows[i]])), ["coupling", 1]]);
