// Closing loops, their rank, and which joints they determine: see raff2urdf/closure.py, whose algorithms these are.

import { dot, largest, svd } from "./linear_algebra.js";

/** @typedef {import("./cluster.js").Cluster} Cluster */
/** @typedef {{ q: number[], gap: number }} Closing the best configuration met, and its largest residual */

export const CLOSED = 1e-12; // rad or characteristic lengths
const ROUNDING = 2e-15;
const STEP_CAP = 0.6;
const RANK = 1e-6;
const NOTHING = 1e-9;
const WALK = 0.3;

/**
 * Close loops from a configuration, by damped Gauss-Newton steps.
 *
 * @param {Cluster} system
 * @param {number[]} start
 * @param {boolean[]} free which joints may move
 * @returns {Closing}
 */
export function close(system, start, free = start.map(() => true), iterations = 100) {
  let q = start;
  let { c, jacobian } = system.evaluate(q);
  let gap = largest(c);
  let damping = 1;
  for (let i = 0; i < iterations && gap > ROUNDING && free.includes(true); i++) {
    const there = system.integrate(q, stepOf(jacobian, c, damping * dot(c, c), free));
    const next = system.evaluate(there);
    if (dot(next.c, next.c) < dot(c, c)) {
      const before = gap;
      gap = largest(next.c);
      [q, c, jacobian] = [there, next.c, next.jacobian];
      damping = Math.max(damping * 0.1, 1e-4);
      if (gap <= 0.1 * CLOSED && gap > 0.25 * before) break; // nothing but rounding is left
    } else if (gap <= CLOSED || damping > 1e12) {
      break;
    } else {
      damping *= 10;
    }
  }
  return { q, gap };
}

/**
 * @param {number[][]} jacobian
 * @param {number[]} c
 * @param {number} damping
 * @param {boolean[]} free
 */
function stepOf(jacobian, c, damping, free) {
  const step = free.map(() => 0);
  const columns = step.map((_, i) => i).filter((i) => free[i]);
  const { values, left, right } = svd(jacobian.map((row) => columns.map((i) => row[i])));
  const least = 1e-10 * Math.max(...values, 1e-300);
  for (const [k, s] of values.entries()) {
    if (s <= least) continue;
    const along = (-s / (s * s + damping)) * dot(left[k], c);
    for (const [j, i] of columns.entries()) step[i] += along * right[k][j];
  }
  const factor = Math.min(1, STEP_CAP / Math.max(largest(step), 1e-300));
  return step.map((x) => x * factor);
}

/**
 * Close loops; where that fails, again from up to twelve random configurations ever further away.
 *
 * @param {Cluster} system
 * @param {number[]} q
 */
export function closeFromAfar(system, q) {
  let best = close(system, q);
  const normal = normals(1);
  for (let attempt = 0; attempt < 12 && best.gap > CLOSED; attempt++) {
    const one = close(system, system.integrate(q, q.map(() => normal() * 0.1 * (1 + attempt))));
    if (one.gap < best.gap) best = one;
  }
  return best;
}

/**
 * A closed configuration within the limits, or the given one where none is found: joints beyond a limit are put on it and
 * kept there while the others close the loops, up to three times.
 *
 * @param {Cluster} system
 * @param {number[]} closed
 */
export function closeWithin(system, closed) {
  const bounds = system.joints.map((i) => system.model.joints[i]);
  const free = closed.map(() => true);
  let q = closed;
  for (let i = 0; i < 3; i++) {
    const outside = q.map((value, k) => value < bounds[k].lower || value > bounds[k].upper);
    if (!outside.includes(true)) return q;
    outside.forEach((is, k) => (free[k] &&= !is));
    const clipped = q.map((value, k) => Math.min(bounds[k].upper, Math.max(bounds[k].lower, value)));
    const closing = close(system, clipped, free);
    if (closing.gap > CLOSED) break;
    q = closing.q;
  }
  return closed;
}

/**
 * The number of independent rows of a Jacobian.
 *
 * @param {number[][]} jacobian
 */
export function rankOf(jacobian, threshold = RANK) {
  const { values } = svd(jacobian);
  const least = Math.max(threshold * Math.max(0, ...values), NOTHING);
  return values.filter((value) => value > least).length;
}

/**
 * The largest rank on random closed configurations around a closed one, which may be singular itself, where it is
 * reached, and those that were met.
 *
 * @param {Cluster} system
 * @param {number[]} q
 */
export function genericRank(system, q) {
  let found = { rank: rankOf(system.evaluate(q).jacobian), q };
  /** @type {number[][]} */
  const met = [];
  for (let walk = 0; walk < 8; walk++) {
    let isClear = true;
    for (const there of closedWalk(system, q, 5, walk + 2)) {
      met.push(there);
      const { jacobian } = system.evaluate(there);
      const rank = rankOf(jacobian);
      if (rank > found.rank) found = { rank, q: there };
      isClear &&= rankOf(jacobian, 1e-2 * RANK) === rankOf(jacobian, 1e2 * RANK);
    }
    if (isClear) break;
  }
  return { ...found, met };
}

/**
 * Yield random closed configurations: a walk along the directions that the loops leave free.
 *
 * @param {Cluster} system
 * @param {number[]} q
 * @param {number} samples
 * @param {number} seed
 */
function* closedWalk(system, q, samples, seed) {
  const normal = normals(seed);
  for (let i = 0; i < samples; i++) {
    const { jacobian } = system.evaluate(q);
    const { values, right } = svd(jacobian);
    const least = RANK * Math.max(0, ...values);
    for (let attempt = 0; attempt < 8; attempt++) {
      let step = q.map(normal);
      for (const [k, value] of values.entries()) {
        if (value <= least) continue;
        const along = dot(right[k], step);
        step = step.map((x, j) => x - along * right[k][j]);
      }
      const size = largest(step);
      if (size <= 1e-6) return; // nothing can move
      const ahead = system.integrate(q, step.map((x) => (x * WALK * (1 + 0.5 * attempt)) / size));
      const there = close(system, ahead);
      if (there.gap > CLOSED || apart(there.q, q) < 0.2 * apart(ahead, q)) continue;
      q = there.q;
      yield q;
      break;
    }
  }
}

/**
 * The first columns in an order that are independent: passive joints, which the others determine.
 *
 * @param {number[][]} jacobian
 * @param {number[]} order
 */
export function passive(jacobian, order) {
  const total = rankOf(jacobian);
  /** @type {number[][]} */
  const basis = [];
  return order.filter((column) => {
    if (basis.length === total) return false;
    let v = jacobian.map((row) => row[column]);
    const size = Math.sqrt(dot(v, v));
    for (const one of [...basis, ...basis]) {
      const along = dot(one, v);
      v = v.map((x, i) => x - along * one[i]);
    }
    const remainder = Math.sqrt(dot(v, v));
    if (!(remainder > 1e-6 * size)) return false;
    basis.push(v.map((x) => x / remainder));
    return true;
  });
}

/**
 * @param {number[]} a
 * @param {number[]} b
 */
function apart(a, b) {
  return largest(a.map((x, i) => x - b[i]));
}

/**
 * Return a function that returns normally distributed numbers, the same ones for a seed.
 *
 * @param {number} seed
 */
export function normals(seed) {
  let state = seed;
  const uniform = () => (state = (state * 48271) % 2147483647) / 2147483647; // Park and Miller
  for (let i = 0; i < 10; i++) uniform();
  return () => Math.sqrt(-2 * Math.log(uniform())) * Math.cos(2 * Math.PI * uniform());
}
