// Ball joints that are written as three revolute joints each: see cinegen/assembly/bodies.py and
// cinegen/singularities/ball_joints.py.

import { eigen } from "../closing/linear_algebra.js";

const MEET = 1e-8; // characteristic lengths
const PARALLEL = 1e-8; // square of the angle (rad) below which axes are parallel

/** @typedef {import("./loops.js").Loop} Loop */
/** @typedef {{ point: number[], axis: number[] }} Line */
/** @typedef {{ sides: [number, number], line: Line | null, tree: number, single: boolean }} Edge `line`: of a revolute joint */

/**
 * Return the joints of the tree, by threes, that are written for a ball joint each.
 *
 * @param {import("./tree.js").JointTree} tree
 * @param {Loop[]} loops
 * @param {ArrayLike<number>} home
 * @param {{ length: number, locked: Set<number>, single: Set<number> }} options joints of the tree that are given, or that
 *   are no part of a ball joint
 */
export function threes(tree, loops, home, { length, locked, single }) {
  const placed = tree.placements(home);
  const lineOf = (/** @type {import("../kleinfinger.js").Placement} */ m) => ({ point: [m[3], m[7], m[11]], axis: [m[2], m[6], m[10]] });
  const body = tree.joints.map((_, k) => k + 1);
  body.unshift(0);
  for (const { kind, first, second } of loops) {
    if (kind !== "rigid") continue;
    const [one, other] = [body[first + 1], body[second + 1]];
    body.forEach((is, i) => is === other && (body[i] = one));
  }
  /** @type {Edge[]} */
  const edges = tree.joints.map(({ parent, slides }, k) => ({
    sides: [body[parent + 1], body[k + 1]], line: slides ? null : lineOf(placed[k]), tree: k, single: locked.has(k) || single.has(k),
  }));
  for (const { kind, first, second, end } of loops) {
    if (kind === "rigid") continue;
    const at = end(first < 0 ? WORLD : placed[first]);
    edges.push({ sides: [body[first + 1], body[second + 1]], line: kind === "revolute" ? lineOf(at) : null, tree: -1, single: false });
  }
  const kept = edges.filter(({ sides: [a, b] }) => a !== b);
  const passive = kept.filter(({ tree: k }) => !locked.has(k));
  if (meet(passive, length)) return []; // a spherical linkage, whose links are real ones
  /** @type {Map<Edge, Edge[]>} */
  const groups = new Map(kept.map((edge) => [edge, [edge]]));
  for (const number of new Set(kept.flatMap(({ sides }) => sides))) {
    const on = kept.filter(({ sides }) => sides.includes(number));
    if (number === body[0] || on.length !== 2 || on.some((edge) => edge.single || edge.line === null)) continue;
    const [one, two] = on.map((edge) => /** @type {Edge[]} */ (groups.get(edge)));
    if (one === two || !meet([...one, ...two], length)) continue;
    const merged = [...one, ...two];
    for (const edge of merged) groups.set(edge, merged);
  }
  return [...new Set(groups.values())].filter((group) => group.length === 3 && group.every((edge) => edge.tree >= 0))
    .map((group) => group.map((edge) => edge.tree).sort((a, b) => a - b));
}

const WORLD = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];

/**
 * Return whether the axes of revolute joints meet in one point.
 *
 * @param {Edge[]} edges
 * @param {number} length
 */
function meet(edges, length) {
  const lines = edges.map(({ line }) => line);
  if (lines.length === 0 || lines.includes(null)) return false;
  const across = /** @type {Line[]} */ (lines).map(({ axis }) => axis.map((a, i) => axis.map((b, j) => Number(i === j) - a * b)));
  const matrix = [0, 1, 2].map((i) => [0, 1, 2].map((j) => across.reduce((sum, one) => sum + one[i][j], 0)));
  const apply = (/** @type {number[][]} */ rows, /** @type {number[]} */ v) => rows.map((row) => row.reduce((sum, x, j) => sum + x * v[j], 0));
  const points = /** @type {Line[]} */ (lines).map(({ point }) => point);
  const right = across.map((one, k) => apply(one, points[k]));
  const sum = [0, 1, 2].map((i) => right.reduce((total, one) => total + one[i], 0));
  const { values, vectors } = eigen(matrix);
  if (!(Math.min(...values) > PARALLEL * Math.max(...values))) return false;
  const point = [0, 1, 2].map((i) => vectors.reduce((total, vector, k) => total + (vector[i] * vector.reduce((s, x, j) => s + x * sum[j], 0)) / values[k], 0));
  return across.every((one, k) => apply(one, point).every((x, i) => Math.abs(x - right[k][i]) < MEET * length));
}
