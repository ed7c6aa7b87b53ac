// Messages to the page about the local session, as cinegen/cockpit/build_messages.py makes them of a served one. What
// only a server computes (reactions, forecasts, the ellipsoid) is left out.

import { valueOf } from "../../../cockpit/static/base/names.js";
import { agreedStatus } from "./report.js";

/** @typedef {import("./session.js").LocalSession} LocalSession */
/** @typedef {import("../../../cockpit/static/base/messages").RobotReport} RobotReport */
/** @typedef {import("../../../cockpit/static/base/messages").TickRate} TickRate */

/**
 * Return a state.
 * @param {LocalSession} session
 * @param {Record<string, RobotReport>} reports last reports, with which statuses must agree
 * @param {number} frame its number
 * @returns {import("../../../cockpit/static/base/messages").StateMessage}
 */
export function stateMessage(session, reports, frame) {
  const robots = [...session.robots.values()];
  const poses = Object.fromEntries(
    robots.map((robot) => [
      robot.name,
      [robot.base, ...robot.kinematics.placements(robot.q)].flatMap((placement) => placement.numbers()),
    ]),
  );
  const tasks = robots.flatMap((robot) => robot.tasks.map((task, i) => ({
      id: task.id,
      node: task.node,
      source: task.source,
      label: task.label,
      error: robot.step.errors[i] ?? [0, 0],
      translation: task.translation,
      rotation: task.rotation,
      weight: task.weight,
      priority: 1,
      robot: robot.name,
      position: robot.placement(task.node).times(task.offset).position.toArray(),
      target: robot.base.times(task.target).numbers(),
    })),
  );
  const statuses = Object.fromEntries(robots.map((robot) => [robot.name, agreedStatus(robot.status(), valueOf(reports, robot.name))]));
  return {
    type: "state",
    time: session.time,
    poses,
    obstacles: {},
    tasks,
    statuses,
    obstructions: {},
    torques: {},
    frame,
    controller: 1,
  };
}

/**
 * Return a report.
 * @param {LocalSession} session
 * @param {Record<string, RobotReport>} robots
 * @param {TickRate} rate
 * @returns {import("../../../cockpit/static/base/messages").ReportMessage}
 */
export function reportMessage(session, robots, rate) {
  const { history, settings, paused, moving, waypoints } = session;
  return {
    sensors: [],
    settings: { ...settings, linear_speed: 0, angular_speed: 0, frame: "world" },
    undo: history.undoCount,
    redo: history.redoCount,
    paused,
    moving,
    recording: null,
    playback: null,
    waypoints: waypoints.infos,
    waypoint: waypoints.target,
    robots,
    switches: [],
    rate,
    clients: 1,
  };
}
