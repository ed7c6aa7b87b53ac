// The kinematics of one robot: its solver, with names instead of indices.

import { Placement } from "./placement.js";

const LIMIT = 1e-9; // rad or m: rounding at a limit
const POSE = 7;

/** @typedef {import("./solver_interface").Solver} Solver */
/** @typedef {import("../../../cockpit/static/base/messages").RobotDescription} RobotDescription */
/** @typedef {import("../../../cockpit/static/base/messages").JointDescription & { index: number }} Joint */
/** @typedef {import("./robot.js").Task} Task */

export class Kinematics {
  /** @type {Map<string, number>} */
  #nodes;
  /** @type {Map<string, Joint>} */
  #joints;

  /**
   * @param {RobotDescription} description
   * @param {Solver} solver
   * @param {ArrayLike<number>} start configuration with closed loops
   */
  constructor(description, solver, start) {
    const { name, length, end, joints, nodes } = description;
    this.solver = solver;
    this.length = length;
    this.end = end;
    this.home = Float64Array.from(start);
    this.nodes = nodes.map((node) => node.name);
    this.#nodes = new Map(solver.names.nodes.map((node, i) => [node, i]));
    const index = new Map(solver.names.joints.map((joint, i) => [joint, i]));
    /** @type {Joint[]} */
    this.joints = joints.map((joint) => ({ ...joint, index: index.get(joint.name) ?? -1 }));
    this.#joints = new Map(this.joints.map((joint) => [joint.name, joint]));
    this.actuated = this.joints.filter(({ actuated }) => actuated);
    this.locked = new Uint8Array(solver.nq);
    for (const joint of this.actuated) this.locked[joint.index] = 1;
    const missing = [...this.joints.filter((joint) => joint.index < 0), ...nodes.filter((node) => !this.has(node.name))];
    if (missing.length > 0) throw new Error(`the solver of ${name} does not know ${missing.map((joint) => joint.name).join(", ")}`);
  }

  /** @param {string} node */
  has(node) {
    return this.#nodes.has(node);
  }

  /** @param {string} name @returns {Joint} */
  joint(name) {
    const joint = this.#joints.get(name);
    if (joint === undefined) throw new Error(`no joint '${name}'`);
    return joint;
  }

  /**
   * Return what one radian of a joint is: 1, or the characteristic length of a prismatic joint (m).
   * @param {Joint} joint
   */
  scale(joint) {
    return joint.type === "prismatic" ? this.length : 1;
  }

  /**
   * Return the placements of all nodes in the robot's own world, in the order of its description.
   * @param {Float64Array} q
   */
  placements(q) {
    const poses = this.solver.fk(q);
    return this.nodes.map((node) => Placement.of(poses, POSE * this.#index(node)));
  }

  /** @param {Float64Array} q @param {string} node */
  placement(q, node) {
    return Placement.of(this.solver.fk(q), POSE * this.#index(node));
  }

  /** Return the largest residual of the loops, rad or characteristic lengths. @param {Float64Array} q */
  closure(q) {
    return this.solver.close(q.slice(), new Uint8Array(q.length).fill(1));
  }

  /**
   * Return the configuration in which actuated joints have the given values, and passive ones follow on this branch;
   * null if they can't.
   * @param {Float64Array} q with closed loops
   * @param {Map<string, number>} values rad or m
   */
  follow(q, values) {
    return this.solver.follow(q, this.actuated.map(({ name, index }) => values.get(name) ?? q[index]));
  }

  /**
   * Return the first joint that is beyond a limit at q, and further than before; "" if there is none.
   * @param {Float64Array} q
   * @param {Float64Array} before
   */
  passedLimit(q, before) {
    for (const { name, index, lower, upper } of this.joints) {
      const moved = q[index] - before[index];
      if (lower !== null && q[index] < lower - LIMIT && moved < 0) return name;
      if (upper !== null && q[index] > upper + LIMIT && moved > 0) return name;
    }
    return "";
  }

  /** Return the joints of q that are beyond a limit. @param {Float64Array} q */
  beyond(q) {
    return this.joints.filter(({ index, lower, upper }) => !(q[index] >= (lower ?? -Infinity) - LIMIT && q[index] <= (upper ?? Infinity) + LIMIT));
  }

  /**
   * Return the largest difference of a joint, rad or characteristic lengths.
   * @param {Float64Array} from
   * @param {Float64Array} to
   */
  distance(from, to) {
    return Math.max(0, ...this.joints.map((joint) => Math.abs(from[joint.index] - to[joint.index]) / this.scale(joint)));
  }

  /**
   * Move a robot by one tick towards the targets of its tasks.
   * @param {import("./robot.js").DrivenRobot} robot
   * @returns {import("./robot.js").Step}
   */
  step({ q, tasks, dt, gain, damping }) {
    const { status, saturated, errors, closure } = this.solver.tick(q, tasks.map((task) => this.#known(task)), { dt, gain, damping });
    return { status, saturated: saturated.map((i) => this.solver.names.joints[i]), errors, closure };
  }

  /**
   * Return the smallest singular values of tasks, or of the robot's end without tasks, and of the passive joints.
   * @param {Float64Array} q
   * @param {Task[]} tasks
   */
  singularValues(q, tasks) {
    const end = { node: this.#index(this.end), offset: new Placement().numbers(), translation: 3, rotation: 3, weight: 1 };
    const known = tasks.map((task) => this.#known(task));
    return this.solver.sigma(q, known.length > 0 ? known : [{ ...end, target: this.placement(q, this.end).numbers() }]);
  }

  /** @param {Task} task */
  #known({ node, offset, target, translation, rotation, weight }) {
    return { node: this.#index(node), offset: offset.numbers(), target: target.numbers(), translation, rotation, weight };
  }

  /** @param {string} node */
  #index(node) {
    return /** @type {number} */ (this.#nodes.get(node));
  }
}
