// The session of a page without a server: robots that users move; commands in, ticks, states out. It takes the commands
// of cinegen/session/commands.py and does what cinegen/session/session.py does, as far as no server is needed for it.

import { Quaternion, Vector3 } from "three";
import { valueOf } from "../../../cockpit/static/base/names.js";
import { Drags } from "./drags.js";
import { ConfigurationMotion, JointMotion } from "./motion.js";
import { Placement } from "./placement.js";
import { PIN } from "./robot.js";
import { UndoHistory } from "./undo.js";
import { WaypointError, Waypoints } from "./waypoints.js";

const POINTERS = 2; // tasks of a robot that are left for pointers
const FURTHEST = 1e6; // m or rad
const REST = 1; // s without motion, after which a session is at rest
const STILL = 1e-8; // rad or m per tick: more is motion
const INTERRUPTS = ["start_drag", "move_joint", "move_home", "undo", "redo"]; // commands that end motions through waypoints

/** @typedef {import("../../../cockpit/static/base/messages").ClientMessage} ClientMessage */
/** @typedef {import("./robot.js").DrivenRobot} DrivenRobot */
/** @typedef {import("./robot.js").Task} Task */
/** @typedef {{ robot: string | null, node: string | null, placement: number[] }} BasePose */

/** A command that refers to something that does not exist, or is malformed. */
class CommandError extends Error {}

export class LocalSession {
  time = 0;
  paused = false;
  settings = { gain: 100, damping: 0.05 };
  /** @type {{ text: string, level: "warning" }[]} */
  notices = []; // which whoever shows them takes out
  #count = 0;
  #drags;
  #still = 0; // s

  /**
   * @param {Map<string, DrivenRobot>} robots each after the one that carries it
   * @param {Record<string, BasePose>} bases
   */
  constructor(robots, bases) {
    this.robots = robots;
    this.bases = bases;
    this.#drags = new Drags(() => this.#newId());
    this.history = new UndoHistory(robots, () => this.#newId());
    this.waypoints = new Waypoints(robots, () => this.#newId());
    this.#carry();
  }

  /** True after a second without commands, in which nothing has moved. */
  get atRest() {
    return this.#still >= REST;
  }

  /** Name of the motion that moves a robot instead of its tasks; null if none does. */
  get moving() {
    return [...this.robots.values()].find(({ motion }) => motion !== null)?.motion?.name ?? null;
  }

  /** Carry out a command as far as possible; otherwise a notice gives the reason. @param {ClientMessage} command */
  obey(command) {
    this.#still = 0;
    if (INTERRUPTS.includes(command.type)) this.waypoints.stop();
    try {
      this.#obey(command);
    } catch (error) {
      if (!(error instanceof CommandError || error instanceof WaypointError)) throw error;
      this.#notice(error.message);
    }
  }

  /** Advance by a tick of dt (s). @param {number} dt */
  tick(dt) {
    this.time += dt;
    let moved = this.moving !== null;
    for (const robot of this.paused ? [] : this.robots.values()) {
      const before = robot.q.slice();
      const problem = robot.tick(dt);
      if (problem) this.#notice(problem);
      moved ||= robot.q.some((value, i) => Math.abs(value - before[i]) > STILL);
    }
    const problem = this.paused ? "" : this.waypoints.tick();
    if (problem) this.#notice(problem);
    this.#carry();
    this.history.tick(dt, this.#drags.busy);
    this.#still = moved ? 0 : this.#still + dt;
  }

  /**
   * Set the configuration of a robot, with closed loops; it is home no more, and this can't be undone.
   * @param {string} name
   * @param {Float64Array} q
   */
  place(name, q) {
    this.#robot(name).jumpTo(q);
    this.#carry();
    this.#still = 0;
  }

  /** @param {ClientMessage} command */
  #obey(command) {
    switch (command.type) {
      case "start_drag": return this.#startDrag(command);
      case "move_drag": return this.#moveDrag(command);
      case "end_drag": return this.#drags.end(typeof command.pointer === "number" ? index(command.pointer) : null, command.pin ?? false);
      case "pin": return this.#pin(command);
      case "remove_task": return this.#removeTask(command.task);
      case "change_task": return this.#changeTask(command);
      case "move_joint": return this.#moveJoint(command);
      case "end_joint_motion":
        for (const { motion } of this.robots.values()) if (motion instanceof JointMotion) motion.end();
        return;
      case "move_home": return this.#moveHome(command.robot ?? null);
      case "save_waypoint": return this.waypoints.save(command.name);
      case "change_waypoint": return this.waypoints.change(command);
      case "remove_waypoint": return this.waypoints.remove(command.waypoint);
      case "move_to_waypoint": return this.#follow(() => this.waypoints.moveTo(command.waypoint));
      case "play_waypoints": return command.on ? this.#follow(() => this.waypoints.play()) : this.waypoints.stop();
      case "undo":
      case "redo":
        this.#drags.end();
        return this.history[command.type]();
      case "pause":
        this.paused = command.on;
        return;
      case "change_settings": return this.#changeSettings(command);
      case "ack":
      case "request_control":
      case "request_reactions":
      case "request_rate":
      case "set_user":
      case "set_cursor":
      case "set_view":
      case "gamepad_input":
        return; // of the server's session only
      default:
        throw new CommandError(`the page without a server can't do '${command.type}': use cinegen drive`);
    }
  }

  // --- the pointers -----------------------------------------------------------------------------------------------

  /** @param {import("../../../cockpit/static/base/messages").StartDrag} command */
  #startDrag({ robot: name, node, point = null, rotation = false, pointer = 0 }) {
    const robot = this.#robot(name, node);
    this.#makeRoom(robot, 0);
    this.history.begin();
    const offset = point === null ? new Placement() : new Placement(vector(point));
    this.#drags.start(index(pointer), robot, node, offset, [3, rotation && point === null ? 3 : 0]);
  }

  /** @param {import("../../../cockpit/static/base/messages").MoveDrag} command */
  #moveDrag({ position, quaternion = null, weight = null, pointer = 0 }) {
    const drag = this.#drags.of(index(pointer));
    if (drag === null) return; // it has ended meanwhile
    const { robot, task } = drag;
    if (weight !== null) task.weight = within(weight, 0.01, 100);
    const rotation = quaternion === null ? robot.base.times(task.target).rotation : turn(quaternion);
    task.target = robot.base.inverseTimes(new Placement(vector(position), rotation));
  }

