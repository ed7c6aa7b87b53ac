// Checks of a document beyond its grammar: parents, cycles, duplicates, limits, names, masses. What joins nodes is
// checked in check_constraints.js.

import { limits, reserved, texts, xmlName } from "./definitions.js";
import { constraintProblems } from "./check_constraints.js";
import { oddities } from "./check_oddities.js";
import { intermediateNames, variablesOf } from "./compound.js";
import { couplingsOf } from "./couplings.js";
import { FIXED, label, nameOf } from "./document.js";
import { placeOf, sizes } from "./inertia.js";
import { RaffError } from "./problems.js";
import { didYouMean, fill, shortest } from "./texts.js";

/** @typedef {import("./document.js").Document} Document */
/** @typedef {import("./document.js").Inertial} Inertial */
/** @typedef {import("./document.js").Link} Link */
/** @typedef {import("./document.js").Node} Node */
/** @typedef {import("./document.js").OfJoint} OfJoint */
/** @typedef {import("./document.js").Part} Part */
/** @typedef {import("./document.js").Robot} Robot */
/** @typedef {import("./problems.js").Location} Location */
/** @typedef {import("./problems.js").Problem} Problem */

const XML_NAME = new RegExp(`^(?:${xmlName})$`, "u");
const RESERVED = new Map(Object.entries(reserved));
const RADIANS = Math.PI / 180;

/**
 * Check a document of which models are to be made.
 *
 * @param {Document} document
 * @returns {Problem[]} warnings: what is valid but odd
 * @throws {RaffError} with every problem
 */
export function check(document) {
  const problems = document.robots.length ? [] : [document.source.problem(fill(texts.NO_ROBOT))];
  problems.push(...fileProblems(document));
  const sensors = new Set(document.sensors.map((sensor) => sensor.number));
  for (const robot of document.robots) {
    for (const problem of treeProblems(document, robot)) problems.push(problem);
    for (const problem of constraintProblems(document, robot, sensors)) problems.push(problem);
    for (const problem of unitProblems(document, robot)) problems.push(problem);
  }
  if (problems.length) throw new RaffError(problems);
  return document.robots.flatMap((robot) => [...oddities(document, robot)]);
}

/**
 * Check what every document needs, an excerpt too, whose constraints may name what does not exist.
 *
 * @param {Document} document
 * @throws {RaffError} with every problem
 */
export function checkTree(document) {
  const problems = [...fileProblems(document), ...document.robots.flatMap((one) => [...treeProblems(document, one)])];
  if (problems.length) throw new RaffError(problems);
}

/**
 * Check that no length, mass and moment of inertia is too large for computations.
 *
 * @param {Document} document
 * @param {Robot} robot
 * @throws {RaffError} with every problem
 */
export function checkSizes(document, robot) {
  const problems = [];
  const largest = limits.largest;
  for (const node of [robot.base, ...robot.parts]) {
    for (const word of /** @type {const} */ (["r", "d", "epsilon"])) {
      if (document.metres(Math.abs(node.parameters[word])) <= largest) continue;
      const message = fill(texts.LENGTH_TOO_LARGE, { word, node: label(node), largest });
      problems.push(document.source.problem(message, node.locations.get("parameters")));
    }
    for (const [word, size] of node.inertial ? sizes(document, node.inertial) : []) {
      if (size <= largest) continue;
      const message = fill(texts.INERTIAL_TOO_LARGE, { word, node: label(node), largest });
      problems.push(document.source.problem(message, placeOf(node.inertial, word)));
    }
  }
  problems.push(...couplingSizes(document, robot));
  if (problems.length) throw new RaffError(problems);
}

/**
 * @param {Document} document
 * @param {Robot} robot
 */
function* couplingSizes(document, robot) {
  const { largest, smallest: least } = limits;
  for (const [i, { terms, constant }] of couplingsOf(document, robot).entries()) {
    const { follower, drives, locations } = robot.couplings[i];
    for (const [j, { link }] of drives.entries()) {
      const size = terms[j + 1].coefficients.reduce((most, one) => Math.max(most, Math.abs(one)), 0);
      if (size >= least && size <= largest) continue;
      const message = fill(texts.COEFFICIENTS_TOO_LARGE, { link, follower, largest, least });
      yield document.source.problem(message, locations.get(`drive ${j}`));
    }
    if (Math.abs(constant) <= largest) continue;
    yield document.source.problem(fill(texts.OFFSET_TOO_LARGE, { follower, largest }), locations.get("offset"));
  }
}

/**
 * Each thing whose name an earlier one has, behind the first one of that name.
 *
 * @template T
 * @param {readonly T[]} things
 * @param {(thing: T) => unknown} name
 * @returns {[T, T][]}
 */
