// Checks of loops, couplings and sensor constraints: that they name nodes and sensors that exist and fit each other.

import { driveKinds, jointTypes, texts } from "./definitions.js";
import { FIXED } from "./document.js";
import { didYouMean, fill } from "./texts.js";

/** @typedef {import("./document.js").Coupling} Coupling */
/** @typedef {import("./document.js").Document} Document */
/** @typedef {import("./document.js").Robot} Robot */

/**
 * @param {Document} document
 * @param {Robot} robot
 * @param {Set<number>} sensors numbers of those of the document
 */
export function* constraintProblems(document, robot, sensors) {
  const { source } = document;
  if (!robot.loops.length && !robot.couplings.length && !robot.sensorConstraints.length) return;
  const numbers = [...new Set([0, ...robot.parts.map((part) => part.number)])].sort((a, b) => a - b);
  const known = didYouMean("", numbers.map(String));
  for (const { first, second, locations } of robot.loops) {
    for (const [end, number] of /** @type {const} */ ([["first", first], ["second", second]])) {
      if (robot.nodes.has(number)) continue;
      yield source.problem(fill(texts.NO_END, { robot: robot.name, number, known }), locations.get(end));
    }
    if (first === second) yield source.problem(fill(texts.LOOP_TO_ITSELF, { number: first }), locations.get("first"));
  }
  yield* couplingProblems(document, robot);
  let declared = "";
  for (const { node, sensors: own, locations } of robot.sensorConstraints) {
    if (!robot.nodes.has(node)) {
      yield source.problem(fill(texts.NO_NODE, { robot: robot.name, number: node, known }), locations.get("node"));
    }
    for (const number of own) {
      if (number === 0 || sensors.has(number)) continue;
      declared ||= [...sensors].sort((a, b) => a - b).join(", ") || texts.NONE;
      yield source.problem(fill(texts.NO_SENSOR, { number, declared }), locations.get(`sensor ${number}`));
    }
  }
}

/**
 * @param {Document} document
 * @param {Robot} robot
 */
function* couplingProblems({ source }, robot) {
  if (!robot.couplings.length) return;
  const moving = new Map(robot.links.filter((link) => link.type !== FIXED).map((link) => [link.number, link.type]));
  const compounds = new Map(robot.links.filter((link) => link.compound).map((link) => [link.number, link.compound]));
  const known = didYouMean("", [...moving.keys()].map(String));
  const endsExist = robot.loops.every((loop) => robot.nodes.has(loop.first) && robot.nodes.has(loop.second));
  const loops = endsExist ? robot.loopNames() : [];
  const names = new Set();
  for (const { name, follower, drives, locations: at } of robot.couplings) {
    if (name !== null && names.has(name)) yield source.problem(fill(texts.NAME_OF_COUPLING, { name }), at.get("name"));
    if (name !== null && loops.includes(name)) yield source.problem(fill(texts.NAME_OF_LOOP, { name }), at.get("name"));
    names.add(name);
    const met = new Set();
    for (const [i, number] of [follower, ...drives.map((drive) => drive.link)].entries()) {
      const where = at.get(i ? `drive ${i - 1}` : "follower");
      const compound = compounds.get(number);
      if (compound) {
        yield source.problem(fill(texts.COUPLES_COMPOUND, { number, compound }), where);
      } else if (!moving.has(number)) {
        yield source.problem(fill(texts.COUPLES_NOTHING, { number, known }), where);
      } else if (met.has(number)) {
        yield source.problem(fill(texts.COUPLED_TWICE, { number }), where);
      }
      met.add(number);
    }
    const own = moving.get(follower);
    for (const [i, { link, kind, numbers }] of drives.entries()) {
      const other = moving.get(link);
      if (own === undefined || other === undefined) continue;
      const where = at.get(`drive ${i}`);
      const word = driveKinds[kind];
      const fields = { follower, link, word, own: jointTypes[own], other: jointTypes[other] };
      if (word === "ratio" && own !== other) yield source.problem(fill(texts.RATIO_OF_TWO_TYPES, fields), where);
      if ((word === "lead" || word === "radius") && own === other) {
        yield source.problem(fill(texts.SCREW_OF_ONE_TYPE, fields), where);
      }
      if (numbers.every((one) => one === 0)) yield source.problem(fill(texts.DRIVES_BY_0, fields), where);
    }
  }
}
