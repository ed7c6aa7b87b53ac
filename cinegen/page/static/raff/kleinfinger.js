// Kleinfinger's six parameters in metres and radians, and the transform that they define (W. Khalil and J.-F. Kleinfinger,
// "A new geometric notation for open and closed-loop robots", 1986): from parent to link
//
//     T = Rz(gamma) Tz(epsilon) Rx(alpha) Tx(d) Rz(theta) Tz(r)

/** @typedef {import("./document.js").Document} Document */
/** @typedef {import("./document.js").Parameters} Parameters */

/** @typedef {Readonly<Parameters>} Kleinfinger lengths in m, angles in rad */

/**
 * A placement: the first three rows of a homogeneous matrix, row by row; metres.
 *
 * @typedef {readonly number[]} Placement
 */

const RADIANS = Math.PI / 180;

/** @type {Placement} */
export const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];

/** @param {number} degrees */
export function radians(degrees) {
  return degrees * RADIANS;
}

/**
 * Six parameters as written, in metres and radians.
 *
 * @param {Document} document
 * @param {Parameters} written
 * @returns {Kleinfinger}
 */
export function kleinfinger(document, written) {
  return {
    gamma: radians(written.gamma),
    epsilon: document.metres(written.epsilon),
    alpha: radians(written.alpha),
    d: document.metres(written.d),
    theta: radians(written.theta),
    r: document.metres(written.r),
  };
}

/**
 * @param {Kleinfinger} parameters
 * @returns {Placement}
 */
export function transform({ gamma, epsilon, alpha, d, theta, r }) {
  const [cg, sg] = [Math.cos(gamma), Math.sin(gamma)];
  const [ca, sa] = [Math.cos(alpha), Math.sin(alpha)];
  const [ct, st] = [Math.cos(theta), Math.sin(theta)];
  return [
    cg * ct - sg * ca * st, -cg * st - sg * ca * ct, sg * sa, d * cg + r * sg * sa,
    sg * ct + cg * ca * st, -sg * st + cg * ca * ct, -cg * sa, d * sg - r * cg * sa,
    sa * st, sa * ct, ca, epsilon + r * ca,
  ];
}

/**
 * The product of two placements.
 *
 * @param {Placement} a
 * @param {Placement} b
 * @returns {Placement}
 */
export function times(a, b) {
  const found = new Array(12);
  for (let i = 0; i < 12; i += 4) {
    for (let j = 0; j < 4; j++) {
      found[i + j] = a[i] * b[j] + a[i + 1] * b[4 + j] + a[i + 2] * b[8 + j] + (j === 3 ? a[i + 3] : 0);
    }
  }
  return found;
}
