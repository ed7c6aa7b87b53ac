// Mass, centre and inertia matrix of bodies, and which numbers no body can have.

import { limits, texts } from "./definitions.js";
import { eigen } from "./closing/linear_algebra.js";
import { fill } from "./texts.js";

/** @typedef {import("./document.js").Document} Document */
/** @typedef {import("./document.js").Inertial} Inertial */
/** @typedef {import("./document.js").Vector} Vector */

/**
 * Mass (kg), centre of mass (m), and inertia matrix about the centre (kg m2), in the body's own axes.
 *
 * @typedef {{ mass: number, centre: Vector, matrix: [Vector, Vector, Vector] }} Inertia
 */

/**
 * A stated mass with its centre and moments, in the node's own frame.
 *
 * @param {Document} document
 * @param {Inertial} inertial
 * @returns {Inertia}
 */
export function statedInertia(document, inertial) {
  const squared = (/** @type {number} */ value) => document.metres(document.metres(value));
  const [xx, yy, zz] = inertial.moments.map(squared);
  const [xy, xz, yz] = inertial.products.map(squared);
  const [x, y, z] = inertial.centre.map((value) => document.metres(value));
  return { mass: inertial.mass ?? 0, centre: [x, y, z], matrix: [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]] };
}

/**
 * The largest number of each statement of an inertial in SI units.
 *
 * @param {Document} document
 * @param {Inertial} inertial
 * @returns {[string, number][]}
 */
export function sizes(document, inertial) {
  const most = (/** @type {number[]} */ vector) => Math.max(...vector.map(Math.abs));
  return [
    ["mass", Math.abs(inertial.mass ?? 0)],
    ["density", Math.abs(inertial.density ?? 0)],
    ["radius", document.metres(Math.abs(inertial.radius ?? 0))],
    ["centre", document.metres(most(inertial.centre))],
    ["moments", document.metres(document.metres(most(inertial.moments)))],
    ["products", document.metres(document.metres(most(inertial.products)))],
  ];
}

/**
 * The location of a statement of an inertial, or that of the inertial.
 *
 * @param {Inertial | null} inertial
 * @param {string} word
 */
export function placeOf(inertial, word) {
  return inertial?.locations.get(word) ?? inertial?.locations.get("inertial");
}

/**
 * The rule that the numbers break, which those of every body obey; null if they may be a body's.
 *
 * The mass is not negative, and without mass there are no moments. The principal moments are not negative, and none is
 * larger than the sum of the two others, up to rounding.
 *
 * @param {Inertia} inertia
 */
export function whyUnphysical({ mass, matrix }) {
  const [a, b, c] = eigen(matrix).values.sort((x, y) => x - y);
  const most = Math.max(Math.abs(a), Math.abs(c));
  const tolerance = limits.rounded * most;
  if (mass < 0) return fill(texts.MASS_NEGATIVE, { mass });
  if (mass === 0 && most > 0) return fill(texts.MOMENTS_WITHOUT_MASS, { moment: most });
  if (a < -tolerance) return fill(texts.MOMENT_NEGATIVE, { moment: a });
  if (a + b < c - tolerance) return fill(texts.MOMENT_TOO_LARGE, { moment: c, least: a, middle: b });
  return null;
}
