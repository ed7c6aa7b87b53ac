// The tables of a robot's model, in metres, radians and kilograms: what Python's constraints file and URDF hold of it.

import { jointTypes, loopKinds } from "./definitions.js";
import { checkSizes } from "./check.js";
import { expanded, sphericalJoints } from "./compound.js";
import { couplingsOf, inUnits } from "./couplings.js";
import { FIXED, jointOf, nameOf, REVOLUTE } from "./document.js";
import { statedInertia } from "./inertia.js";
import { kleinfinger, times, transform } from "./kleinfinger.js";

/** @typedef {import("./document.js").Document} Document */
/** @typedef {import("./document.js").Link} Link */
/** @typedef {import("./document.js").Node} Node */
/** @typedef {import("./document.js").Part} Part */
/** @typedef {import("./document.js").Robot} Robot */
/** @typedef {import("./kleinfinger.js").Kleinfinger} Kleinfinger */
/** @typedef {import("./kleinfinger.js").Placement} Placement */

/**
 * A body: a node of the file, or a link between the successive joints of one of several variables (`isNode` false).
 *
 * `parent` is an index in `bodies`, -1 of the base; `joint` one in `joints`, -1 if it is fixed to its parent;
 * `placement` is on the parent as written, `world` in the world. `files` is null if a skeleton is to be drawn, `inertia`
 * if the file gives none, or a density, whose mass follows from graphics. `isFrame`: a frame of the file; `ofSeveral`: the
 * last link of a joint of several variables.
 *
 * @typedef {{
 *   name: string, isNode: boolean, isFrame: boolean, ofSeveral: boolean, parent: number, joint: number, jointName: string | null, parameters: Kleinfinger, placement: Placement,
 *   world: Placement, files: string[] | null, inertia: import("./inertia.js").Inertia | null,
 *   density: number | null, barRadius: number | null,
 * }} Body
 */

/**
 * A joint of one variable, in file order: its body moves about or along the body's z axis. Numbers in rad or m;
 * `actuated` is null where the file leaves it open.
 *
 * @typedef {{
 *   name: string, type: string, body: number, home: number, lower: number, upper: number, velocity: number,
 *   effort: number, actuated: boolean | null,
 * }} Joint
 */

/** @typedef {{ name: string, kind: string, first: number, second: number }} LoopTable ends: indices in `bodies` */

/** @typedef {import("./couplings.js").CouplingTable} CouplingTable */

/**
 * `metre`: metres in the file's unit of length.
 *
 * @typedef {{
 *   name: string, robot: string, path: string | null, movable: boolean, metre: number, bodies: Body[], joints: Joint[],
 *   balls: { name: string, joints: string[] }[], loops: LoopTable[], couplings: CouplingTable[],
 *   sensors: { number: number, port: string, translation: number, rotation: number }[],
 *   sensorConstraints: { body: number, sensors: number[] }[],
 * }} Model
 */

/**
 * Return the tables of one robot of a checked document.
 *
 * @param {Document} document
 * @param {Robot} robot
 * @returns {Model}
 * @throws {import("./problems.js").RaffError} a number is too large for computations
 */
export function model(document, robot) {
  checkSizes(document, robot);
  const flat = expanded(robot);
  const order = [flat.base, ...flat.parts];
  const index = new Map(order.map((node, i) => [node.number, i]));
  const at = (/** @type {number} */ number) => /** @type {number} */ (index.get(number));
  const moving = flat.links.filter((link) => link.type !== FIXED);
  const columns = new Map(moving.map((link, i) => [link.number, i]));
  const bodies = order.map((node) => bodyOf(document, node, at, columns.get(node.number) ?? -1, robot.nodes.get(node.number)));
  placeInWorld(bodies, flat.outward().map((part) => at(part.number)));
  const names = robot.loopNames();
  return {
    name: document.name,
    robot: robot.name,
    path: robot.path,
    movable: robot.movable,
    metre: document.metres(1),
    bodies,
    joints: jointsOf(document, moving, at),
    balls: sphericalJoints(robot),
    loops: robot.loops.map(({ first, second, kind }, i) => ({
      name: names[i], kind: loopKinds[kind], first: at(first), second: at(second),
    })),
    couplings: couplingsOf(document, flat),
    sensors: sensorsOf(document, robot),
    sensorConstraints: robot.sensorConstraints.map(({ node, sensors }) => ({ body: at(node), sensors })),
  };
}

/**
 * @param {Document} document
 * @param {Node} node
 * @param {(number: number) => number} at
 * @param {number} joint
 * @param {Node | undefined} written as the file has it
 * @returns {Body}
 */
function bodyOf(document, node, at, joint, written) {
  const parameters = kleinfinger(document, node.parameters);
  const placement = transform(parameters);
  const { inertial } = node;
  const density = inertial?.density ?? null;
  const radius = inertial?.radius ?? null;
  return {
    name: nameOf(node),
    isNode: written !== undefined,
    isFrame: node.keyword === "frame",
    ofSeveral: written?.keyword === "link" && written.compound !== null,
    parent: node.keyword === "base" ? -1 : at(node.pred),
    joint,
    jointName: node.keyword === "base" ? null : jointOf(node),
    parameters,
    placement,
    world: placement,
    files: node.filenames,
    inertia: inertial && density === null ? statedInertia(document, inertial) : null,
    density,
    barRadius: radius === null ? null : document.metres(radius),
  };
}

/**
 * Put the bodies in the world: parents before their children.
 *
 * @param {Body[]} bodies
 * @param {number[]} outward
 */
function placeInWorld(bodies, outward) {
  for (const i of outward) bodies[i].world = times(bodies[bodies[i].parent].world, bodies[i].placement);
}

/**
 * @param {Document} document
 * @param {Link[]} moving
 * @param {(number: number) => number} at
 * @returns {Joint[]}
 */
function jointsOf(document, moving, at) {
  const areNamed = moving.some((link) => link.actuated); // then all others are passive
  return moving.map((link) => {
    const [lower, upper] = link.limits ?? [-Infinity, Infinity];
    return {
      name: jointOf(link),
      type: jointTypes[link.type],
      body: at(link.number),
      home: inUnits(document, link, link.type === REVOLUTE ? link.parameters.theta : link.parameters.r),
      lower: inUnits(document, link, lower),
      upper: inUnits(document, link, upper),
      velocity: inUnits(document, link, link.velocity ?? Infinity),
      effort: link.effort ?? Infinity,
      actuated: areNamed ? Boolean(link.actuated) : link.actuated,
    };
  });
}

/**
 * The sensors that the robot may follow.
 *
 * @param {Document} document
 * @param {Robot} robot
 */
function sensorsOf(document, robot) {
  if (!robot.sensorConstraints.length) return [];
  const used = new Set(robot.sensorConstraints.flatMap((constraint) => constraint.sensors));
  return document.sensors
    .filter((sensor) => used.has(sensor.number))
    .map(({ number, port, translation, rotation }) => ({ number, port, translation, rotation }));
}
