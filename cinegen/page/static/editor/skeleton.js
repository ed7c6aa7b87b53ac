// Shapes of bodies that have no graphics, from their Kleinfinger parameters: those of raff2urdf/graphics/skeleton.py.

const BRANCHES = [0x295970, 0xa88c59, 0xa89ed4, 0x6bbab0, 0x784a29, 0x63544c];
const BASE = 0x737880;
const JOINT = 0x333840;

/** @typedef {import("./reading.js").Model} Model */
/** @typedef {Model["bodies"][number]} Body */
/** @typedef {[number, number, number]} Point */
/** @typedef {import("../raff/kleinfinger.js").Placement} Placement */
/**
 * A cylinder along z (radius, length), a sphere (radius) or a box (three sides), m, in its body's frame.
 *
 * @typedef {{ kind: "cylinder" | "sphere" | "box", size: number[], placement: Placement, colour: number }} Shape
 */

/**
 * Return the shapes of each body of a robot.
 *
 * @param {Model} model
 * @returns {Shape[][]}
 */
export function skeletonOf({ bodies, joints }) {
  const radius = 0.06 * typical(bodies);
  /** @type {number[][]} */
  const children = bodies.map(() => []);
  for (const [i, { parent }] of bodies.entries()) if (parent >= 0) children[parent].push(i);
  const colours = coloursOf(bodies, children);
  return bodies.map((body, i) => {
    const style = { radius, colour: colours[i] };
    const shapes = [...jointOf(body, joints, style)];
    for (const child of children[i]) shapes.push(...barsTo(bodies[child], joints, style));
    if (shapes.length === 0 && !body.isFrame) shapes.push(ball([0, 0, 0], 1.2, style));
    return shapes;
  });
}

/** @typedef {{ radius: number, colour: number }} Style radius of a bar, m */

/**
 * Return the median length of a robot's straight parts, m; 1 if it has none.
 *
 * @param {Body[]} bodies
 */
function typical(bodies) {
  const lengths = bodies
    .filter(({ parent }) => parent >= 0)
    .flatMap(({ parameters: { epsilon, d, r } }) => [epsilon, d, r].map(Math.abs))
    .filter((one) => one > 1e-12)
    .sort((a, b) => a - b);
  const { length } = lengths;
  return length === 0 ? 1 : (lengths[Math.floor((length - 1) / 2)] + lengths[Math.floor(length / 2)]) / 2;
}

/**
 * Return the colours of bodies: every fork begins a branch of another one.
 *
 * @param {Body[]} bodies
 * @param {number[][]} children
 */
function coloursOf(bodies, children) {
  const root = bodies.findIndex(({ parent }) => parent < 0);
  const branch = new Map([[root, 0]]);
  let last = 0;
  const pending = [...children[root]].reverse();
  for (let i = pending.pop(); i !== undefined; i = pending.pop()) {
    const { parent } = bodies[i];
    const forks = children[parent][0] !== i;
    if (forks) last += 1;
    branch.set(i, forks ? last : /** @type {number} */ (branch.get(parent)));
    pending.push(...[...children[i]].reverse());
  }
  return bodies.map((_, i) => (i === root ? BASE : BRANCHES[(branch.get(i) ?? 0) % BRANCHES.length]));
}

/**
 * Yield the marker of a body's own joint.
 *
 * @param {Body} body
 * @param {Model["joints"]} joints
 * @param {Style} style
 * @returns {Generator<Shape>}
 */
function* jointOf({ joint, ofSeveral }, joints, style) {
  const { radius } = style;
  const marker = { radius, colour: JOINT };
  const slides = joint >= 0 && joints[joint].type === "prismatic";
  if (ofSeveral && !slides) {
    yield ball([0, 0, 0], 2, marker);
  } else if (slides) {
    const placement = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
    yield { kind: "box", size: [2.6 * radius, 2.6 * radius, 3.2 * radius], placement, colour: JOINT };
    yield* bar([0, 0, -0.62 * joints[joint].home], [0, 0, 0], 0.6, style);
  } else if (joint >= 0) {
    yield* bar([0, 0, -1.6 * radius], [0, 0, 1.6 * radius], 1.5, marker);
  }
}

/**
 * Yield bars from a body's origin to the joint of a child: along its path, straight to what is fixed.
 *
 * @param {Body} child
 * @param {Model["joints"]} joints
 * @param {Style} style
 * @returns {Generator<Shape>}
 */
function* barsTo({ parameters: { gamma, epsilon, alpha, d, r }, joint, isFrame }, joints, style) {
  const thickness = isFrame ? 0.6 : 1;
  const slides = joint >= 0 && joints[joint].type === "prismatic";
  /** @type {Point} */
  const axis = [Math.sin(gamma) * Math.sin(alpha), -Math.cos(gamma) * Math.sin(alpha), Math.cos(alpha)];
  /** @type {Point} */
  const knee = [d * Math.cos(gamma), d * Math.sin(gamma), epsilon];
  /** @type {Point[]} */
  const path = [[0, 0, epsilon], knee, ...(slides ? [] : [along(knee, axis, r)])];
  const end = path[path.length - 1];
  /** @type {Point[]} */
  const drawn = [[0, 0, 0]];
  for (const corner of joint < 0 ? [end] : path) {
    const before = drawn[drawn.length - 1];
    if (!(Math.max(...corner.map((x, k) => Math.abs(x - before[k]))) > 0.5 * style.radius)) continue;
    yield* bar(before, corner, thickness, style);
    drawn.push(corner);
  }
  for (const corner of drawn.slice(1, -1)) yield ball(corner, thickness, style);
  if (slides) yield* bar(end, along(end, axis, 0.55 * r), 1, style);
}

/**
 * @param {Point} point
 * @param {Point} axis
 * @param {number} length
 * @returns {Point}
 */
function along([x, y, z], axis, length) {
  return [x + length * axis[0], y + length * axis[1], z + length * axis[2]];
}

/**
 * Yield a cylinder from one point to another; nothing if they coincide.
 *
 * @param {Point} start
 * @param {Point} end
 * @param {number} thickness
 * @param {Style} style
 * @returns {Generator<Shape>}
 */
function* bar(start, end, thickness, { radius, colour }) {
  const vector = end.map((x, k) => x - start[k]);
  const length = Math.hypot(...vector);
  if (length < 1e-6 * radius) return;
  const z = vector.map((x) => x / length);
  const aside = Math.abs(z[0]) < 0.6 ? [1, 0, 0] : [0, 1, 0];
  const across = cross(z, aside);
  const size = Math.hypot(...across);
  const y = across.map((one) => one / size);
  const x = cross(y, z);
  const placement = [0, 1, 2].flatMap((k) => [x[k], y[k], z[k], (start[k] + end[k]) / 2]);
  yield { kind: "cylinder", size: [thickness * radius, length], placement, colour };
}

/**
 * @param {Point} centre
 * @param {number} thickness
 * @param {Style} style
 * @returns {Shape}
 */
function ball([x, y, z], thickness, { radius, colour }) {
  return { kind: "sphere", size: [thickness * radius], placement: [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z], colour };
}

/**
 * @param {number[]} a
 * @param {number[]} b
 */
function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}
