// Kleinfinger's six parameters as four frames: T = Rz(gamma) Tz(epsilon) Rx(alpha) Tx(d) Rz(theta) Tz(r).

/** @typedef {[number, number, number]} Vector */
/** @typedef {{ gamma: number, epsilon: number, alpha: number, d: number, theta: number, r: number }} Parameters degrees, mm */
/** @typedef {{ origin: Vector, x: Vector, y: Vector, z: Vector }} Frame origin and directions in the parent's axes */

const DEGREE = Math.PI / 180;

/** a + k b
 * @param {Vector} a @param {Vector} b @param {number} [k] @returns {Vector} */
export function plus(a, b, k = 1) {
  return [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
}

/** @param {Vector} a @param {Vector} b @returns {number} */
export function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** @param {Vector} a @param {Vector} b @returns {Vector} */
export function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** A vector rotated about a unit vector; the angle is in degrees.
 * @param {Vector} vector @param {Vector} axis @param {number} angle @returns {Vector} */
export function rotated(vector, axis, angle) {
  const c = Math.cos(angle * DEGREE), s = Math.sin(angle * DEGREE);
  const along = plus([0, 0, 0], axis, (1 - c) * dot(axis, vector));
  return plus(plus(along, vector, c), cross(axis, vector), s);
}

/** The parent's frame F0, F1 after gamma and epsilon, F2 after alpha and d, and the link's, F3.
 * @param {Parameters} p @returns {[Frame, Frame, Frame, Frame]} */
export function frames(p) {
  /** @type {Frame} */
  const first = { origin: [0, 0, 0], x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };
  const second = aboutZ(first, p.gamma, p.epsilon);
  const y = rotated(second.y, second.x, p.alpha), z = rotated(second.z, second.x, p.alpha);
  const third = { origin: plus(second.origin, second.x, p.d), x: second.x, y, z };
  return [first, second, third, aboutZ(third, p.theta, p.r)];
}

/** @param {Frame} frame @param {number} angle @param {number} along @returns {Frame} */
function aboutZ(frame, angle, along) {
  const { origin, x, y, z } = frame;
  return { origin: plus(origin, z, along), x: rotated(x, z, angle), y: rotated(y, z, angle), z };
}

/** The rows of the homogeneous matrix of the parameters.
 * @param {Parameters} p @returns {number[][]} */
export function transform(p) {
  const { origin, x, y, z } = frames(p)[3];
  return [0, 1, 2].map((k) => [x[k], y[k], z[k], origin[k]]).concat([[0, 0, 0, 1]]);
}
