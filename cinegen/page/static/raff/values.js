// The values of statements: numbers, texts, and blocks as robots, links, loops ...

import { driveKinds, limits, texts, unitsPerMetre, variables } from "./definitions.js";
import { baseAtOrigin, NO_PARAMETERS, Robot } from "./document.js";
import { compareLocations } from "./problems.js";
import { didYouMean, fill } from "./texts.js";
import { locationOf, stringOf } from "./tokens.js";

/** @typedef {import("./block.js").Block} Block */
/** @typedef {import("./block.js").Report} Report */
/** @typedef {import("./problems.js").Location} Location */
/** @typedef {import("./tokens.js").Token} Token */
/** @typedef {import("./document.js").Coupling} Coupling */
/** @typedef {import("./document.js").Drive} Drive */

/**
 * A statement of the grammar: see `Statement` in raff2urdf/raff/syntax.py.
 *
 * @typedef {{
 *   follows: string, name?: string, repeats?: boolean, required?: string, unless?: string, whole?: boolean,
 *   choice?: { what: string, words: string[] },
 * }} Statement
 */

/**
 * The value of a statement.
 *
 * @param {Report} report
 * @param {string} kind of the block
 * @param {Token} word
 * @param {Statement} statement
 * @param {Token[]} found the tokens that follow, without braces and parentheses
 * @param {Block | null} inner the block that it opens
 * @returns {unknown}
 */
export function valueOf(report, kind, word, statement, found, inner) {
  if (inner) return BLOCKS[word.text](report, inner, found[0] ?? word);
  if (statement.choice) return choice(report, statement.choice, found[0]);
  const own = WORDS.get(`${kind} ${word.text}`);
  if (own) return own(report, found, word);
  if (statement.whole) return whole(report, found[0]);
  if (statement.follows === "NUMBER") return finite(report, found[0]);
  if (statement.follows.includes("NUMBER")) return found.map((one) => finite(report, one));
  return statement.follows === "STRING" ? stringOf(found[0]) : found.map(stringOf);
}

/**
 * @param {Report} report
 * @param {Token} token
 */
function finite(report, token) {
  const value = Number(token.text);
  if (Number.isFinite(value)) return value;
  report(fill(texts.TOO_LARGE, { found: token.text }), locationOf(token));
  return 0;
}

/**
 * @param {Report} report
 * @param {Token} token
 */
function whole(report, token, least = 0) {
  const value = finite(report, token);
  const isWhole = Number.isInteger(value) && value >= least;
  if (isWhole && value <= limits.whole) return value + 0; // no -0
  const why = isWhole ? texts.WHOLE_TOO_LARGE : texts.NOT_WHOLE;
  report(fill(why, { found: token.text, least, most: limits.whole }), locationOf(token));
  return least;
}

/**
 * A whole number that stands for one of several words; a boolean for "passive" and "actuated".
 *
 * @param {Report} report
 * @param {{ what: string, words: string[] }} choice
 * @param {Token} token
 */
function choice(report, { what, words }, token) {
  let found = finite(report, token);
  if (!Number.isInteger(found) || found < 0 || found >= words.length) {
    const known = words.map((word, i) => `${i} ${word}`).join(", ");
    report(fill(texts.UNKNOWN_CHOICE, { what, found: token.text, known }), locationOf(token));
    found = 0;
  }
  return words.includes("actuated") ? found === 1 : found + 0;
}

// --- words whose values are their own ---------------------------------------------------------------------------------

/** @typedef {(report: Report, found: Token[], word: Token) => unknown} Value */

