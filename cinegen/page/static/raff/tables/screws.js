// The data of the loops' screw matrix: see cinegen/loops/screws.py, which defines it and gives the reasons.

import { eigen } from "../closing/linear_algebra.js";
import { centre, scaleOf, screwsOf, spread } from "../closing/length.js";

/** @typedef {import("../closing/length.js").Screw} Screw */
/** @typedef {import("../kleinfinger.js").Placement} Placement */
/** @typedef {import("./loops.js").Loop} Loop */
/** @typedef {{ cluster: number, joint: number, point: number[], share: number }} AxisPoint `joint`: -1 for the world */

/**
 * @param {import("./tree.js").JointTree} tree
 * @param {Loop[]} loops
 * @param {number[][]} clusters the loops of each
 * @param {ArrayLike<number>} home
 * @param {number} length characteristic length, m
 */
export function loopScrews(tree, loops, clusters, home, length) {
  const placed = tree.placements(home);
  const at = (/** @type {number} */ joint) => (joint < 0 ? IDENTITY : placed[joint]);
  /** Of each column of the matrix: its twist, a number for its joint, and the joint of the tree that carries it. */
  const columns = tree.joints.map(({ slides }, k) => ({ screw: screwsOf(slides ? "prismatic" : "revolute", placed[k])[0], owner: k, carrier: k }));
  loops.forEach(({ kind, first, end }, i) => {
    for (const screw of screwsOf(kind, end(at(first)))) columns.push({ screw, owner: tree.joints.length + i, carrier: first });
  });
  const signs = loops.map((loop, i) => columns.map(({ owner }, k) => (k < tree.joints.length ? loop.signs[k] : owner === tree.joints.length + i ? -1 : 0)));
  const mix = loops.map(() => loops.map(() => 0));
  /** @type {number[]} */
  const lengths = [];
  /** @type {AxisPoint[]} */
  const points = [];
  clusters.forEach((own, c) => {
    const w = mixOf(own.map((i) => signs[i]));
    own.forEach((i, a) => own.forEach((j, b) => (mix[i][j] = w[a][b])));
    const turning = columns.filter(({ screw }, k) => own.some((i) => signs[i][k] !== 0) && screw.w.some((x) => x !== 0));
    const carriers = new Map(turning.map(({ owner, carrier }) => [owner, carrier]));
    const origins = [...carriers.values()].map((carrier) => [3, 7, 11].map((i) => at(carrier)[i]));
    const near = [0, 1, 2].map((i) => origins.reduce((sum, origin) => sum + origin[i], 0) / (origins.length || 1));
    const about = centre(turning.map(({ screw }) => screw), near);
    lengths.push(scaleOf(spread(turning.map(({ screw }) => screw), about), length));
    for (const [owner, joint] of carriers) {
      const its = turning.filter((one) => one.owner === owner);
      const point = seenFrom(at(joint), centre(its.map(({ screw }) => screw), about));
      points.push({ cluster: c, joint, point, share: its.length / turning.length });
    }
  });
  return { mix, lengths, points };
}

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];

/**
 * @param {number[][]} signs of loops that share joints
 */
function mixOf(signs) {
  const { values, vectors } = eigen(signs.map((a) => signs.map((b) => a.reduce((sum, x, k) => sum + x * b[k], 0))));
  const squares = values.map((value) => Math.max(value, 1e-9)); // a loop without joints
  const factor = Math.exp(squares.reduce((sum, value) => sum + Math.log(value), 0) / squares.length / 2);
  return signs.map((_, i) => signs.map((__, j) => factor * vectors.reduce((sum, vector, k) => sum + (vector[i] * vector[j]) / Math.sqrt(squares[k]), 0)));
}

/**
 * @param {Placement} m
 * @param {number[]} point
 */
function seenFrom(m, [x, y, z]) {
  const [a, b, c] = [x - m[3], y - m[7], z - m[11]];
  return [0, 1, 2].map((i) => m[i] * a + m[4 + i] * b + m[8 + i] * c);
}
