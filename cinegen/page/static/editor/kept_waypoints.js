// Waypoints of edited robots. Those that the robots can't reach by the present text are put aside, until they can.

import { MOST } from "../session/waypoints.js";
import { closedAt, structureOf } from "./kept_pose.js";

const MOST_ASIDE = 1000;

/** @typedef {import("../session/session.js").LocalSession} LocalSession */
/** @typedef {import("../session/waypoints.js").SavedWaypoint} SavedWaypoint */
/** @typedef {import("./reading.js").Model} Model */

export class KeptWaypoints {
  /** @type {{ waypoint: SavedWaypoint, structure: string }[]} */
  #aside = [];

  /**
   * Give the waypoints of a session to the one that takes its place. Return the names of those that are put aside now.
   *
   * @param {LocalSession} before
   * @param {Model[]} models of its robots
   * @param {LocalSession} session
   * @param {Model[]} next models of its robots
   */
  pass(before, models, session, next) {
    const [old, structure] = [models, next].map(structureOfAll);
    const own = before.waypoints.saved.map((waypoint) => ({ waypoint, structure: old }));
    /** @type {SavedWaypoint[]} */
    const shown = [];
    const aside = [...own, ...this.#aside].filter((one) => {
      const closed = one.structure === structure && shown.length < MOST ? closedIn(one.waypoint, session) : null;
      if (closed !== null) shown.push(closed);
      return closed === null;
    });
    this.#aside = aside.slice(0, MOST_ASIDE);
    session.waypoints.restore(shown);
    return own.filter((one) => aside.includes(one)).map(({ waypoint: { name } }) => name);
  }
}

/** @param {Model[]} models */
function structureOfAll(models) {
  return JSON.stringify(models.map((model) => [model.robot, structureOf(model)]));
}

/**
 * Return a waypoint with closed loops; null if the robots can't be there.
 *
 * @param {SavedWaypoint} waypoint
 * @param {LocalSession} session
 * @returns {SavedWaypoint | null}
 */
function closedIn({ name, configurations }, session) {
  const found = new Map([...configurations].map(([robot, q]) => [robot, closedAt(q, session.robots.get(robot))]));
  const whole = [...found.values()].every((q) => q !== null);
  return whole ? { name, configurations: /** @type {Map<string, Float64Array>} */ (found) } : null;
}