const WORDS = new Map(/** @type {[string, Value][]} */ ([
  [" units", (report, [token]) => units(report, token)],
  ["link joint", (report, [token]) => compound(report, token)],
  ["constraint link", (report, [token]) => [whole(report, token), locationOf(token)]],
  ["constraint frame", (report, [token]) => [whole(report, token), locationOf(token)]],
  ["constraint base", (_, __, word) => [0, locationOf(word)]],
  ["constraint sensor", (report, found) => found.map((one) => [whole(report, one), locationOf(one)])],
  ...["base", "link", "frame"].map((kind) => /** @type {[string, Value]} */ ([
    `${kind} filename`, (_, found) => found.map((token) => ({ name: stringOf(token), at: locationOf(token) })),
  ])),
  ["coupling link", (report, [token]) => ({ link: whole(report, token, 1), at: locationOf(token) })],
]));
for (const [kind, word] of driveKinds.entries()) {
  WORDS.set(`coupling ${word}`, (report, found) => ({
    kind, numbers: found.map((one) => finite(report, one)), at: locationOf(found[0]),
  }));
}

/**
 * @param {Report} report
 * @param {Token} token
 */
function units(report, token) {
  if (!Object.hasOwn(unitsPerMetre, token.text)) {
    const known = Object.keys(unitsPerMetre).join(", ");
    report(fill(texts.UNKNOWN_UNIT, { found: token.text, known }), locationOf(token));
  }
  return token.text;
}

/**
 * @param {Report} report
 * @param {Token} token
 */
function compound(report, token) {
  const kinds = Object.keys(variables);
  if (kinds.includes(token.text)) return token.text;
  const hint = didYouMean(token.text, kinds);
  report(fill(texts.UNKNOWN_JOINT, { found: token.text, hint }), locationOf(token));
  return kinds[0];
}

// --- blocks -----------------------------------------------------------------------------------------------------------

/** @type {Record<string, (report: Report, block: Block, token: Token) => unknown>} `token`: behind the word, or the word */
const BLOCKS = {
  robot,
  sensor: (report, block, number) => ({
    port: block.get("port", ""),
    translation: block.get("translation", 3),
    rotation: block.get("rotation", 3),
    ...numbered(report, block, number),
  }),
  base: (_, block) => ({ ...baseAtOrigin(), ...ofNode(block), locations: new Map([...block.locations, ...filesIn(block)]) }),
  link: (report, block, number) => ({
    keyword: "link",
    ...ofNode(block),
    ...ofJoint(block),
    type: block.get("type", 0),
    pred: block.get("pred", 0),
    compound: block.get("compound", null),
    variables: block.get("variables", []),
    ownJoint: null,
    name: block.get("name", null),
    ...numbered(report, block, number),
  }),
  frame: (report, block, number) => ({
    keyword: "frame",
    ...ofNode(block),
    pred: block.get("pred", 0),
    name: block.get("name", null),
    ...numbered(report, block, number),
  }),
  parameters: (_, block) => ({ ...NO_PARAMETERS, ...Object.fromEntries(block.values) }),
  inertial: (_, block, word) => ({
    mass: block.get("mass", null),
    centre: block.get("centre", [0, 0, 0]),
    moments: block.get("moments", [0, 0, 0]),
    products: block.get("products", [0, 0, 0]),
    density: block.get("density", null),
    radius: block.get("radius", null),
    locations: new Map([...block.locations, ["inertial", locationOf(word)]]),
  }),
  variable: (_, block, name) => ({
    name: name.text,
    home: block.get("home", 0),
    ...ofJoint(block),
    locations: new Map([...block.locations, ["name", locationOf(name)]]),
  }),
  constraint,
  coupling,
};

/**
 * @param {Report} report
 * @param {Block} block
 * @param {Token} number
 */
function numbered(report, block, number) {
  const locations = new Map([...block.locations, ...filesIn(block), ["number", locationOf(number)]]);
  return { number: whole(report, number, 1), locations };
}

/**
 * The locations of a node's graphic files: "file 0", "file 1", ...
 *
 * @param {Block} block
 * @returns {[string, Location][]}
 */
function filesIn(block) {
  return filesOf(block).map(({ at }, i) => [`file ${i}`, at]);
}

/**
 * @param {Block} block
 * @returns {{ name: string, at: Location }[]}
 */
function filesOf(block) {
  return block.get("filenames", /** @type {{ name: string, at: Location }[][]} */ ([])).flat();
}

