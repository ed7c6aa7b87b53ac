// The contents of a RAFF file as values, in the file's own units: lengths in `units`, angles in degrees, masses in kg.

import { texts, unitsPerMetre } from "./definitions.js";
import { RaffError } from "./problems.js";
import { didYouMean, fill } from "./texts.js";

/** @typedef {import("./problems.js").Locations} Locations */
/** @typedef {import("./problems.js").SourceText} SourceText */
/** @typedef {[number, number]} Range */
/** @typedef {[number, number, number]} Vector */

/**
 * Kleinfinger's six parameters: r, d, epsilon lengths; theta, alpha, gamma degrees.
 *
 * @typedef {{ theta: number, r: number, d: number, alpha: number, gamma: number, epsilon: number }} Parameters
 */

/** @type {Readonly<Parameters>} */
export const NO_PARAMETERS = { theta: 0, r: 0, d: 0, alpha: 0, gamma: 0, epsilon: 0 };

/**
 * The mass of a node, in its own frame; `mass` is null with a density (kg/m3), `radius` is that of bars.
 *
 * @typedef {{
 *   mass: number | null, centre: Vector, moments: Vector, products: Vector, density: number | null,
 *   radius: number | null, locations: Locations,
 * }} Inertial
 */

/**
 * What a joint of one variable, or a variable, may have.
 *
 * @typedef {{
 *   limits: Range | null, velocity: number | null, effort: number | null, actuated: boolean | null,
 *   locations: Locations,
 * }} OfJoint
 */

/** @typedef {OfJoint & { name: string, home: number }} Variable */

/**
 * What base, links and frames have; `filenames` is null if the file names none, and a skeleton is drawn.
 *
 * @typedef {{
 *   number: number, parameters: Parameters, filenames: string[] | null, inertial: Inertial | null, locations: Locations,
 * }} OfNode
 */

/** @typedef {OfNode & { keyword: "base" }} Base */

/**
 * `type` is the index in `jointTypes`; 0 (fixed) if `compound`, the kind of a joint of several variables, is there.
 *
 * @typedef {OfNode & OfJoint & {
 *   keyword: "link", type: number, pred: number, compound: string | null, variables: Variable[],
 *   ownJoint: string | null, name: string | null,
 * }} Link
 */

/** @typedef {OfNode & { keyword: "frame", pred: number, name: string | null }} Frame */
/** @typedef {Link | Frame} Part a node with a parent */
/** @typedef {Base | Part} Node */

/** @typedef {{ first: number, second: number, kind: number, locations: Locations }} Loop `kind`: index in `loopKinds` */
/** @typedef {{ link: number, kind: number, numbers: number[] }} Drive `kind`: index in `driveKinds` */

/**
 * @typedef {{
 *   follower: number, drives: Drive[], offset: number, name: string | null, locations: Locations,
 * }} Coupling
 */

/** @typedef {{ node: number, sensors: number[], locations: Locations }} SensorConstraint */

/**
 * @typedef {{ number: number, port: string, translation: number, rotation: number, locations: Locations }} Sensor
 */

export const [FIXED, PRISMATIC, REVOLUTE] = [0, 1, 2]; // types of joints

/** @returns {Base} */
export function baseAtOrigin() {
  return {
    keyword: "base", number: 0, parameters: NO_PARAMETERS, filenames: null, inertial: null, locations: new Map(),
  };
}

/**
 * Name of a node, for people and in the URDF.
 *
 * @param {Node} node
 */
export function nameOf(node) {
  if (node.keyword === "base") return "base";
  return node.name ?? `${node.keyword}${node.number}`;
}

/**
 * Name of the joint between a node and its parent.
 *
 * @param {Part} part
 */
export function jointOf(part) {
  return (part.keyword === "link" && part.ownJoint) || `joint${part.number}`;
}

/**
 * A node as errors name it.
 *
 * @param {Node} node
 */
export function label(node) {
  return node.keyword === "base" ? "the base" : `${node.keyword} ${node.number}`;
}

