// Named configurations of all robots, to which they move, one by one or in order; as cinegen/session/waypoints.py has
// them, but without recordings.

import { ConfigurationMotion } from "./motion.js";

const MOST = 50; // waypoints of a session
const LONGEST = 40; // characters of a name
const THERE = 1e-6; // rad or lengths: distance at which a waypoint is reached

/** @typedef {import("./robot.js").DrivenRobot} DrivenRobot */
/** @typedef {{ id: number, name: string, configurations: Map<string, Float64Array> }} Waypoint */

/** A waypoint does not exist, can't be saved, or can't be played. */
export class WaypointError extends Error {}

export class Waypoints {
  /** @type {Waypoint[]} */
  #all = [];
  /** @type {Waypoint | null} */
  #target = null;
  /** @type {Waypoint[]} */
  #next = [];
  /** @type {Map<string, ConfigurationMotion>} */
  #motions = new Map();
  #last = ""; // name of the waypoint that was reached before
  #plays = false; // whether the motion goes through several waypoints

  /** @param {Map<string, DrivenRobot>} robots @param {() => number} newId returns the id of the next waypoint */
  constructor(robots, newId) {
    this.robots = robots;
    this.newId = newId;
  }

  /** Ids and names, in order. */
  get infos() {
    return this.#all.map(({ id, name }) => ({ id, name }));
  }

  /** Id of the waypoint that the robots move to; null without such a motion. */
  get target() {
    return this.#target?.id ?? null;
  }

  /** Save the present configurations as the last waypoint. @param {string} name */
  save(name) {
    checkName(name);
    if (this.#all.length >= MOST) throw new WaypointError(`there are ${MOST} waypoints: remove some first`);
    const configurations = new Map([...this.robots].map(([key, { q }]) => [key, q.slice()]));
    this.#all.push({ id: this.newId(), name, configurations });
  }

  /**
   * Rename a waypoint, or move it to another index.
   * @param {{ waypoint: number, name?: string | null, index?: number | null }} change
   */
  change({ waypoint, name = null, index = null }) {
    const saved = this.#found(waypoint);
    if (name !== null) checkName(name);
    if (index !== null && !(Number.isInteger(index) && index >= 0)) throw new WaypointError(`an index is 0 or more, not ${index}`);
    saved.name = name ?? saved.name;
    if (index === null) return;
    this.remove(waypoint);
    this.#all.splice(index, 0, saved);
  }

  /** Remove a waypoint; a motion to it goes on. @param {number} id */
  remove(id) {
    this.#all.splice(this.#all.indexOf(this.#found(id)), 1);
  }

  /** @param {number} id */
  #found(id) {
    const waypoint = this.#all.find((waypoint) => waypoint.id === id);
    if (waypoint === undefined) throw new WaypointError("this waypoint was removed");
    return waypoint;
  }

  /** Start a motion to a waypoint, which replaces all other motions. @param {number} id */
  moveTo(id) {
    this.#start([this.#found(id)]);
  }

  /** Start a motion through all waypoints, which replaces all other motions. */
  play() {
    if (this.#all.length < 2) throw new WaypointError("save two waypoints or more to play them");
    this.#start(this.#all);
    this.#plays = true;
  }

  /** End the motion; the robots stay where they are. */
  stop() {
    for (const [name, motion] of this.#motions) {
      const robot = this.#robot(name);
      if (robot.motion === motion) robot.motion = null;
    }
    this.#target = null;
    this.#next = [];
    this.#motions.clear();
    this.#plays = false;
  }

  /** Go on after each tick of the robots. Return a message for people; mostly an empty one. */
  tick() {
    if (this.#target === null) return "";
    for (const [name, motion] of this.#motions) {
      const robot = this.#robot(name);
      if (motion.problem !== "") {
        const again = this.#last ? `drag it there from '${this.#last}' and save it again, or remove it` : "play again";
        return this.#fail(`${name} can't reach '${this.#target.name}' on a path: ${again}`);
      }
      if (robot.motion !== null && robot.motion !== motion) return this.#fail(`another motion moves ${name}`);
    }
    if ([...this.#motions.keys()].some((name) => this.#robot(name).motion !== null)) return "";
    for (const [name, goal] of this.#target.configurations) {
      const { kinematics, q } = this.#robot(name);
      if (kinematics.distance(q, goal) > THERE) return this.#fail(`${name} did not reach '${this.#target.name}'`);
    }
    this.#last = this.#target.name;
    const next = this.#next.shift();
    if (next === undefined) this.stop();
    else this.#begin(next);
    return "";
  }

  /** @param {Waypoint[]} waypoints */
  #start(waypoints) {
    this.stop();
    this.#last = "";
    const [first, ...others] = waypoints;
    this.#next = others;
    this.#begin(first);
  }

  /** @param {Waypoint} waypoint */
  #begin(waypoint) {
    this.#target = waypoint;
    for (const [name, goal] of waypoint.configurations) {
      const robot = this.#robot(name);
      const motion = new ConfigurationMotion(robot.kinematics, robot.q, goal, "waypoint", `moving to ${waypoint.name}`);
      robot.motion = motion;
      this.#motions.set(name, motion);
    }
  }

  /**
   * End the motion; return a message, which the robots' own messages are enough for where nothing is played.
   * @param {string} reason
   */
  #fail(reason) {
    const plays = this.#plays;
    this.stop();
    return plays ? `waypoints are no longer played: ${reason}` : "";
  }

  /** @param {string} name */
  #robot(name) {
    return /** @type {DrivenRobot} */ (this.robots.get(name));
  }
}

/** @param {string} name */
function checkName(name) {
  if (typeof name !== "string" || name === "" || [...name].length > LONGEST) throw new WaypointError(`a name has 1 to ${LONGEST} characters`);
}
