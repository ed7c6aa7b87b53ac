// Warnings: valid input that is probably not intended.

import { limits, texts } from "./definitions.js";
import { variablesOf } from "./compound.js";
import { FIXED, label, REVOLUTE } from "./document.js";
import { placeOf, sizes, statedInertia, whyUnphysical } from "./inertia.js";
import { fill, shortest } from "./texts.js";

/** @typedef {import("./document.js").Document} Document */
/** @typedef {import("./document.js").Link} Link */
/** @typedef {import("./document.js").Parameters} Parameters */
/** @typedef {import("./document.js").Robot} Robot */

/**
 * @param {Document} document
 * @param {Robot} robot
 */
export function* oddities(document, robot) {
  for (const node of [robot.base, ...robot.parts]) {
    const { inertial } = node;
    if (!inertial || sizes(document, inertial).some(([, size]) => !(size <= limits.largest))) continue;
    const why = whyUnphysical(statedInertia(document, inertial));
    if (!why) continue;
    yield document.source.problem(fill(texts.NO_BODY, { node: label(node), why }), placeOf(inertial, "moments"));
  }
  for (const link of robot.links) {
    yield* variablesOutside(document, link);
    yield* uselessEfforts(document, link);
    yield* ofJoint(document, link);
  }
}

/**
 * @param {Document} document
 * @param {Link} link
 */
function* ofJoint({ source }, link) {
  if (link.type === FIXED && !link.compound) {
    for (const word of /** @type {const} */ (["limits", "velocity", "effort", "actuated"])) {
      if (!link[word]) continue;
      yield source.problem(fill(texts.FIXED_HAS, { number: link.number, word }), link.locations.get(word));
    }
    return;
  }
  const home = link.type === REVOLUTE ? link.parameters.theta : link.parameters.r;
  const why = outside(label(link), home, link.limits);
  if (why) yield source.problem(why, link.locations.get("limits"));
}

/**
 * @param {Document} document
 * @param {Link} link
 */
function* uselessEfforts({ source }, link) {
  const isBall = link.compound === "ball";
  const what = label(link);
  const variables = link.variables.map((variable) => /** @type {const} */ ([`variable ${variable.name} of ${what}`, variable]));
  for (const [own, of] of [/** @type {const} */ ([what, link]), ...variables]) {
    if (of.effort === null || !(of.actuated === false || (isBall && !of.actuated))) continue;
    yield source.problem(fill(texts.USELESS_EFFORT, { what: own }), of.locations.get("effort"));
  }
}

/**
 * @param {Document} document
 * @param {Link} link
 */
function* variablesOutside({ source }, link) {
  for (const { name, home, limits: range, locations } of link.variables) {
    const parameter = link.compound ? variablesOf(link.compound).get(name) : null;
    const value = parameter ? link.parameters[/** @type {keyof Parameters} */ (parameter)] : home;
    const why = outside(`variable ${name} of ${label(link)}`, value, range);
    if (why) yield source.problem(why, locations.get("limits"));
  }
}

/**
 * @param {string} what
 * @param {number} home
 * @param {[number, number] | null} range
 */
function outside(what, home, range) {
  if (!range || (range[0] <= home && home <= range[1])) return null;
  const [low, high] = range.map(shortest);
  return fill(texts.HOME_OUTSIDE, { home: shortest(home), what, low, high });
}
