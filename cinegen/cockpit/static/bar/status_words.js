// Statuses in words, as one says them to a person who drags: which way a part can't go, and which joint is at its limit.

import { valueOf } from "../base/names.js";
import { isNear } from "../base/units.js";

/** @typedef {[number, number, number]} Vector */

const ALONG = 0.3; // cosine: a pull that is further from the lost direction doesn't meet it
const PULLED = 3e-3; // characteristic lengths: a smaller pull is none
const STRAIGHT = 0.5; // of a lost motion that has a translation this large, the translation is what is told
/** @type {[string, string][]} along the axes of the view, both ways */
const WAYS = [["to the right", "to the left"], ["upwards", "downwards"], ["towards you", "away from you"]];

/**
 * Return the status of a robot with its label in words. Near a singularity, a pull that doesn't meet the lost direction is followed.
 * @param {{ name?: string, label?: string, description?: string }} status
 * @param {import("../base/messages").RobotReport | undefined} report on the robot
 * @param {Vector[]} axes of the view, in the world: right, up, towards the viewer
 * @param {Vector} pull from the dragged point to its target; zeros where nothing is dragged
 * @param {number} length characteristic length of the robot (m)
 */
export function inWords(status, report, axes, pull, length) {
  const { name = "", label = "" } = status;
  const [twist, pulled] = [report?.type1?.twist ?? [], Math.hypot(...pull)];
  if (name !== "SINGULAR" || twist.length !== 6 || pulled < PULLED * length) return { ...status, label: label.replace(/: (lost|uncontrolled) DoF$|, near a singularity$/, "") };
  const [straight, turns] = [twist.slice(0, 3), twist.slice(3)];
  if (Math.hypot(...straight) / length < STRAIGHT * Math.hypot(...turns)) return { ...status, label: "can't rotate in this direction here" };
  if (Math.abs(dot(straight, pull)) < ALONG * Math.hypot(...straight) * pulled) return { name: "FOLLOWING", label: "following", description: label };
  const along = axes.map((axis) => dot(axis, straight));
  const most = along.reduce((best, value, i) => (Math.abs(value) > Math.abs(along[best]) ? i : best), 0);
  const way = along[most] * (dot(straight, pull) < 0 ? -1 : 1);
  return { ...status, label: `can't push ${WAYS[most][way < 0 ? 1 : 0]} here` };
}

/** @param {number[]} a @param {number[]} b */
function dot(a, b) {
  return a.reduce((sum, value, i) => sum + value * b[i], 0);
}

/**
 * Return the statuses of all robots in words. Near a singularity nothing is told before a person drives: it may be at home.
 * @param {Session} session
 * @param {Vector[]} axes of the view, in the world
 */
export function statusesInWords(session, axes) {
  const { state, report } = session;
  const driven = session.control !== "free" && (session.tasks.length > 0 || Boolean(report?.moving));
  return Object.fromEntries(
    Object.entries(state?.statuses ?? {}).map(([robot, status]) => {
      const [tasks, length] = [session.tasks.filter((task) => task.robot === robot), session.robot(robot)?.length ?? 1];
      const isReached = tasks.every(({ error }) => error && isNear(error, length));
      if (status.name === "AT_LIMIT" && tasks.length > 0 && isReached) return [robot, { name: "FOLLOWING", label: "following", description: status.description }];
      const task = tasks.find((task) => task.source === "pointer");
      const [target, position] = [task?.target ?? [0, 0, 0], task?.position ?? task?.target ?? [0, 0, 0]];
      const pull = /** @type {Vector} */ ([0, 1, 2].map((i) => target[i] - position[i]));
      const near = ["SINGULAR", "UNCONTROLLED", "DAMPED"].includes(status.name ?? "");
      if (near && !driven) return [robot, { name: "IDLE", label: "idle", description: status.description }];
      return [robot, inWords(status, valueOf(report?.robots, robot), axes, pull, length)];
    }),
  );
}
