// The solver of one robot: its translated kernels (cinegen/page/kernels_module.py), with arrays in and out. Kernels have
// frames of twelve numbers: three axes, then the origin (m).

import { Matrix4, Quaternion, Vector3 } from "three";

/** @typedef {import("./solver_interface").Solver} Solver */
/** @typedef {import("./solver_interface").Kernels} Kernels */
/** @typedef {import("./solver_interface").SolverTask} SolverTask */

const FRAME = 12;
const POSE = 7;
const [FEWEST, WORK] = [4, 1200]; // tasks; tasks times joints: with more a tick takes longer than a frame

/** @implements {Solver} */
export class KernelSolver {
  /** The configuration of the poses that were computed last. @type {Float64Array} */
  #placed;
  /** @type {Float64Array | null} */
  #poses = null;

  /** @param {Kernels} kernels */
  constructor(kernels) {
    this.kernels = kernels;
    this.names = { joints: kernels.names.q, nodes: kernels.names.nodes };
    this.floating = kernels.names.floating;
    this.nq = kernels.q.length;
    this.mostTasks = Math.min(kernels.task_node.length, Math.max(FEWEST, Math.floor(WORK / kernels.locked.length)));
    this.q = kernels.q.slice();
    kernels.tasks[0] = 0;
    this.#placed = new Float64Array(this.nq).fill(NaN);
  }

  /** @param {Float64Array} q */
  fk(q) {
    const { kernels } = this;
    this.#moveTo(q);
    if (this.#poses !== null && this.#placed.every((value, i) => value === kernels.q[i])) return this.#poses;
    kernels.place();
    this.#placed.set(kernels.q);
    const poses = new Float64Array(POSE * kernels.names.nodes.length);
    for (let i = 0; i < kernels.names.nodes.length; i += 1) writePose(kernels.node_frame, FRAME * i, poses, POSE * i);
    this.#poses = poses;
    return poses;
  }

  /** @param {Float64Array} q @param {Uint8Array} locked */
  close(q, locked) {
    const { kernels } = this;
    kernels.trial.set(q);
    kernels.names.velocities.forEach((index, k) => {
      if (index >= 0 && locked[index]) kernels.locked[k] = 1;
    });
    const gap = kernels.close();
    kernels.locked.fill(0);
    q.set(kernels.trial);
    return gap;
  }

  /** @param {Float64Array} q @param {ArrayLike<number>} goal */
  follow(q, goal) {
    this.#moveTo(q);
    this.kernels.goal.set(goal);
    return this.kernels.forward() ? this.kernels.q.slice() : null;
  }

  /**
   * @param {Float64Array} q
   * @param {SolverTask[]} tasks
   * @param {{ dt: number, gain: number, damping: number }} options
   */
  tick(q, tasks, { dt, gain, damping }) {
    const { kernels } = this;
    this.#moveTo(q);
    this.#take(tasks);
    kernels.gain[0] = -Math.expm1(-gain * dt);
    kernels.damping_threshold[0] = damping;
    const status = kernels.names.statuses[kernels.step()];
    q.set(kernels.q);
    const stopped = [...kernels.record_stopped.keys()].filter((k) => kernels.record_stopped[k] !== 0);
    return {
      status,
      saturated: stopped.map((k) => kernels.names.velocities[k]).filter((index) => index >= 0),
      errors: tasks.map((_, i) => /** @type {[number, number]} */ ([kernels.record_errors[2 * i], kernels.record_errors[2 * i + 1]])),
      closure: kernels.closure[0],
    };
  }

  /** @param {Float64Array} q @param {SolverTask[]} tasks */
  sigma(q, tasks) {
    const { kernels } = this;
    this.#moveTo(q);
    this.#take(tasks);
    kernels.find_sigma();
    /** @param {Float64Array} sigma */
    const known = ([sigma]) => (Number.isNaN(sigma) ? null : sigma);
    return { type1: known(kernels.sigma_tasks), type2: known(kernels.sigma_passive) };
  }

  /**
   * Move to a configuration with closed loops, at rest there; stay as it moves if it is there already.
   * @param {Float64Array} q
   */
  #moveTo(q) {
    const { kernels } = this;
    if (kernels.q.every((value, i) => value === q[i])) return;
    kernels.trial.set(q);
    kernels.set_q();
  }

  /** @param {SolverTask[]} tasks */
  #take(tasks) {
    const { kernels } = this;
    let changed = kernels.tasks[0] !== tasks.length;
    /** @param {Float64Array | Int32Array} array @param {number} at @param {ArrayLike<number>} values */
    const write = (array, at, values) => {
      for (let k = 0; k < values.length; k += 1) {
        changed ||= array[at + k] !== values[k];
        array[at + k] = values[k];
      }
    };
    tasks.forEach(({ node, offset, target, translation, rotation, weight }, i) => {
      write(kernels.task_node, i, [node]);
      write(kernels.task_offset, FRAME * i, frameOf(offset));
      write(kernels.task_dof, 2 * i, [translation, rotation]);
      write(kernels.task_weight, i, [weight]);
      kernels.task_target.set(frameOf(target), FRAME * i);
    });
    if (!changed) return;
    kernels.tasks[0] = tasks.length;
    kernels.take_tasks();
  }
}

const matrix = new Matrix4();
const turn = new Quaternion();

/**
 * Write the position and quaternion x y z w of a frame.
 * @param {Float64Array} frames
 * @param {number} from
 * @param {Float64Array} poses
 * @param {number} to
 */
function writePose(frames, from, poses, to) {
  const at = (/** @type {number} */ k) => frames[from + k];
  matrix.set(at(0), at(3), at(6), 0, at(1), at(4), at(7), 0, at(2), at(5), at(8), 0, 0, 0, 0, 1);
  for (let k = 0; k < 3; k += 1) poses[to + k] = at(9 + k);
  turn.setFromRotationMatrix(matrix).toArray(/** @type {any} */ (poses), to + 3);
}

/** Return the frame of a position and a quaternion x y z w of length 1. @param {ArrayLike<number>} pose */
function frameOf(pose) {
  const rotation = new Quaternion(pose[3], pose[4], pose[5], pose[6]);
  const axes = [new Vector3(1, 0, 0), new Vector3(0, 1, 0), new Vector3(0, 0, 1)].map((axis) => axis.applyQuaternion(rotation));
  return [...axes.flatMap((axis) => axis.toArray()), pose[0], pose[1], pose[2]];
}
