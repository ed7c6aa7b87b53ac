// Joints of several variables, and the successive links that stand for them; see raff2urdf/raff/compound.py.

import { variables } from "./definitions.js";
import { FIXED, jointOf, nameOf, NO_PARAMETERS, PRISMATIC, REVOLUTE } from "./document.js";

/** @typedef {import("./document.js").Link} Link */
/** @typedef {import("./document.js").Parameters} Parameters */
/** @typedef {import("./document.js").Part} Part */
/** @typedef {import("./document.js").Robot} Robot */
/** @typedef {import("./document.js").Variable} Variable */

const NEXT_AXIS = { ...NO_PARAMETERS, gamma: 90, alpha: 90 }; // exchanges the axes cyclically: the new z axis is the x axis

/**
 * The variables of a kind of joint, each with the parameter that is its value, or null.
 *
 * @param {string} compound
 * @returns {Map<string, string | null>}
 */
export function variablesOf(compound) {
  return new Map(Object.entries(/** @type {Record<string, Record<string, string | null>>} */ (variables)[compound]));
}

/**
 * Name of the joint of a variable.
 *
 * @param {Link} link
 * @param {string} variable
 */
function jointOfVariable(link, variable) {
  return `joint${link.number}_${variable.toUpperCase()}`;
}

/**
 * Names of the links that are put before a link whose joint has several variables.
 *
 * @param {Link} link
 */
export function intermediateNames(link) {
  let number = 1;
  return successive(link, () => number++).slice(0, -1).map(nameOf);
}

/**
 * The ball joints without limits and actuated variables, each with its three successive joints.
 *
 * @param {Robot} robot
 */
export function sphericalJoints(robot) {
  return robot.links
    .filter((link) => link.compound === "ball")
    .filter(({ variables }) => !variables.some((one) => one.limits || one.velocity !== null || one.actuated))
    .map((link) => ({ name: jointOf(link), joints: ["x", "y", "z"].map((variable) => jointOfVariable(link, variable)) }));
}

/**
 * A robot in which successive links stand for those whose joints have several variables.
 *
 * @param {Robot} robot
 */
export function expanded(robot) {
  if (!robot.links.some((link) => link.compound)) return robot;
  let number = robot.parts.reduce((most, part) => Math.max(most, part.number), 0);
  const next = () => (number += 1);
  return robot.with(
    robot.parts.flatMap((part) => (part.keyword === "link" && part.compound ? successive(part, next) : [part])),
  );
}

/**
 * @param {Link} link
 * @param {() => number} next number
 * @returns {Link[]}
 */
function successive(link, next) {
  const written = new Map(link.variables.map((variable) => [variable.name, variable]));
  const all = steps(link, (name) => written.get(name)?.home ?? 0);
  /** @type {Link[]} */
  const found = [];
  for (const [i, [name, parameters]] of all.entries()) {
    const own = written.get(name);
    const isLast = i === all.length - 1;
    const before = found.at(-1);
    const actuated = own?.actuated ?? null;
    found.push({
      keyword: "link",
      number: isLast ? link.number : next(),
      parameters,
      type: !name ? FIXED : name.startsWith("t") ? PRISMATIC : REVOLUTE,
      pred: before ? before.number : link.pred,
      limits: own?.limits ?? null,
      velocity: own?.velocity ?? null,
      effort: own?.effort ?? null,
      actuated: link.compound === "ball" && name ? Boolean(actuated) : actuated,
      compound: null,
      variables: [],
      ownJoint: name ? jointOfVariable(link, name) : jointOf(link),
      name: isLast ? link.name : `link${link.number}_${name.toUpperCase() || 0}`,
      filenames: isLast ? link.filenames : [],
      inertial: isLast || !link.inertial ? link.inertial : NO_MASS,
      locations: link.locations,
    });
  }
  return found;
}

/** @type {import("./document.js").Inertial} */
const NO_MASS = {
  mass: 0, centre: [0, 0, 0], moments: [0, 0, 0], products: [0, 0, 0], density: null, radius: null, locations: new Map(),
};

/**
 * The successive links, each as its variable, or "", and its parameters.
 *
 * @param {Link} link
 * @param {(variable: string) => number} home
 * @returns {[string, Parameters][]}
 */
function steps({ compound, parameters }, home) {
  /** @type {(name: string) => [string, Parameters]} */
  const about = (name) => [name, { ...NEXT_AXIS, theta: home(name) }];
  /** @type {(name: string) => [string, Parameters]} */
  const along = (name) => [name, { ...NEXT_AXIS, r: home(name) }];
  if (compound === "ball") return [["", parameters], about("x"), about("y"), about("z")];
  if (compound === "universal") {
    return [
      ["z", parameters],
      ["y", { ...NO_PARAMETERS, alpha: -90, theta: home("y") }],
      ["", { ...NO_PARAMETERS, alpha: 90 }],
    ];
  }
  if (compound === "cylindrical") {
    return [["z", { ...parameters, r: 0 }], ["tz", { ...NO_PARAMETERS, r: parameters.r }]];
  }
  const own = { ...NEXT_AXIS, theta: parameters.theta };
  return [["", { ...parameters, theta: 0 }], along("tx"), along("ty"), ["z", own]];
}
