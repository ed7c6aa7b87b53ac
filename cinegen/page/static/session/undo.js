// Steps that people can undo and redo, with the path that the robots took in each; as cinegen/session/undo.py has them.

import { ConfigurationMotion, Retrace } from "./motion.js";

const MOST = 100; // undo steps that are kept
const LONGEST = 600; // configurations of a trace; a longer one is thinned
const RATE = 60; // configurations per second
const NEAR = 0.05; // rad or lengths from the start of a trace: near enough to retrace it
const SAME = [1e-9, 1e-5]; // absolute and relative difference of two values that count as equal

/** @typedef {import("./robot.js").DrivenRobot} DrivenRobot */
/** @typedef {import("./robot.js").Task} Task */
/** @typedef {Map<string, DrivenRobot>} Robots */
/** @typedef {Map<string, { q: Float64Array, pins: Task[] }>} Snapshot configuration and pins of each robot */
/** @typedef {{ before: Snapshot, after: Snapshot, trace: MotionTrace }} UndoStep */

/** Configurations of robots over time. */
class MotionTrace {
  period = 1 / RATE;
  /** @type {Map<string, Float64Array[]>} */
  configurations = new Map();
  #every = 1;
  #count = 0;

  /** Add the present configurations; called once in an initial period. @param {Robots} robots */
  note(robots) {
    const skipped = this.#count % this.#every !== 0;
    this.#count += 1;
    if (skipped) return;
    for (const [name, robot] of robots) {
      const trace = this.configurations.get(name) ?? [];
      trace.push(robot.q.slice());
      this.configurations.set(name, trace);
    }
    if (![...this.configurations.values()].some((trace) => trace.length > LONGEST)) return;
    for (const [name, trace] of this.configurations) this.configurations.set(name, trace.filter((_, i) => i % 2 === 0));
    this.#every *= 2;
    this.period *= 2;
  }
}

export class UndoHistory {
  /** @type {UndoStep[]} */
  #done = [];
  /** @type {UndoStep[]} */
  #undone = [];
  /** @type {{ before: Snapshot, trace: MotionTrace } | null} */
  #open = null;
  /** @type {Snapshot | null} */
  #goal = null; // of an undo or redo in progress
  #ticks = 0;

  /** @param {Robots} robots @param {() => number} newId returns the id of the next task */
  constructor(robots, newId) {
    this.robots = robots;
    this.newId = newId;
  }

  /** Number of steps that can be undone. */
  get undoCount() {
    return this.#done.length + (this.#open === null ? 0 : 1);
  }

  /** Number of steps that can be redone. */
  get redoCount() {
    return this.#undone.length;
  }

  /** Begin a step, unless one is in progress. */
  begin() {
    const goal = this.#goal;
    if (goal !== null) { // an undo is interrupted: it is finished at once
      this.#goal = null;
      for (const [name, robot] of this.robots) {
        robot.motion = null;
        robot.jumpTo(/** @type {{ q: Float64Array }} */ (goal.get(name)).q);
      }
      this.#restorePins(goal);
    }
    if (this.#open !== null) return;
    const trace = new MotionTrace();
    trace.note(this.robots);
    this.#open = { before: this.#snapshot(), trace };
  }

  /** Advance by a tick of dt (s). @param {number} dt @param {boolean} dragging whether something is dragged */
  tick(dt, dragging) {
    this.#ticks += 1;
    const moving = [...this.robots.values()].some(({ motion }) => motion !== null);
    if (this.#open !== null && this.#ticks % Math.max(1, Math.round(1 / (RATE * dt))) === 0) this.#open.trace.note(this.robots);
    if (!dragging && !moving) this.#close();
    if (this.#goal === null || moving) return;
    const goal = this.#goal;
    this.#goal = null;
    this.#restorePins(goal);
  }

  /** Undo the last step, which may be in progress. */
  undo() {
    this.#retrace(this.#done, this.#undone, true);
  }

  /** Redo the step that was undone last. */
  redo() {
    this.#retrace(this.#undone, this.#done, false);
  }

  /** @returns {Snapshot} */
  #snapshot() {
    return new Map([...this.robots].map(([name, robot]) => [name, { q: robot.q.slice(), pins: robot.recordedPins() }]));
  }

  /** Close the step in progress; it is kept if it changed anything. */
  #close() {
    if (this.#open === null) return;
    const { before, trace } = this.#open;
    this.#open = null;
    trace.note(this.robots);
    const after = this.#snapshot();
    if (isSame(before, after)) return;
    this.#done.push({ before, after, trace });
    if (this.#done.length > MOST) this.#done.shift();
    this.#undone.length = 0;
  }

  /** End every motion in progress. */
  #finish() {
    if (this.#goal !== null) {
      this.begin();
      this.#open = null;
    }
    for (const robot of this.robots.values()) robot.motion = null;
    this.#close();
  }

  /**
   * Move the robots through the last step of one list, if there is one, and put it into the other.
   * @param {UndoStep[]} source
   * @param {UndoStep[]} target
   * @param {boolean} backwards
   */
  #retrace(source, target, backwards) {
    this.#finish();
    const step = source.pop();
    if (step === undefined) return;
    target.push(step);
    const goal = backwards ? step.before : step.after;
    const [name, label] = backwards ? ["undo", "undoing"] : ["redo", "redoing"];
    for (const [key, robot] of this.robots) {
      for (const pin of robot.pins()) robot.removeTask(pin);
      const { q } = /** @type {{ q: Float64Array }} */ (goal.get(key));
      if (isNear(robot.q, q)) continue;
      const trace = step.trace.configurations.get(key) ?? [];
      const path = [...(backwards ? trace.toReversed() : trace), q];
      const onPath = robot.kinematics.distance(robot.q, path[0]) < NEAR;
      robot.motion = onPath ? new Retrace(path, step.trace.period, name, label)
        : new ConfigurationMotion(robot.kinematics, robot.q, q, name, label);
    }
    this.#goal = goal;
  }

  /** @param {Snapshot} snapshot */
  #restorePins(snapshot) {
    for (const [name, { pins }] of snapshot) for (const pin of pins) this.robots.get(name)?.restorePin(this.newId(), pin);
  }
}

/** @param {ArrayLike<number>} before @param {ArrayLike<number>} after */
function isNear(before, after) {
  return Array.from(before).every((value, i) => Math.abs(value - after[i]) <= SAME[0] + SAME[1] * Math.abs(after[i]));
}

/** @param {Snapshot} before @param {Snapshot} after */
function isSame(before, after) {
  return [...before].every(([name, { q, pins }]) => {
    const { q: otherQ, pins: otherPins } = /** @type {{ q: Float64Array, pins: Task[] }} */ (after.get(name));
    const areSame = pins.length === otherPins.length && pins.every((pin, i) => isSamePin(pin, otherPins[i]));
    return areSame && isNear(q, otherQ);
  });
}

/** @param {Task} before @param {Task} after */
function isSamePin(before, after) {
  return before.node === after.node && isNear(numbersOf(before), numbersOf(after));
}

/** @param {Task} pin */
function numbersOf({ offset, target, translation, rotation, weight }) {
  return [...offset.numbers(), ...target.numbers(), translation, rotation, weight];
}
