// The characteristic length of a mechanism: see raff2urdf/length.py, which defines it and gives the reasons.

import { cross, dot, eigen } from "./linear_algebra.js";

const EXTENT = Math.sqrt(3);
const PARALLEL = [1e-4, 1e-2];
const SMALL = [1e-3, 0.1];
const POINT = 1e-15; // m: a robot no larger than this is a point

/**
 * A unit twist: the velocity of the point at the origin, and the angular velocity.
 *
 * @typedef {{ v: number[], w: number[] }} Screw
 */

/**
 * The unit twists of a joint that was cut, or of another one, at a placement.
 *
 * @param {string} kind
 * @param {import("../kleinfinger.js").Placement} placement
 * @returns {Screw[]}
 */
export function screwsOf(kind, placement) {
  const z = [placement[2], placement[6], placement[10]];
  const point = [placement[3], placement[7], placement[11]];
  if (kind === "rigid") return [];
  if (kind === "prismatic") return [{ v: z, w: [0, 0, 0] }];
  const axes = kind === "ball" ? [[1, 0, 0], [0, 1, 0], [0, 0, 1]] : [z];
  return axes.map((w) => ({ v: cross(point, w), w }));
}

/**
 * The characteristic length, m; 1 for a robot that is a point.
 *
 * @param {Screw[]} screws of all joints that move, cut ones included
 * @param {number[][]} points origins of the nodes
 * @param {boolean[][]} moves whether a joint (second index) moves a node (first)
 */
export function characteristicLength(screws, points, moves) {
  const turning = screws.map((_, i) => i).filter((i) => screws[i].w.some((x) => x !== 0));
  const rotations = turning.map((i) => screws[i]);
  const middle = [0, 1, 2].map((k) => points.reduce((sum, point) => sum + point[k], 0) / points.length);
  const about = centre(rotations, middle);
  const length = EXTENT * spread(rotations, about);
  const apart = (/** @type {number[]} */ point) => Math.max(...points.map((other) => norm(minus(other, point))));
  const outermost = rotations.reduce((most, one) => Math.max(most, norm(moment(one, about))), 0);
  const result = length < 2 * SMALL[1] * (outermost + apart(about)) ? scaleOf(length, scaleOf(arm(), extent())) : length;
  return result > POINT ? result : 1;

  function arm() {
    let most = 0;
    for (const [i, point] of points.entries()) {
      for (const [k, j] of turning.entries()) if (moves[i][j]) most = Math.max(most, norm(moment(rotations[k], point)));
    }
    return most;
  }
  function extent() {
    return 0.5 * Math.max(...points.map(apart));
  }
}

/**
 * @param {Screw[]} rotations
 * @param {number[]} near
 */
export function centre(rotations, near) {
  const total = rotations.reduce((sum, { w }) => sum + dot(w, w), 0);
  const matrix = [0, 1, 2].map((i) =>
    [0, 1, 2].map((j) => (i === j ? total : 0) - rotations.reduce((sum, { w }) => sum + w[i] * w[j], 0)),
  );
  const right = matrix.map((row, i) => rotations.reduce((sum, { v, w }) => sum + cross(w, v)[i], 0) - dot(row, near));
  const found = [...near];
  const { values, vectors } = eigen(matrix);
  for (const [k, vector] of vectors.entries()) {
    const part = (ramp(values[k], PARALLEL) / Math.max(values[k], PARALLEL[0])) * dot(vector, right);
    for (let i = 0; i < 3; i++) found[i] += part * vector[i];
  }
  return found;
}

/**
 * Root mean square distance of axes from a point.
 *
 * @param {Screw[]} rotations
 * @param {number[]} about
 */
export function spread(rotations, about) {
  const total = rotations.reduce((sum, { w }) => sum + dot(w, w), 0);
  const squares = rotations.reduce((sum, one) => sum + norm(moment(one, about)) ** 2, 0);
  return total > 0 ? Math.sqrt(squares / total) : 0;
}

/**
 * @param {Screw} screw
 * @param {number[]} about
 */
function moment({ v, w }, about) {
  return cross(w, about).map((x, i) => v[i] + x);
}

/**
 * A length, or another where it is far smaller than that, and smoothly what lies between.
 *
 * @param {number} length
 * @param {number} other
 */
export function scaleOf(length, other) {
  if (!(length > SMALL[0] * other)) return other;
  if (!(length < SMALL[1] * other)) return length;
  const known = ramp(Math.log(length / other), SMALL.map(Math.log));
  return length ** known * other ** (1 - known);
}

/**
 * @param {number} x
 * @param {number[]} range
 */
function ramp(x, [low, high]) {
  const t = Math.min(1, Math.max(0, (x - low) / (high - low)));
  return t * t * (3 - 2 * t);
}

/** @param {number[]} vector */
function norm(vector) {
  return Math.sqrt(dot(vector, vector));
}

/**
 * @param {number[]} a
 * @param {number[]} b
 */
function minus(a, b) {
  return a.map((x, i) => x - b[i]);
}