/** @param {Block} block */
function ofNode(block) {
  return {
    parameters: block.get("parameters", NO_PARAMETERS),
    filenames: block.values.has("filenames") ? filesOf(block).map(({ name }) => name) : null,
    inertial: block.get("inertial", null),
  };
}

/** @param {Block} block */
function ofJoint(block) {
  return {
    limits: block.get("limits", null),
    velocity: block.get("velocity", null),
    effort: block.get("effort", null),
    actuated: block.get("actuated", null),
  };
}

/**
 * @param {Report} _
 * @param {Block} block
 * @param {Token} name
 */
function robot(_, block, name) {
  const constraints = /** @type {any[]} */ (block.get("constraints", []));
  return new Robot({
    name: stringOf(name),
    base: block.get("base", baseAtOrigin()),
    parts: block.get("parts", []),
    loops: constraints.filter((one) => "first" in one),
    couplings: block.get("couplings", []),
    sensorConstraints: constraints.filter((one) => "sensors" in one),
    path: block.get("path", null),
    locations: new Map([["name", locationOf(name)], ...block.locations]),
  });
}

/**
 * @param {Report} report
 * @param {Block} block
 * @param {Token} keyword
 */
function constraint(report, block, keyword) {
  const nodes = /** @type {[number, Location][]} */ (block.get("nodes", []));
  const sensors = /** @type {[number, Location][] | null} */ (block.get("sensor", null));
  const locations = new Map(block.locations);
  const places = [...nodes.map(([, place]) => place), ...locations.values()].sort(compareLocations);
  const at = places[0] ?? locationOf(keyword);
  if (sensors) {
    if (nodes.length !== 1 || block.values.has("type")) report(texts.SENSORS_OF_ONE_NODE, at);
    for (const [number, place] of sensors) locations.set(`sensor ${number}`, place);
    const [node, place] = nodes[0] ?? [0, at];
    return { node, sensors: sensors.map(([number]) => number), locations: locations.set("node", place) };
  }
  if (nodes.length !== 2) {
    report(texts.TWO_NODES, at);
    return { first: 0, second: 0, kind: 0, locations: new Map() };
  }
  const [[first, firstAt], [second, secondAt]] = nodes;
  locations.set("first", firstAt).set("second", secondAt);
  return { first, second, kind: block.get("type", 0), locations };
}

/**
 * @param {Report} report
 * @param {Block} block
 * @param {Token} keyword
 * @returns {Coupling}
 */
function coupling(report, block, keyword) {
  const parts = /** @type {{ link?: number, kind: number, numbers: number[], at: Location }[]} */ (
    block.get("parts", [])
  );
  const locations = new Map(block.locations);
  /** @type {{ link: number, at: Location }[]} */
  const links = [];
  /** @type {Drive[]} */
  const drives = [];
  /** @type {(message: string, at: Location) => Coupling} */
  const wrong = (message, at) => {
    report(message, at);
    return { follower: 0, drives: [], offset: 0, name: null, locations: new Map() };
  };
  for (const { link, kind, numbers, at } of parts) {
    const last = links.at(-1);
    if (link !== undefined) {
      if (last && links.length - drives.length > 1) return wrong(fill(texts.NEEDS_DRIVE, { link: last.link }), last.at);
      links.push({ link, at });
      locations.set(links.length === 1 ? "follower" : `drive ${links.length - 2}`, at);
    } else if (!last || links.length - drives.length !== 2) {
      return wrong(fill(texts.DRIVES_NOTHING, { word: driveKinds[kind] }), at);
    } else {
      drives.push({ link: last.link, kind, numbers });
    }
  }
  const last = links.at(-1);
  if (!last) return wrong(texts.NAMES_NO_DRIVE, locationOf(keyword));
  if (links.length < 2) return wrong(texts.NAMES_NO_DRIVE, last.at);
  if (drives.length !== links.length - 1) return wrong(fill(texts.NEEDS_DRIVE, { link: last.link }), last.at);
  return {
    follower: links[0].link, drives, offset: block.get("offset", 0), name: block.get("name", null), locations,
  };
}
