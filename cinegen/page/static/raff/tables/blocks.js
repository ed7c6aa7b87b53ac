// The order of a large cluster, which is factored block by block: see `_set_up_blocks` in cinegen/loops/arrays.py.

/** Velocities of a cluster beyond which it is large. */
export const LARGE = 64;

/**
 * Order a large cluster so that loops that share joints are neighbours, and joints as they first occur.
 *
 * @param {Map<number, number[]>} columns of each loop and coupling
 * @param {(member: number) => number[]} rowsOf
 * @param {number} rank
 */
export function blocksOf(columns, rowsOf, rank) {
  const members = chained(columns);
  const dof = [...new Set(members.flatMap((i) => columns.get(i) ?? []))];
  const place = new Map(dof.map((k, j) => [k, j]));
  const reached = members.map((i) => {
    const places = (columns.get(i) ?? []).map((k) => place.get(k) ?? 0);
    return places.length > 0 ? places : [0];
  });
  const heights = members.map((i) => rowsOf(i).length);
  let row = 0;
  return {
    blocks: members.length, block_ends: members.length + 1, kept: rank, dof, row: members.flatMap(rowsOf),
    block_row: [0, ...heights.map((height) => (row += height))],
    block_end: reached.map((places) => Math.max(...places) + 1),
    row_first: reached.flatMap((places, i) => new Array(heights[i]).fill(Math.min(...places))),
  };
}

/**
 * Return the keys so that those that share columns are near each other: breadth first, from one as far out as possible
 * (E. Cuthill and J. McKee, "Reducing the bandwidth of sparse symmetric matrices", 1969).
 *
 * @param {Map<number, number[]>} columns
 */
function chained(columns) {
  /** @type {Map<number, number[]>} */
  const users = new Map();
  for (const [key, own] of columns) for (const k of own) users.set(k, [...(users.get(k) ?? []), key]);
  const outwards = (/** @type {number} */ start) => {
    const found = new Set([start]); // in the order of insertion, while it grows
    for (const key of found) for (const k of columns.get(key) ?? []) for (const other of users.get(k) ?? []) found.add(other);
    return [...found];
  };
  const [first] = columns.keys();
  return outwards(/** @type {number} */ (outwards(first).at(-1)));
}
