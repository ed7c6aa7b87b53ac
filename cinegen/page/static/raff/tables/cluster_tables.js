// The tables of a cluster: loops and couplings that share joints.

import { blocksOf, LARGE } from "./blocks.js";
import { columnsOf } from "./loops.js";

/** @typedef {import("./loops.js").Loop} Loop */

/**
 * @param {import("../closing/cluster.js").Cluster} cluster
 * @param {number} rank of its equations
 * @param {Loop[]} loops of the robot
 * @param {import("./tree.js").JointTree} tree
 */
export function clusterTables(cluster, rank, loops, tree) {
  const couplings = loops.reduce((sum, one) => sum + one.rows, 0); // first row of them
  const rowsOf = (/** @type {number} */ member) => {
    if (member >= loops.length) return [couplings + member - loops.length];
    const { row, rows } = loops[member];
    return Array.from({ length: rows }, (_, k) => row + k);
  };
  /** @type {Map<number, number[]>} of each loop, and then each coupling */
  const columns = new Map(cluster.loops.map((i) => [i, columnsOf(loops[i])]));
  for (const i of cluster.couplings) columns.set(loops.length + i, cluster.model.couplings[i].terms.map(({ joint }) => tree.at(joint)));
  const dof = [...new Set([...columns.values()].flat())].sort((a, b) => a - b);
  const row = [...columns.keys()].flatMap(rowsOf);
  const tables = { n: dof.length, rows: row.length, rank, mobility: Math.max(dof.length - rank, 0), dof, row };
  if (tables.n > LARGE) return { ...tables, ...blocksOf(columns, rowsOf, rank) };
  return { ...tables, basis: tables.mobility, ...cutRange(cluster.loops, loops) };
}

/**
 * Return the range of the velocities of cut joints that has all those of some loops.
 *
 * @param {number[]} members
 * @param {Loop[]} loops
 * @returns {Record<string, number>}
 */
function cutRange(members, loops) {
  const begins = loops.map((_, i) => loops.slice(0, i).reduce((sum, { cut }) => sum + cut, 0));
  const some = members.filter((i) => loops[i].cut > 0);
  if (some.length === 0) return {};
  const [first, last] = [some[0], some[some.length - 1]];
  return { cut_first: begins[first], cut: begins[last] + loops[last].cut - begins[first] };
}
