// Couplings as equations between joints in radians and metres.

import { driveKinds } from "./definitions.js";
import { FIXED, jointOf, PRISMATIC } from "./document.js";
import { radians } from "./kleinfinger.js";
import { significant } from "./texts.js";

/** @typedef {import("./document.js").Document} Document */
/** @typedef {import("./document.js").Link} Link */
/** @typedef {import("./document.js").Robot} Robot */

/**
 * The equation sum_i c_i1 q_i + c_i2 q_i^2 + ... = constant, rad and m, also as text; the joint of the first term follows.
 *
 * @typedef {{ name: string, terms: { joint: number, coefficients: number[] }[], constant: number, equation: string }} CouplingTable
 */

/**
 * A value of a link's joint in m or rad.
 *
 * @param {Document} document
 * @param {Link} link
 * @param {number} value
 */
export function inUnits(document, link, value) {
  return link.type === PRISMATIC ? document.metres(value) : radians(value);
}

/**
 * The couplings of a robot without joints of several variables.
 *
 * @param {Document} document
 * @param {Robot} robot
 * @returns {CouplingTable[]}
 */
export function couplingsOf(document, robot) {
  if (!robot.couplings.length) return [];
  const moving = robot.links.filter((link) => link.type !== FIXED);
  const columns = new Map(moving.map((link, i) => [link.number, i]));
  const names = robot.couplingNames();
  const joint = (/** @type {number} */ number) => /** @type {number} */ (columns.get(number));
  const linkOf = (/** @type {number} */ number) => /** @type {Link} */ (robot.node(number));
  return robot.couplings.map(({ follower, drives, offset }, i) => {
    const link = linkOf(follower);
    const own = inUnits(document, link, 1);
    const terms = drives.map(({ link: number, kind, numbers }) => {
      const other = inUnits(document, linkOf(number), 1);
      const metres = document.metres(numbers[0]) / (driveKinds[kind] === "lead" ? 2 * Math.PI : 1);
      /** @type {Record<string, () => number[]>} */
      const factors = {
        ratio: () => numbers,
        lead: () => [link.type === PRISMATIC ? metres : 1 / metres],
        radius: () => [link.type === PRISMATIC ? metres : 1 / metres],
        polynomial: () => numbers.map((c, power) => c === 0 ? c : (c * own) / other ** (power + 1)),
      };
      return { joint: joint(number), coefficients: factors[driveKinds[kind]]().map((factor) => -factor) };
    });
    const all = [{ joint: joint(follower), coefficients: [1] }, ...terms];
    const constant = inUnits(document, link, offset);
    return { name: names[i], terms: all, constant, equation: equationOf(all, constant, moving) };
  });
}

/**
 * @param {CouplingTable["terms"]} terms
 * @param {number} constant
 * @param {Link[]} moving links of the joints
 */
function equationOf(terms, constant, moving) {
  let text = "";
  for (const { joint, coefficients } of terms) {
    for (const [i, c] of coefficients.entries()) {
      if (c === 0) continue;
      const sign = c < 0 ? "-" : text ? "+" : "";
      const factor = Math.abs(c) === 1 ? "" : `${significant(Math.abs(c), 6)} `;
      const term = `${factor}${jointOf(moving[joint])}${i > 0 ? `^${i + 1}` : ""}`;
      text += text ? ` ${sign} ${term}` : sign + term;
    }
  }
  return `${text || "0"} = ${significant(constant, 6)}`;
}