  // --- tasks ------------------------------------------------------------------------------------------------------

  /** @param {import("../../../cockpit/static/base/messages").Pin} command */
  #pin({ robot: name, node }) {
    const robot = this.#robot(name, node);
    if (robot.pins(node).length > 0) return;
    this.#makeRoom(robot, POINTERS);
    this.history.begin();
    robot.addTask(this.#newId(), node, PIN);
  }

  /** @param {number} id */
  #removeTask(id) {
    const owned = this.#task(id);
    if (owned === null) return;
    if (this.#drags.endOf(owned.task)) return;
    this.history.begin();
    owned.robot.removeTask(owned.task);
  }

  /** @param {import("../../../cockpit/static/base/messages").ChangeTask} command */
  #changeTask({ task: id, translation = null, rotation = null, weight = null, priority = null, description = null }) {
    if (priority !== null || description !== null) {
      throw new CommandError("the page without a server has tasks of one priority and kind: use cinegen drive");
    }
    const task = this.#task(id)?.task;
    if (task === undefined) return;
    if (translation !== null) task.translation = count(translation);
    if (rotation !== null) task.rotation = count(rotation);
    if (weight !== null) task.weight = within(weight, 0.01, 100);
  }

  /** @param {number} id */
  #task(id) {
    for (const robot of this.robots.values()) {
      const task = robot.tasks.find((task) => task.id === id);
      if (task !== undefined) return { robot, task };
    }
    return null;
  }

  // --- motions ----------------------------------------------------------------------------------------------------

  /** @param {import("../../../cockpit/static/base/messages").MoveJoint} command */
  #moveJoint({ robot: name, joint, value }) {
    const robot = this.#robot(name);
    const [goal] = finite([value], 1);
    if (!robot.kinematics.actuated.some((actuated) => actuated.name === joint)) throw new CommandError(`unknown joint '${joint}'`);
    if (!(robot.motion instanceof JointMotion)) {
      this.history.begin();
      robot.motion = new JointMotion(robot.kinematics, robot.q);
    }
    /** @type {JointMotion} */ (robot.motion).move(joint, goal);
  }

  /** @param {string | null} name */
  #moveHome(name) {
    const robots = name === null ? [...this.robots.values()] : [this.#robot(name)];
    this.#drags.end();
    this.history.begin();
    for (const robot of robots) {
      for (const pin of robot.pins()) robot.removeTask(pin);
      robot.motion = new ConfigurationMotion(robot.kinematics, robot.q, robot.home, "home", "moving home");
    }
  }

  /** Start a motion through waypoints. @param {() => void} start */
  #follow(start) {
    this.#drags.end();
    this.history.begin();
    start();
    for (const robot of this.robots.values()) for (const pin of robot.pins()) robot.removeTask(pin);
  }

  /** @param {import("../../../cockpit/static/base/messages").ChangeSettings} command */
  #changeSettings({ gain = null, damping = null }) {
    if (gain !== null) this.settings.gain = within(gain, 1, 1000);
    if (damping !== null) this.settings.damping = within(damping, 1e-3, 0.3);
    for (const robot of this.robots.values()) Object.assign(robot, this.settings);
  }

  // --- helpers ----------------------------------------------------------------------------------------------------

  /** Set the base poses of all robots. */
  #carry() {
    for (const [name, robot] of this.robots) {
      const base = valueOf(this.bases, name);
      if (base === undefined) continue;
      const placement = Placement.of(base.placement);
      const carrier = base.robot === null ? undefined : this.robots.get(base.robot);
      robot.setBase(carrier === undefined || base.node === null ? placement : carrier.placement(base.node).times(placement));
    }
  }

  /** Return a robot that has a node. @param {string} name @param {string | null} node */
  #robot(name, node = null) {
    const robot = this.robots.get(name);
    if (robot === undefined) throw new CommandError(`unknown robot '${name}'`);
    if (node !== null && !robot.kinematics.has(node)) throw new CommandError(`unknown node '${node}'`);
    return robot;
  }

  /**
   * Refuse a task that the robot's solver has no room for.
   * @param {DrivenRobot} robot
   * @param {number} kept number of tasks that are left for pointers
   */
  #makeRoom(robot, kept) {
    const { length } = robot.tasks;
    if (length >= robot.kinematics.solver.mostTasks - kept) throw new CommandError(`${robot.name} has ${length} tasks: remove some first`);
  }

  #newId() {
    this.#count += 1;
    return this.#count;
  }

  /** @param {string} text */
  #notice(text) {
    this.notices.push({ text, level: "warning" });
  }
}

