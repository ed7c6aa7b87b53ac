// One robot of the session, with its base pose, its tasks, and its motion in a tick; as cinegen/session/robot.py has it.

import { atLimit } from "./motion.js";
import { Placement } from "./placement.js";

/** Sources of tasks. */
export const POINTER = "pointer";
export const PIN = "pin";

/** @type {Record<string, string>} */
const DESCRIPTIONS = {
  BAD_TARGET: "a task has an invalid target, weight or other value: it is left out",
  REFUSED: "the loops could not be closed after any fraction of the step: the configuration is unchanged",
  AT_LIMIT: "a joint limit restricts the motion",
  SINGULAR: "near a singularity: motion is damped",
  OUT_OF_REACH: "the motion has stopped and a target is not reached",
  FOLLOWING: "every task is followed",
  IDLE: "there is no task",
};
const FAR = 1e-3; // characteristic lengths: a smaller distance is given as an angle

/** @typedef {import("./kinematics.js").Kinematics} Kinematics */
/** @typedef {import("./motion.js").Motion} Motion */
/**
 * A task: `offset` is the frame that it constrains, in the node's frame; `target` its target, in the robot's own world.
 * @typedef {{ id: number, node: string, source: string, label: string, offset: Placement, target: Placement,
 *   translation: number, rotation: number, weight: number }} Task
 */
/** @typedef {{ status: string, saturated: string[], errors: [number, number][], closure: number }} Step */

export class DrivenRobot {
  /** Base pose: placement of its own world in the session's. */
  base = new Placement();
  /** @type {Task[]} */
  tasks = [];
  /** @type {Motion | null} */
  motion = null;
  gain = 100; // 1/s
  damping = 0.05;
  dt = 1 / 240; // s: period of the last tick

  /** @param {string} name @param {Kinematics} kinematics */
  constructor(name, kinematics) {
    this.name = name;
    this.kinematics = kinematics;
    this.home = kinematics.home.slice();
    this.q = this.home.slice();
    /** @type {Step} */
    this.step = { status: "IDLE", saturated: [], errors: [], closure: kinematics.closure(this.q) };
  }

  /** Return the placement of a node in the session's world. @param {string} node */
  placement(node) {
    return this.base.times(this.kinematics.placement(this.q, node));
  }

  /**
   * Add a task at the present pose of a node.
   * @param {number} id
   * @param {string} node
   * @param {string} source
   * @param {Placement} offset
   * @param {[number, number]} dof number of translations and rotations to constrain
   */
  addTask(id, node, source, offset = new Placement(), [translation, rotation] = [3, 3]) {
    const target = this.kinematics.placement(this.q, node).times(offset);
    const task = { id, node, source, label: source, offset, target, translation, rotation, weight: 1 };
    this.tasks.push(task);
    return task;
  }

  /** @param {Task} task */
  removeTask(task) {
    this.tasks = this.tasks.filter((other) => other !== task);
  }

  /** @param {string | null} node */
  pins(node = null) {
    return this.tasks.filter((task) => task.source === PIN && (node === null || task.node === node));
  }

  /** Return copies of its pins, with targets in the session's world. */
  recordedPins() {
    return this.pins().map((pin) => ({ ...pin, offset: pin.offset.clone(), target: this.base.times(pin.target) }));
  }

  /** Add a pin again. @param {number} id @param {Task} pin with its target in the session's world */
  restorePin(id, pin) {
    this.tasks.push({ ...pin, id, target: this.base.inverseTimes(pin.target) });
  }

  /** @param {Placement} base */
  setBase(base) {
    const moved = base.inverseTimes(this.base);
    this.base = base;
    for (const task of this.tasks) task.target = moved.times(task.target); // it keeps its pose in the session's world
  }

  /** Move by one tick of dt (s). Return a message for people; mostly an empty one. @param {number} dt */
  tick(dt) {
    this.dt = dt;
    if (this.motion === null) {
      this.step = this.kinematics.step(this);
      return "";
    }
    const q = this.motion.advance(dt);
    if (q !== null) {
      this.jumpTo(q);
      return "";
    }
    const { problem } = this.motion;
    this.motion = null;
    return problem && `${this.name}: ${problem}`;
  }

  /**
   * Set the configuration, with closed loops, and the targets of its tasks to their present poses.
   * @param {Float64Array} q
   */
  jumpTo(q) {
    if (q.some((value, i) => value !== this.q[i])) {
      this.q.set(q);
      for (const task of this.tasks) task.target = this.kinematics.placement(this.q, task.node).times(task.offset);
    }
    this.step = this.kinematics.step(this);
  }

  /** Return the status of the last tick. */
  status() {
    const { motion, step } = this;
    if (motion !== null) {
      return { name: motion.name.toUpperCase(), label: motion.problem || motion.label, description: `${this.name}: ${motion.label}` };
    }
    let label = step.status.toLowerCase().replaceAll("_", " ");
    if (step.status === "AT_LIMIT" && step.saturated.length > 0) label = atLimit(step.saturated);
    if (step.status === "OUT_OF_REACH") {
      const [metres, angle] = [0, 1].map((i) => Math.max(...step.errors.map((error) => error[i])));
      const far = metres > this.kinematics.length * Math.min(FAR, angle); // not 0 degrees
      label += far ? ` by ${short(1e3 * metres)} mm` : ` by ${short((180 / Math.PI) * angle)}°`;
    }
    return { name: step.status, label, description: DESCRIPTIONS[step.status] ?? "" };
  }
}

/** @param {number} value */
function short(value) {
  return String(Number(value.toPrecision(3)));
}
