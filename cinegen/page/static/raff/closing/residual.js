// The residual of a loop, and its exact derivative by the twist of the second end relative to the first, in the first
// end's axes and at its origin: see raff2urdf/residual.py, which derives both.

import { dot } from "./linear_algebra.js";

/** @typedef {import("../kleinfinger.js").Placement} Placement */
/** @typedef {{ c: number[], derivative: number[][] }} Residual rows of six: by linear and angular velocity */

/**
 * @param {string} kind
 * @param {Placement} m of the second end in the first; m
 * @param {number} length characteristic length, m
 * @returns {Residual}
 */
export function loopResidual(kind, m, length) {
  const p = [m[3], m[7], m[11]];
  const linear = kind === "prismatic" ? 2 : 3;
  const cross = skew(p);
  /** @type {number[]} */
  const c = [];
  /** @type {number[][]} */
  const derivative = [];
  for (let i = 0; i < linear; i++) {
    c.push(p[i] / length);
    derivative.push([0, 1, 2].map((j) => Number(i === j) / length).concat(cross[i].map((x) => x / -length)));
  }
  if (kind === "ball") return { c, derivative };
  const { values, rows } = kind === "revolute" ? swing([m[2], m[6], m[10]]) : log(m);
  c.push(...values);
  derivative.push(...rows.map((row) => [0, 0, 0, ...row]));
  return { c, derivative };
}

/** @param {readonly number[]} v */
function skew([x, y, z]) {
  return [[0, -z, y], [z, 0, -x], [-y, x, 0]];
}

/**
 * The rotation vector of a placement, and its derivative by the angular velocity in fixed axes.
 *
 * @param {Placement} m
 */
function log([a, b, c, , d, e, f, , g, h, i]) {
  const squares = [a + e + i, a - e - i, e - a - i, i - a - e];
  const most = squares.indexOf(Math.max(...squares));
  let [w, x, y, z] = [
    [1 + squares[0], h - f, c - g, d - b],
    [h - f, 1 + squares[1], b + d, c + g],
    [c - g, b + d, 1 + squares[2], f + h],
    [d - b, c + g, f + h, 1 + squares[3]],
  ][most];
  if (w < 0) [w, x, y, z] = [-w, -x, -y, -z];
  const sine = Math.sqrt(x * x + y * y + z * z);
  const factor = sine > 0 ? (2 * Math.atan2(sine, w)) / sine : 0;
  const values = [factor * x, factor * y, factor * z];
  const t = Math.sqrt(dot(values, values));
  const square = t < 1e-2 ? 1 / 12 + (t * t) / 720 : 1 / (t * t) - 1 / (2 * t * Math.tan(t / 2));
  const s = skew(values);
  const rows = s.map((row, k) =>
    row.map((value, l) => Number(k === l) - value / 2 + square * (s[k][0] * s[0][l] + s[k][1] * s[1][l] + s[k][2] * s[2][l])),
  );
  return { values, rows };
}

/**
 * The rotation about x and y that takes z to an axis, and its derivative by the angular velocity.
 *
 * @param {number[]} axis
 */
function swing([x, y, z]) {
  const s = Math.hypot(x, y);
  const t = Math.atan2(s, z);
  if (s < 1e-9 && z < 0) return { values: [Math.PI, 0], rows: [[1, 0, 0], [0, 1, 0]] };
  const ratio = s > 1e-4 ? t / s : 1 + (s * s) / 6;
  const slope = s > 1e-4 ? (z - ratio) / (s * s) : -2 / 3;
  const byAxis = [[-y * slope * x, -y * slope * y - ratio, y], [x * slope * x + ratio, x * slope * y, -x]];
  const turned = skew([x, y, z]);
  const rows = byAxis.map((row) => [0, 1, 2].map((j) => -(row[0] * turned[0][j] + row[1] * turned[1][j] + row[2] * turned[2][j])));
  return { values: [-ratio * y, ratio * x], rows };
}
