// The pose of an edited robot: it stays as it is while only numbers of its text change, if loops can be closed there and
// no limit is passed. Pins stay, too.

const CLOSED = 1e-10;

/** @typedef {import("../session/session.js").LocalSession} LocalSession */
/** @typedef {import("../session/robot.js").Task} Task */
/** @typedef {import("./reading.js").Model} Model */
/** @typedef {{ structure: string, q: Float64Array, pins: Task[] }} Pose */

/**
 * Return the poses of robots by their names.
 *
 * @param {LocalSession | null} session
 * @param {Model[]} models of its robots
 * @returns {Map<string, Pose>}
 */
export function poseOf(session, models) {
  /** @type {Map<string, Pose>} */
  const found = new Map();
  for (const model of models) {
    const robot = session?.robots.get(model.robot);
    if (robot !== undefined) found.set(model.robot, { structure: structureOf(model), q: robot.q.slice(), pins: robot.pins() });
  }
  return found;
}

/**
 * Put robots where they were.
 *
 * @param {Map<string, Pose>} poses
 * @param {LocalSession} session at home
 * @param {Model[]} models
 */
export function keep(poses, session, models) {
  for (const model of models) {
    const pose = poses.get(model.robot);
    const robot = session.robots.get(model.robot);
    if (pose === undefined || robot === undefined || pose.structure !== structureOf(model)) continue;
    const { kinematics } = robot;
    const { q } = pose;
    if (!(kinematics.solver.close(q, kinematics.locked) <= CLOSED) || kinematics.beyond(q).length > 0) continue;
    session.place(model.robot, q);
    for (const { node, translation, rotation } of pose.pins) session.restorePin(model.robot, node, [translation, rotation]);
  }
}

/**
 * Return what of a model is no number that it measures.
 *
 * @param {Model} model
 */
function structureOf({ bodies, joints, loops, couplings }) {
  return JSON.stringify([
    bodies.map(({ name, parent, joint }) => [name, parent, joint]), joints.map(({ name, type }) => [name, type]),
    loops.map(({ kind, first, second }) => [kind, first, second]), couplings.map(({ terms }) => terms.map(({ joint }) => joint)),
  ]);
}