function duplicates(things, name) {
  const known = new Map();
  /** @type {[T, T][]} */
  const found = [];
  for (const thing of things) {
    const own = name(thing);
    if (known.has(own)) found.push([known.get(own), thing]);
    else known.set(own, thing);
  }
  return found;
}

/**
 * @param {string} what
 * @param {Location | undefined} first
 */
function definedTwice(what, first) {
  const where = first ? fill(texts.FIRST_ON_LINE, { line: first.line }) : "";
  return fill(texts.DEFINED_TWICE, { what, first: where });
}

/** @param {Document} document */
function* fileProblems({ robots, sensors, source }) {
  for (const [first, robot] of duplicates(robots, (one) => one.name)) {
    const at = first.locations.get("name");
    yield source.problem(definedTwice(`robot '${robot.name}'`, at), robot.locations.get("name"));
  }
  const named = new Map([...robots].reverse().map((robot) => [robot.name, robot]));
  for (const { name, locations } of named.values()) {
    if (!XML_NAME.test(name)) yield source.problem(fill(texts.BAD_NAME, { name, keyword: "robot" }), locations.get("name"));
  }
  for (const [first, sensor] of duplicates(sensors, (one) => one.number)) {
    const at = first.locations.get("number");
    yield source.problem(definedTwice(`sensor ${sensor.number}`, at), sensor.locations.get("number"));
  }
}

/**
 * @param {Document} document
 * @param {Robot} robot
 */
function* treeProblems(document, robot) {
  const { source } = document;
  /** @type {Map<number, Part>} */
  const numbers = new Map();
  for (const part of robot.parts) if (!numbers.has(part.number)) numbers.set(part.number, part);
  for (const [first, part] of duplicates(robot.parts, (one) => one.number)) {
    const message = definedTwice(`the number ${part.number}`, first.locations.get("number"));
    yield source.problem(message, part.locations.get("number"));
  }
  /** @type {Map<string, Part>} */
  const names = new Map();
  for (const part of robot.parts) {
    const name = nameOf(part);
    const { keyword } = part;
    const at = part.locations.get("name") ?? part.locations.get("number");
    const first = names.get(name) ?? part;
    names.set(name, first);
    const owner = RESERVED.get(name);
    if (owner !== undefined) {
      yield source.problem(fill(texts.RESERVED_NAME, { name, owner }), at);
    } else if (!XML_NAME.test(name)) {
      yield source.problem(fill(texts.BAD_NAME, { name, keyword }), at);
    } else if (first !== part && numbers.get(part.number) === part) {
      const taken = { name, keyword: first.keyword, number: first.number };
      yield source.problem(fill(texts.NAME_TAKEN, taken), at);
    }
  }
  let known = "";
  for (const { keyword, number, pred, locations } of robot.parts) {
    if (pred === 0 || numbers.has(pred)) continue;
    known ||= didYouMean("", [texts.THE_BASE, ...[...numbers.keys()].map(String)]);
    yield source.problem(fill(texts.NO_PARENT, { keyword, number, pred, known }), locations.get("pred"));
  }
  yield* cycles(document, numbers);
  for (const node of [robot.base, ...robot.parts]) {
    if (node.inertial) yield* inertialProblems(document, node, node.inertial);
  }
  for (const link of robot.links) {
    yield* limitProblems(document, label(link), link);
    yield* variableProblems(document, link, names);
  }
}

/**
 * One problem for each cycle of parents. Every node is visited once.
 *
 * @param {Document} document
 * @param {Map<number, Part>} numbers
 */
function* cycles({ source }, numbers) {
  const visited = new Map([[0, -1]]); // number -> the start of the walk that met it
  for (const start of numbers.keys()) {
    const trail = [];
    let at = start;
    let part = numbers.get(at);
    while (part && !visited.has(at)) {
      visited.set(at, start);
      trail.push(at);
      at = part.pred;
      part = numbers.get(at);
    }
    if (!part || visited.get(at) !== start) continue;
    const cycle = trail.slice(trail.indexOf(at));
    const shown = [...cycle.slice(0, 8).map(String), ...(cycle.length > 8 ? ["..."] : []), at].join(" -> ");
    yield source.problem(fill(texts.CYCLE, { keyword: part.keyword, number: at, shown }), part.locations.get("pred"));
  }
}

/**
 * @param {Document} document
 * @param {string} what
 * @param {OfJoint} of
 */
