// The loops of a model: joints that were cut, between joints of its tree.

import { loopKinds, rows as rowsOfKinds } from "../definitions.js";
import { times } from "../kleinfinger.js";
import { frameOf } from "./tree.js";

const LOOP_KINDS = ["rigid", "prismatic", "revolute", "ball"]; // in the kernels' order

/** @typedef {import("../kleinfinger.js").Placement} Placement */
/**
 * A loop: its first row, the joints of the tree that carry its ends (-1 for the world), the placements of the ends on
 * them, what moves them against each other, and the degrees of freedom of the joint that was cut. `end` returns the
 * placement of the first end, given that of its joint.
 *
 * @typedef {{ kind: string, row: number, rows: number, first: number, second: number, offsets: [Placement, Placement],
 *   signs: number[], cut: number, end: (at: Placement) => Placement }} Loop
 */

/**
 * @param {import("../model.js").Model} model
 * @param {import("./tree.js").JointTree} tree
 * @returns {Loop[]}
 */
export function loopsOf({ loops }, tree) {
  let row = 0;
  return loops.map(({ kind, first, second }) => {
    const rows = rowsOfKinds[loopKinds.indexOf(kind)];
    const ends = [tree.bodies[first], tree.bodies[second]];
    row += rows;
    return {
      kind, row: row - rows, rows, first: ends[0].on, second: ends[1].on, offsets: /** @type {[Placement, Placement]} */ (ends.map(({ at: own }) => own)),
      signs: tree.signs(first, second), cut: 6 - rows, end: (on) => times(on, ends[0].at),
    };
  });
}

/**
 * Return the joints of the tree that change a loop.
 *
 * @param {Loop} loop
 */
export function columnsOf({ signs }) {
  return [...signs.keys()].filter((k) => signs[k] !== 0);
}

/**
 * @param {Loop[]} loops
 * @param {number[]} scale
 */
export function loopTables(loops, scale) {
  const columns = loops.map(columnsOf);
  let [step, cut] = [0, 0];
  return {
    loops: loops.length, loop_kind: loops.map(({ kind }) => LOOP_KINDS.indexOf(kind)),
    loop_joints: loops.flatMap(({ first, second }) => [first + 1, second + 1]),
    loop_offsets: loops.flatMap(({ offsets }) => offsets.flatMap(frameOf)),
    loop_row: loops.map(({ row }) => row), loop_cut: loops.map((loop) => (cut += loop.cut) - loop.cut),
    loop_steps: columns.flatMap((own) => [step, (step += own.length)]),
    steps: step, step_dof: columns.flat(), step_size: columns.flatMap((own, i) => own.map((k) => loops[i].signs[k] * scale[k])),
  };
}
