// The first message of a session with robots that were read from text, as cinegen/cockpit/build_messages.py makes it.

import { nodesOf } from "./placements.js";

/** @typedef {import("../../../cockpit/static/base/messages").HelloMessage} HelloMessage */
/** @typedef {import("../../../cockpit/static/base/messages").RobotDescription} RobotDescription */
/** @typedef {import("./reading.js").Model} Model */
/** @typedef {import("./reading.js").Analysis} Analysis */

const NO_FORCES = "a page without a server computes none";

/**
 * @param {string} title
 * @param {{ model: Model, analysis: Analysis }[]} robots
 * @returns {HelloMessage}
 */
export function helloOf(title, robots) {
  return {
    type: "hello", protocol: 0, client: 1, title, robots: robots.map(({ model, analysis }) => descriptionOf(model, analysis)),
    obstacles: [], sensors: [], switches: [], frames: [], playback: null, stops: [], map: null,
  };
}

/**
 * @param {Model} model
 * @param {Analysis} analysis
 * @returns {RobotDescription}
 */
function descriptionOf(model, { home, actuated, length, mobility }) {
  const { bodies, joints, loops, couplings } = model;
  const bounded = (/** @type {number} */ value) => (Number.isFinite(value) ? value : null);
  const nodes = nodesOf(model).map(({ name, parent, joint }) => {
    let above = parent;
    while (above > 0 && !(bodies[above].isNode && bodies[above].joint >= 0)) above = bodies[above].parent;
    const kind = parent < 0 ? /** @type {const} */ ("base") : joint < 0 ? /** @type {const} */ ("frame") : /** @type {const} */ ("link");
    return { name, parent: parent < 0 ? null : bodies[above].name, joint: joint < 0 ? null : joints[joint].name, kind };
  });
  return {
    name: model.robot, robot: model.robot, length, mobility, end: nodes[nodes.length - 1].name, base: null, nodes,
    joints: joints.map(({ name, type, lower, upper, velocity, effort }, i) => ({
      name, type: type === "prismatic" ? "prismatic" : "revolute", home: home[i], lower: bounded(lower), upper: bounded(upper),
      velocity: bounded(velocity), effort: bounded(effort), actuated: actuated[i],
    })),
    loops: loops.map(({ name, kind, first, second }) => ({ name, kind, first: bodies[first].name, second: bodies[second].name })),
    couplings: couplings.map(({ name, terms, constant, equation }) => ({
      name, terms: Object.fromEntries(terms.map(({ joint, coefficients }) => [joints[joint].name, coefficients])), constant,
      equation,
    })),
    forces: { missing: NO_FORCES, largest_payload: 0, excluded: [] },
  };
}
