// The plane in which a robot of a text moves, as cinegen/model/motion_plane.py finds it. Axes that are parallel at home stay
// so, whatever parallel joints do: one configuration is enough.

const PARALLEL = 1e-9;

/** @typedef {import("./reading.js").Model} Model */
/** @typedef {[number, number, number]} Axis */

/**
 * Return the unit normal of the plane in which all points move; null for a robot that moves in space, or not at all. If all
 * joints are prismatic, and parallel, it is some normal perpendicular to them.
 *
 * @param {Model} model
 * @param {ReturnType<typeof import("./placements.js").placements>} placed placements of its bodies
 * @returns {Axis | null}
 */
export function motionPlane({ bodies, joints }, placed) {
  const axes = joints.map(({ body, type }) => {
    const m = /** @type {import("../raff/kleinfinger.js").Placement} */ (placed.get(bodies[body]));
    return { turns: type !== "prismatic", axis: /** @type {Axis} */ ([m[2], m[6], m[10]]) };
  });
  const [turning, sliding] = [true, false].map((turns) => axes.filter((one) => one.turns === turns).map(({ axis }) => axis));
  const normal = turning[0] ?? (sliding.length > 0 ? acrossAll(sliding) : null);
  if (normal === null) return null;
  const flat = turning.every((axis) => size(cross(normal, axis)) <= PARALLEL) && sliding.every((axis) => Math.abs(dot(normal, axis)) <= PARALLEL);
  return flat ? normal : null;
}

/**
 * Return a unit vector that is perpendicular to the first axis, and to the first that is not parallel to it.
 *
 * @param {Axis[]} axes at least one
 * @returns {Axis}
 */
function acrossAll([first, ...others]) {
  const aside = /** @type {Axis} */ (Math.abs(first[2]) < 0.9 ? [0, 0, 1] : [0, 1, 0]);
  const other = others.find((axis) => size(cross(first, axis)) > PARALLEL) ?? aside;
  const normal = cross(first, other);
  return /** @type {Axis} */ (normal.map((x) => x / size(normal)));
}

/**
 * @param {Axis} a
 * @param {Axis} b
 * @returns {Axis}
 */
function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/**
 * @param {Axis} a
 * @param {Axis} b
 */
function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** @param {Axis} a */
function size(a) {
  return Math.hypot(...a);
}
