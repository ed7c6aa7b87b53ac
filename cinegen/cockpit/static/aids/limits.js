// Limits, where they matter: while something moves a robot, each joint near one shows its range as an arc about its axis, or as a
// rail along it, with a ball where it stands.

import { Group, Matrix4, Mesh, Quaternion, TorusGeometry, Vector3 } from "three";
import { valueOf } from "../base/names.js";
import { keyOf } from "../base/session.js";
import { ball, paint, rod, span } from "../view/shapes.js";
import { COLOURS } from "../view/theme.js";

const SIZE = 0.1; // characteristic lengths: radius of an arc
const THIN = 0.05; // of that: its line
const OPEN = { revolute: 1.5, prismatic: 0.3 }; // shown of a range with one end only; rad, characteristic lengths

/** @typedef {import("../base/messages").JointDescription} Joint */
/** @typedef {{ group: Group, paint: import("three").MeshBasicMaterial, range: Mesh, ball: Mesh }} Mark */

export class Limits {
  /** @type {Map<string, Mark>} */
  #marks = new Map();

  /** @param {{ view: View, session: Session, aids: Aids }} parts */
  constructor({ view, session, aids }) {
    this.view = view;
    this.session = session;
    this.aids = aids;
    session.on("report", () => this.#show());
    aids.on("change", () => this.#show());
    session.on("hello", () => {
      for (const { group } of this.#marks.values()) view.stage.remove(group);
      this.#marks.clear();
    });
  }

  /** Whether something moves robots: then limits matter. */
  get #matter() {
    return this.aids.shows("limits") && (this.session.tasks.some(({ source }) => source === "pointer") || Boolean(this.session.report?.moving));
  }

  #show() {
    for (const { group } of this.#marks.values()) group.visible = false;
    for (const robot of this.#matter ? this.session.robots : []) {
      const report = valueOf(this.session.report?.robots, robot.name);
      const at = new Set(report?.saturated);
      const near = new Set(report?.near_limit);
      for (const { name, joint, axis } of robot.nodes) {
        if (!joint || !axis || !(at.has(joint) || near.has(joint))) continue;
        const i = robot.joints.findIndex((candidate) => candidate.name === joint);
        if (i >= 0) this.#place(robot, name, robot.joints[i], new Vector3(...axis), report?.q[i] ?? 0, at.has(joint));
      }
    }
    this.view.changed();
  }

  /**
   * @param {KnownRobot} robot
   * @param {string} node
   * @param {Joint} joint
   * @param {Vector3} axis in the node's frame
   * @param {number} value
   * @param {boolean} at whether it is at the limit
   */
  #place(robot, node, joint, axis, value, at) {
    const [lower, upper] = rangeOf(joint, robot.length);
    const key = keyOf(robot.name, joint.name);
    const mark = this.#marks.get(key) ?? this.#make(key, joint, robot.length, upper - lower);
    const { position, quaternion } = this.view.pose(robot.name, node);
    const z = axis.clone().applyQuaternion(quaternion);
    mark.group.visible = true;
    mark.paint.color.setHex(at ? COLOURS.vermilion : COLOURS.orange);
    if (joint.type === "prismatic") {
      const [from, to] = [lower, upper].map((end) => position.clone().addScaledVector(z, end - value));
      span(mark.range, from, to, THIN * SIZE * robot.length);
      mark.ball.position.copy(position);
      return;
    }
    const across = new Vector3(...(Math.abs(axis.x) < 0.7 ? [1, 0, 0] : [0, 1, 0])).cross(axis).normalize().applyQuaternion(quaternion);
    const first = across.clone().applyQuaternion(new Quaternion().setFromAxisAngle(z, lower - value));
    mark.range.quaternion.setFromRotationMatrix(new Matrix4().makeBasis(first, z.clone().cross(first), z));
    mark.range.position.copy(position);
    mark.ball.position.copy(position).addScaledVector(across, SIZE * robot.length);
  }

  /**
   * @param {string} key
   * @param {Joint} joint
   * @param {number} length characteristic length of the robot (m)
   * @param {number} wide the range; rad, or m
   * @returns {Mark}
   */
  #make(key, joint, length, wide) {
    const colour = paint(COLOURS.orange, { opacity: 0.9 });
    const arc = () => new Mesh(new TorusGeometry(SIZE * length, THIN * SIZE * length, 6, 64, Math.min(wide, 2 * Math.PI)), colour);
    const mark = { group: new Group(), paint: colour, range: joint.type === "prismatic" ? rod(colour) : arc(), ball: ball(colour, 3 * THIN * SIZE * length) };
    mark.range.renderOrder = 10;
    mark.group.name = `limits ${joint.name}`;
    mark.group.add(mark.range, mark.ball);
    this.view.stage.add(mark.group);
    this.#marks.set(key, mark);
    return mark;
  }
}

/**
 * Return the range of a joint that is shown; an end that the joint doesn't have is near the other.
 * @param {Pick<Joint, "type" | "lower" | "upper">} joint
 * @param {number} length characteristic length of the robot (m)
 * @returns {[number, number]}
 */
function rangeOf({ type, lower, upper }, length) {
  const open = OPEN[type] * (type === "prismatic" ? length : 1);
  return [lower ?? (upper ?? 0) - open, upper ?? (lower ?? 0) + open];
}