/** Return numbers of a command. @param {number[]} numbers @param {number} count */
function finite(numbers, count) {
  const good = Array.isArray(numbers) && numbers.length === count && numbers.every((value) => Number.isFinite(value) && Math.abs(value) <= FURTHEST);
  if (!good) throw new CommandError(`a command needs ${count} numbers within ${FURTHEST}, not ${JSON.stringify(numbers)}`);
  return /** @type {[number, number, number, number]} */ (numbers);
}

/** @param {number[]} numbers */
function vector(numbers) {
  return new Vector3().fromArray(finite(numbers, 3));
}

/** @param {number} value @param {number} low @param {number} high */
function within(value, low, high) {
  if (!(Number.isFinite(value) && value >= low && value <= high)) throw new CommandError(`a setting must be ${low} to ${high}, not ${value}`);
  return value;
}

/** @param {number} value a number of degrees of freedom */
function count(value) {
  if (![0, 1, 2, 3].includes(value)) throw new CommandError(`a task constrains 0 to 3 translations and rotations, not ${value}`);
  return value;
}

/** @param {number[]} numbers a quaternion x y z w */
function turn(numbers) {
  const quaternion = new Quaternion(...finite(numbers, 4));
  if (!(Math.abs(quaternion.length() - 1) < 0.1)) throw new CommandError("a quaternion x y z w has length 1");
  return quaternion.normalize();
}

/** @param {number} value the number of a pointer */
function index(value) {
  if (!Number.isInteger(value) || value < 0 || value > 9) throw new CommandError(`a pointer is 0 to 9, not ${value}`);
  return value;
}
