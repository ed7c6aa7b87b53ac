// Reports on a moving robot: limits that are near, and distances to singularities; as cinegen/session/report.py has them.

/** @typedef {import("./robot.js").DrivenRobot} DrivenRobot */
/** @typedef {import("../../../cockpit/static/base/messages").RobotReport} RobotReport */
/** @typedef {import("../../../cockpit/static/base/messages").SingularityReport} SingularityReport */
/** @typedef {import("../../../cockpit/static/base/messages").RobotStatus} RobotStatus */

const NEAR_SINGULAR = 0.05;
const CLEAR = 0.08; // fraction of a joint's range that is near its limit
const WORSE = ["BAD_TARGET", "REFUSED"];
const OBSTRUCTED = ["AT_LIMIT", "OUT_OF_REACH"];

/** Return a report on a robot. @param {DrivenRobot} robot @returns {RobotReport} */
export function robotReport(robot) {
  const { kinematics, q, step } = robot;
  const { type1, type2 } = kinematics.singularValues(q, robot.tasks);
  const near = kinematics.joints.filter(({ index, lower, upper }) => {
    if (lower === null || upper === null) return false;
    return Math.min(q[index] - lower, upper - q[index]) < CLEAR * (upper - lower);
  });
  return {
    q: kinematics.joints.map(({ index }) => q[index]),
    saturated: step.saturated,
    near_limit: near.map(({ name }) => name),
    closure: step.closure,
    type1: singularity(robot, type1, "hardly any motion in one direction", "the motion that is hardest"),
    type2: singularity(robot, type2, "the actuated joints hardly control a motion", "the motion that is controlled least"),
    ellipsoid: null,
    forecast: { path: [], events: [] },
  };
}

/**
 * @param {DrivenRobot} robot
 * @param {number | null} sigma
 * @param {string} close text near the singularity
 * @param {string} far text elsewhere
 * @returns {SingularityReport | null}
 */
function singularity(robot, sigma, close, far) {
  if (sigma === null) return null;
  const node = robot.tasks[0]?.node ?? robot.kinematics.end;
  const text = sigma < NEAR_SINGULAR ? close : far;
  return { sigma, threshold: NEAR_SINGULAR, text, node, position: robot.placement(node).position.toArray(), twist: [] };
}

/**
 * Return the status of a robot in agreement with the singular values in a report on it.
 * @param {RobotStatus} status
 * @param {RobotReport | undefined} report
 * @returns {RobotStatus}
 */
export function agreedStatus(status, report) {
  if (report === undefined || WORSE.includes(status.name)) return status;
  const { type1, type2 } = report;
  if (type2 !== null && type2.sigma < type2.threshold) {
    return { name: "UNCONTROLLED", label: "near a singularity: uncontrolled DoF", description: type2.text };
  }
  const near = type1 !== null && type1.sigma < type1.threshold;
  if (OBSTRUCTED.includes(status.name)) return near ? { ...status, label: `${status.label}, near a singularity` } : status;
  if (near) return { name: "SINGULAR", label: "near a singularity: lost DoF", description: type1.text };
  if (status.name !== "SINGULAR") return status;
  return { name: "DAMPED", label: "motion is damped", description: "the damping threshold is above the singular value" };
}