function* limitProblems({ source, perMetre }, what, { limits: range, velocity, effort, locations }) {
  if (range && !(range[0] <= range[1])) {
    const [low, high] = range;
    yield source.problem(fill(texts.LIMITS_REVERSED, { what, low, high }), locations.get("limits"));
  }
  if (velocity !== null && !(Math.min(velocity / perMetre, velocity * RADIANS) > limits.leastSpeed)) {
    const tooSlow = fill(texts.TOO_SLOW, { least: limits.leastSpeed });
    const message = fill(texts.VELOCITY_TOO_SMALL, { what, value: velocity, too_slow: tooSlow });
    yield source.problem(message, locations.get("velocity"));
  }
  if (effort !== null && !(effort > 0)) {
    yield source.problem(fill(texts.EFFORT_TOO_SMALL, { what, value: effort }), locations.get("effort"));
  }
}

/**
 * @param {Document} document
 * @param {Node} node
 * @param {Inertial} inertial
 */
function* inertialProblems({ source }, node, inertial) {
  const problem = (/** @type {string} */ message, /** @type {string} */ word) =>
    source.problem(message, placeOf(inertial, word));
  const what = label(node);
  const { mass, density, radius } = inertial;
  if (mass === null && density === null) yield problem(fill(texts.NO_MASS, { what }), "inertial");
  if (mass !== null && mass < 0) yield problem(fill(texts.NEGATIVE_MASS, { what, mass }), "mass");
  for (const word of /** @type {const} */ (["density", "radius"])) {
    const value = inertial[word];
    if (value === null || value > 0) continue;
    yield problem(fill(texts.NOT_ABOVE_0, { word, what, value: shortest(value) }), word);
  }
  if (density === null && radius !== null) yield problem(fill(texts.RADIUS_OF_BARS, { what }), "radius");
  if (density === null) return;
  for (const word of ["mass", "centre", "moments", "products"]) {
    if (inertial.locations.has(word)) yield problem(fill(texts.DENSITY_AND_MASS, { what, word }), word);
  }
  if (radius === null && !node.filenames?.length) yield problem(fill(texts.DENSITY_OF_NOTHING, { what }), "density");
}

/**
 * @param {Document} document
 * @param {Link} link
 * @param {Map<string, Part>} names
 */
function* variableProblems(document, link, names) {
  const { source } = document;
  const what = label(link);
  const at = link.locations;
  const { compound } = link;
  if (compound === null) {
    if (!link.variables.length) return;
    yield source.problem(fill(texts.NO_VARIABLES, { what }), link.variables[0].locations.get("name"));
    return;
  }
  if (link.type !== FIXED || at.has("type")) yield source.problem(fill(texts.TYPE_AND_JOINT, { what }), at.get("type"));
  const known = variablesOf(compound);
  const [first] = known.keys();
  for (const word of /** @type {const} */ (["limits", "velocity", "effort", "actuated"])) {
    if (link[word] === null) continue;
    yield source.problem(fill(texts.IN_A_VARIABLE, { compound, what, word, first }), at.get(word));
  }
  for (const [other, variable] of duplicates(link.variables, (one) => one.name)) {
    const message = definedTwice(`variable ${variable.name} of ${what}`, other.locations.get("name"));
    yield source.problem(message, variable.locations.get("name"));
  }
  for (const variable of link.variables) {
    const { name, home, locations } = variable;
    const own = `variable ${name} of ${what}`;
    const parameter = known.get(name);
    if (parameter === undefined) {
      const fields = { compound, name, known: didYouMean("", [...known.keys()]) };
      yield source.problem(fill(texts.NO_SUCH_VARIABLE, fields), locations.get("name"));
    } else if (home && parameter) {
      yield source.problem(fill(texts.HOME_IS_PARAMETER, { what: own, parameter }), locations.get("home"));
    }
    yield* limitProblems(document, own, variable);
  }
  for (const name of intermediateNames(link)) {
    const owner = names.get(name);
    if (!owner) continue;
    yield source.problem(fill(texts.NAME_NEEDED, { name, what }), owner.locations.get("name") ?? at.get("number"));
  }
}

/**
 * A problem if all lengths are below some mm and the file does not state that mm are meant.
 *
 * @param {Document} document
 * @param {Robot} robot
 */
function* unitProblems({ source, statesUnits }, robot) {
  let size = -1;
  /** @type {Node} */
  let longest = robot.base;
  for (const node of [robot.base, ...robot.parts]) {
    const { r, d, epsilon } = node.parameters;
    const own = Math.max(Math.abs(r), Math.abs(d), Math.abs(epsilon));
    if (own > size) [size, longest] = [own, node];
  }
  if (statesUnits || !(size > 0 && size < limits.leastSize)) return;
  const message = fill(texts.SMALL, { robot: robot.name, least: limits.leastSize, size: shortest(size) });
  yield source.problem(message, longest.locations.get("parameters"));
}