/** One robot of a file: `parts` are its links and frames in file order, a tree under `base`. */
export class Robot {
  /**
   * @param {{
   *   name: string, base: Base, parts: Part[], loops: Loop[], couplings: Coupling[],
   *   sensorConstraints: SensorConstraint[], path: string | null, locations: Locations,
   * }} values
   */
  constructor(values) {
    this.name = values.name;
    this.base = values.base;
    this.parts = values.parts;
    this.loops = values.loops;
    this.couplings = values.couplings;
    this.sensorConstraints = values.sensorConstraints;
    this.path = values.path;
    this.locations = values.locations;
    /** The links, in file order. */
    this.links = this.parts.filter((part) => part.keyword === "link");
    /** @type {Map<number, Node> | null} */
    this.byNumber = null;
  }

  /** Every node by its number: base first, then file order. */
  get nodes() {
    if (!this.byNumber) {
      this.byNumber = new Map([[0, /** @type {Node} */ (this.base)]]);
      for (const part of this.parts) this.byNumber.set(part.number, part);
    }
    return this.byNumber;
  }

  /** Links and frames by the number of their parent, in file order. */
  children() {
    /** @type {Map<number, Part[]>} */
    const found = new Map();
    for (const part of this.parts) {
      const siblings = found.get(part.pred);
      if (siblings) siblings.push(part);
      else found.set(part.pred, [part]);
    }
    return found;
  }

  /**
   * The same robot with other links and frames.
   *
   * @param {Part[]} parts
   */
  with(parts) {
    return new Robot({ ...this, parts });
  }

  /** Links and frames in depth-first order: every parent before its children. */
  outward() {
    /** @type {Part[]} */
    const order = [];
    const children = this.children();
    const pending = [...(children.get(0) ?? [])].reverse();
    for (let part = pending.pop(); part; part = pending.pop()) {
      order.push(part);
      for (const child of [...(children.get(part.number) ?? [])].reverse()) pending.push(child);
    }
    return order;
  }

  /** The number of joints, fixed ones too, between the base and each node, by its number. */
  depth() {
    const found = new Map([[0, 0]]);
    for (const part of this.outward()) found.set(part.number, (found.get(part.pred) ?? 0) + 1);
    return found;
  }

  /** True if the base can move, because a sensor constraint names it. */
  get movable() {
    return this.sensorConstraints.some((constraint) => constraint.node === 0);
  }

  /** Names of the loops, such as `link5-link11`; a second loop between the same nodes ends in `#2`, and so on. */
  loopNames() {
    const name = (/** @type {number} */ number) => nameOf(this.node(number));
    return distinct(this.loops.map((loop) => `${name(loop.first)}-${name(loop.second)}`));
  }

  /** Names of the couplings: the file's, or such as `joint5-joint3`, the follower first. */
  couplingNames() {
    return distinct(
      this.couplings.map((one) => {
        const joints = [one.follower, ...one.drives.map((drive) => drive.link)];
        return one.name || joints.map((number) => `joint${number}`).join("-");
      }),
    );
  }

  /** @param {number} number of a node that exists */
  node(number) {
    const found = this.nodes.get(number);
    if (!found) throw new RangeError(`there is no node ${number}`);
    return found;
  }
}

/** A whole RAFF file. */
export class Document {
  /**
   * @param {{
   *   name: string, robots: Robot[], sensors: Sensor[], units: string, statesUnits: boolean, source: SourceText,
   * }} values
   */
  constructor(values) {
    this.name = values.name;
    this.robots = values.robots;
    this.sensors = values.sensors;
    this.units = values.units;
    this.statesUnits = values.statesUnits;
    this.source = values.source;
    this.perMetre = /** @type {Record<string, number>} */ (unitsPerMetre)[values.units];
  }

  /**
   * The robot of that name, or the first one; a RaffError if there is none.
   *
   * @param {string} [name]
   */
  robot(name) {
    const found = this.robots.find((robot) => name === undefined || robot.name === name);
    if (found) return found;
    const names = this.robots.map((robot) => robot.name);
    const message =
      name === undefined ? fill(texts.NO_ROBOT) : fill(texts.NO_SUCH_ROBOT, { name, hint: didYouMean(name, names) });
    throw new RaffError([this.source.problem(message)]);
  }

  /**
   * A length of the file in metres, by a division: 211.21 mm is the double nearest to 0.21121.
   *
   * @param {number} length
   */
  metres(length) {
    return length / this.perMetre;
  }
}

/** @param {string[]} names */
function distinct(names) {
  /** @type {Map<string, number>} */
  const seen = new Map();
  return names.map((name) => {
    const count = (seen.get(name) ?? 0) + 1;
    seen.set(name, count);
    return count === 1 ? name : `${name}#${count}`;
  });
}
