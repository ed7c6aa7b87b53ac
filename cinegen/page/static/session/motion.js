// Motions of a robot that no task causes, as cinegen/session/motion.py has them: of single joints, to a configuration,
// and of undo. Each has `advance(dt)`: the configuration after dt (s), with closed loops, or null when it has ended.

import { Placement } from "./placement.js";

/** @typedef {import("./kinematics.js").Kinematics} Kinematics */
/** @typedef {Float64Array} Configuration */

const FASTEST = 2; // rad/s, or characteristic lengths per second: of a joint without a velocity limit
const [SHORTEST, LONGEST] = [0.3, 30]; // s for a motion to a configuration
const THERE = 1e-6; // rad or lengths: distance at which a configuration is reached
const RETRACED = 1.5; // s: longest duration of an undo

/**
 * A motion of a robot. `name` is its name in the state, `label` a few words for people, `problem` the reason why it did
 * not do all that it should.
 * @typedef {{ name: string, label: string, problem: string, advance: (dt: number) => Configuration | null }} Motion
 */

/** Return the text on joints at their limits, of which the first two are named. @param {string[]} joints */
export function atLimit(joints) {
  return `at the limit of ${joints.slice(0, 2).join(" and ")}`;
}

/**
 * The minimum-jerk profile, 0 to 1 (T. Flash and N. Hogan, "The coordination of arm movements", 1985).
 * @param {number} part
 */
function eased(part) {
  const u = Math.min(Math.max(part, 0), 1);
  return u * u * u * (10 - u * (15 - 6 * u));
}

/**
 * Return the velocity at which a joint is moved, rad/s or m/s.
 * @param {Kinematics} kinematics
 * @param {import("./kinematics.js").Joint} joint
 */
function speedOf(kinematics, joint) {
  return joint.velocity ?? FASTEST * kinematics.scale(joint);
}

/** Motion of single actuated joints, within their velocity limits. Passive joints follow on this branch. */
export class JointMotion {
  name = "joints";
  label = "joint motion";
  problem = "";
  /** @type {Map<string, number>} */
  #goal = new Map();
  #ends = false;

  /** @param {Kinematics} kinematics @param {Configuration} q with closed loops */
  constructor(kinematics, q) {
    this.kinematics = kinematics;
    /** @type {Configuration} */
    this.q = q.slice();
  }

  /** Set the goal of a joint (rad or m), clipped to its limits. @param {string} name @param {number} value */
  move(name, value) {
    const { lower, upper } = this.kinematics.joint(name);
    this.#goal.set(name, Math.min(Math.max(value, lower ?? -Infinity), upper ?? Infinity));
  }

  /** End the motion when all joints have arrived. */
  end() {
    this.#ends = true;
  }

  /** @param {number} dt */
  advance(dt) {
    const { kinematics } = this;
    /** @type {Map<string, number>} */
    const values = new Map();
    for (const [name, goal] of this.#goal) {
      const joint = kinematics.joint(name);
      const current = this.q[joint.index];
      const most = speedOf(kinematics, joint) * dt;
      if (current !== goal) values.set(name, current + Math.min(Math.max(goal - current, -most), most));
    }
    if (values.size === 0) return this.#ends ? null : this.q;
    const q = kinematics.follow(this.q, values);
    const passed = q === null ? "" : kinematics.passedLimit(q, this.q);
    this.problem = q === null ? "its loops can't follow on this branch" : passed && atLimit([passed]);
    if (q === null || passed) {
      this.#goal.clear(); // the next movement of a slider tries again
      return this.#ends ? null : this.q;
    }
    this.q = q;
    return q;
  }
}

/** A motion that advances with time. */
class TimedMotion {
  problem = "";
  #time = 0;

  /** @param {string} name @param {string} label @param {number} seconds */
  constructor(name, label, seconds) {
    this.name = name;
    this.label = label;
    this.seconds = seconds;
  }

  /** Return the fraction of the path after dt (s), 0 to 1; null when the motion has ended. @param {number} dt */
  fraction(dt) {
    if (this.#time >= this.seconds) return null;
    this.#time += dt;
    return this.#time < this.seconds ? eased(this.#time / this.seconds) : 1;
  }

  stop() {
    this.#time = Infinity;
  }
}

/**
 * Motion to a configuration: actuated joints are interpolated, passive ones follow. A goal that can't be reached so on
 * this branch is set at once.
 */
export class ConfigurationMotion extends TimedMotion {
  /**
   * @param {Kinematics} kinematics
   * @param {Configuration} q with closed loops
   * @param {Configuration} goal with closed loops
   * @param {string} name
   * @param {string} label
   */
  constructor(kinematics, q, goal, name, label) {
    const seconds = kinematics.actuated.map((joint) => Math.abs(goal[joint.index] - q[joint.index]) / speedOf(kinematics, joint));
    super(name, label, Math.min(Math.max(2 * Math.max(0, ...seconds), SHORTEST), LONGEST));
    this.kinematics = kinematics;
    this.start = q.slice();
    this.q = q;
    this.goal = goal;
  }

  /** @param {number} dt */
  advance(dt) {
    const x = this.fraction(dt);
    if (x === null) return null;
    const { kinematics, start, goal } = this;
    const values = new Map(kinematics.actuated.map(({ name, index }) => [name, (1 - x) * start[index] + x * goal[index]]));
    const q = kinematics.follow(this.q, values);
    if (q !== null && kinematics.solver.floating) q.set(Placement.of(start).towards(Placement.of(goal), x).numbers());
    if (q === null || (x === 1 && kinematics.distance(q, goal) > THERE)) {
      this.stop();
      this.problem = "the goal is in another assembly mode: the robot was moved there without a path";
      return goal;
    }
    this.q = q;
    return x < 1 ? q : goal;
  }
}

/** Motion through recorded configurations. */
export class Retrace extends TimedMotion {
  /**
   * @param {Configuration[]} trace
   * @param {number} period time between two of them, s
   * @param {string} name
   * @param {string} label
   */
  constructor(trace, period, name, label) {
    super(name, label, Math.min(period * (trace.length - 1), RETRACED));
    this.trace = trace;
  }

  /** @param {number} dt */
  advance(dt) {
    const x = this.fraction(dt);
    return x === null ? null : this.trace[Math.round(x * (this.trace.length - 1))];
  }
}
