// What users drag, by pointer, as cinegen/session/drags.py does: a mouse is one pointer, a headset has one in each hand.

import { PIN, POINTER } from "./robot.js";

/** @typedef {import("./robot.js").DrivenRobot} DrivenRobot */
/** @typedef {import("./robot.js").Task} Task */
/** @typedef {{ robot: DrivenRobot, task: Task, pin: Task | null }} Drag `pin`: of the node, restored at the end */

export class Drags {
  /** @type {Map<number, Drag>} */
  #drags = new Map();

  /** @param {() => number} newId returns the id of the next task */
  constructor(newId) {
    this.newId = newId;
  }

  /** Whether something is dragged. */
  get busy() {
    return this.#drags.size > 0;
  }

  /** Return the drag of a pointer; null if there is none. @param {number} pointer */
  of(pointer) {
    return this.#drags.get(pointer) ?? null;
  }

  /**
   * Start a drag; one that the same pointer had begun ends.
   * @param {number} pointer
   * @param {DrivenRobot} robot
   * @param {string} node
   * @param {import("./placement.js").Placement} offset
   * @param {[number, number]} dof numbers of translations and rotations that it constrains
   */
  start(pointer, robot, node, offset, dof) {
    this.end(pointer);
    robot.motion = null;
    const others = this.#others(robot, node);
    const pin = others.length > 0 ? null : (robot.recordedPins().find((pinned) => pinned.node === node) ?? null);
    // a pin moves with its node, and is restored at the end
    for (const task of others.length > 0 ? [] : robot.pins(node)) robot.removeTask(task);
    this.#drags.set(pointer, { robot, task: robot.addTask(this.newId(), node, POINTER, offset, dof), pin });
  }

  /**
   * End a drag, or all: null; the task is removed or becomes a pin.
   * @param {number | null} pointer
   * @param {boolean} asPin
   */
  end(pointer = null, asPin = false) {
    for (const key of pointer === null ? [...this.#drags.keys()] : [pointer]) {
      const drag = this.#drags.get(key);
      if (drag === undefined) continue;
      this.#drags.delete(key);
      this.#release(drag, asPin);
    }
  }

  /** End the drag that a task belongs to; return whether there is one. @param {Task} task */
  endOf(task) {
    const pointer = [...this.#drags].find(([, drag]) => drag.task === task)?.[0];
    if (pointer !== undefined) this.end(pointer);
    return pointer !== undefined;
  }

  /** @param {Drag} drag @param {boolean} asPin */
  #release({ robot, task, pin }, asPin) {
    if (asPin) {
      task.source = task.label = PIN;
      return;
    }
    robot.removeTask(task);
    const [other] = this.#others(robot, task.node);
    if (other !== undefined) other.pin ??= pin; // the last drag of a node restores its pin
    else if (pin !== null) robot.restorePin(this.newId(), { ...pin, target: robot.placement(pin.node).times(pin.offset) });
  }

  /** @param {DrivenRobot} robot @param {string} node */
  #others(robot, node) {
    return [...this.#drags.values()].filter((drag) => drag.robot === robot && drag.task.node === node);
  }
}
