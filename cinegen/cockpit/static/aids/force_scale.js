// The scale of arrows of forces.

const SIZE = 0.4; // characteristic lengths: an arrow of the largest round force

/** @typedef {import("../base/messages").ReactionReport} ReactionReport */

/** Return the amount of the force of a reaction (N), as far as it is determined. @param {ReactionReport} reaction */
export function sizeOf({ force }) {
  return force === null ? 0 : Math.hypot(...force);
}

/**
 * Return a round force, 1, 2 or 5 times a power of ten, which no force exceeds, and the length of its arrow.
 * @param {readonly ReactionReport[]} reactions
 * @param {number} length characteristic length of the robot (m)
 */
export function scaleOf(reactions, length) {
  const largest = Math.max(0, ...reactions.map(sizeOf));
  const metres = SIZE * length;
  if (!(largest > 1e-9)) return { newtons: 0, metres };
  const power = 10 ** Math.floor(Math.log10(largest));
  const newtons = power * ([1, 2, 5, 10].find((round) => round * power >= largest) ?? 10);
  return { newtons, metres };
}
