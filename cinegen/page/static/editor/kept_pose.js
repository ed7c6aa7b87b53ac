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
    const q = closedAt(pose.q, robot);
    if (q === null) continue;
    session.place(model.robot, q);
    for (const { node, translation, rotation } of pose.pins) session.restorePin(model.robot, node, [translation, rotation]);
  }
}

/**
 * Return a configuration with closed loops, at the same values of the actuated joints; null if there is none, or none within
 * the limits.
 *
 * @param {Float64Array} q
 * @param {import("../session/robot.js").DrivenRobot | undefined} robot
 */
export function closedAt(q, robot) {
  if (robot === undefined) return null;
  const { kinematics } = robot;
  const closed = q.slice();
  const isClosed = kinematics.solver.close(closed, kinematics.locked) <= CLOSED;
  return isClosed && kinematics.beyond(closed).length === 0 ? closed : null;
}

/**
 * Return what of a model is no number that it measures.
 *
 * @param {Model} model
 */
export function structureOf({ bodies, joints, loops, couplings }) {
  return JSON.stringify([
    bodies.map(({ name, parent, joint }) => [name, parent, joint]), joints.map(({ name, type }) => [name, type]),
    loops.map(({ kind, first, second }) => [kind, first, second]), couplings.map(({ terms }) => terms.map(({ joint }) => joint)),
  ]);
}
