// The gizmo on the selected part: handles on a proxy at the part, or at the target during a drag.
// Never on the part itself: it would snap back while the robot lags behind.
//
// The proxy's axes are those that were chosen: the world's, the part's own, or the view's.
//
// Events: drag (part or null), change (of mode, axes or upright).

import { Object3D, Quaternion, Vector3 } from "three";
import { memory } from "../base/dom.js";
import { Events } from "../base/events.js";
import { DragTarget } from "./drag_target.js";
import { Handles } from "./handles.js";

export const AXES = ["world", "local", "view"];

/** @typedef {{ rotation: Quaternion, axes: Quaternion, rotates: boolean, denied: boolean, steps: boolean }} Begin */

/** @extends {Events<{ drag: Part | null, change: undefined }>} */
export class Gizmo extends Events {
  /** @type {Part | null} */
  #part = null;
  /** @type {Begin | null} */
  #begin = null; // of a drag: orientation of the part and of the proxy
  mode = "translate";
  axes = memory.get("axes", "world");
  upright = true; // the orientation is commanded during a translation, too

  /** @param {View} view @param {Session} session @param {import("./pick.js").Pick} pick */
  constructor(view, session, pick) {
    super();
    this.view = view;
    this.session = session;
    this.target = new DragTarget(session);
    if (!AXES.includes(this.axes)) this.axes = "world";
    this.proxy = new Object3D();
    view.stage.add(this.proxy);
    view.before(() => this.#follow());
    this.handles = new Handles(view, pick);
    this.handles.on("change", () => view.changed());
    this.handles.on("drag", (begins) => (begins ? this.#take() : this.end()));
    this.handles.on("move", () => this.#move());
    session.on("select", (part) => this.#attach(part));
    session.on("hello", () => this.#attach(this.#part));
    session.on("control", (control) => {
      if (control === "other") this.end();
    });
  }

  /** Whether it is dragged. */
  get busy() {
    return this.#begin !== null;
  }

  /** Whether it is moved by steps. */
  get stepping() {
    return this.#begin?.steps === true;
  }

  get hovered() {
    return this.handles.hovered;
  }

  get part() {
    return this.#part;
  }

  /** @param {string} mode */
  setMode(mode) {
    this.mode = mode;
    this.handles.mode = mode;
    this.#changed();
  }

  /** @param {string} axes the next ones unless given */
  setAxes(axes = "") {
    this.axes = AXES.includes(axes) ? axes : AXES[(AXES.indexOf(this.axes) + 1) % AXES.length];
    memory.set("axes", this.axes);
    this.#changed();
  }

  /** @param {boolean} upright */
  setUpright(upright) {
    this.upright = upright;
    this.#changed();
  }

  /** End the drag; with a pin at the target, if wanted. */
  end(pin = false) {
    if (this.#begin === null) return;
    const { denied } = this.#begin;
    this.#begin = null;
    this.target.stop();
    this.handles.release();
    if (denied) return;
    this.session.send({ type: "end_drag", pin });
    this.emit("drag", null);
  }

  #changed() {
    this.view.changed();
    this.emit("change");
  }

  /** @param {Part | null} part */
  #attach(part) {
    this.end();
    this.#part = part !== null && this.session.knows(part.robot, part.node) ? part : null;
    if (this.#part !== null) this.upright = this.#canRotate(this.#part);
    this.handles.attach(this.#part === null ? null : this.proxy);
    this.#changed();
  }

  /**
   * Return whether a part can move in all six DoF: enough of them, and enough joints between it and the base.
   * @param {Part} part
   */
  #canRotate(part) {
    const robot = this.session.robot(part.robot);
    if (robot === null) return false;
    let joints = 0;
    for (let node = robot.byName.get(part.node); node; node = robot.byName.get(node.parent ?? "")) {
      if (node.joint) joints += 1;
    }
    return (robot.mobility ?? 0) >= 6 && joints >= 6;
  }

  get #rotates() {
    return this.mode === "rotate" || this.upright;
  }

  /**
   * Move the target along one of its axes, or rotate it about one; this begins a drag, or goes on with one.
   * @param {number} axis 0, 1 or 2
   * @param {number} amount m or rad
   * @param {boolean} turns
   * @returns {boolean} whether it moves
   */
  step(axis, amount, turns) {
    const rotates = turns || this.upright;
    if (this.#begin !== null && (!this.#begin.steps || this.#begin.rotates !== rotates)) this.end();
    if (this.#begin === null) {
      this.#follow();
      this.#take(rotates, true);
    }
    const begin = /** @type {Begin | null} */ (this.#begin);
    if (begin === null || begin.denied) {
      this.#begin = null;
      return false;
    }
    const along = new Vector3().setComponent(axis, 1);
    along.applyQuaternion(this.axes === "local" ? this.proxy.quaternion : begin.axes);
    if (turns) this.proxy.quaternion.premultiply(new Quaternion().setFromAxisAngle(along, amount)).normalize();
    else this.proxy.position.addScaledVector(along, amount);
    this.#move();
    this.view.changed();
    return true;
  }

  #take(rotates = this.#rotates, steps = false) {
    if (this.#part === null) return;
    const { robot, node } = this.#part;
    const { quaternion } = this.view.pose(robot, node);
    this.#begin = { rotation: quaternion, axes: this.proxy.quaternion.clone(), rotates, denied: false, steps };
    const fixed = this.session.isFixed(robot, node);
    if (fixed) this.session.emit("notice", { text: `${node} is fixed: move another part.` });
    if (fixed || !this.session.mayAct()) {
      this.#begin.denied = true;
      return;
    }
    this.session.send({ type: "start_drag", robot, node, rotation: rotates });
    this.emit("drag", this.#part);
  }

  #move() {
    const begin = this.#begin;
    if (begin === null || begin.denied) return;
    const position = this.proxy.position.toArray();
    if (!begin.rotates) {
      this.target.move(position);
      return;
    }
    const turned = this.proxy.quaternion.clone().multiply(begin.axes.clone().invert()).multiply(begin.rotation).normalize();
    this.target.move(position, turned.toArray());
  }

  /** Before every picture: the proxy stands where the part is, unless it leads. */
  #follow() {
    if (this.#part === null) return;
    if (this.#begin !== null && !this.#begin.denied) return;
    const { position, quaternion } = this.view.pose(this.#part.robot, this.#part.node, new Vector3(), new Quaternion());
    this.proxy.position.copy(position);
    if (this.axes === "local") this.proxy.quaternion.copy(quaternion);
    else if (this.axes === "view") this.view.cameraOrientation(this.proxy.quaternion);
    else this.proxy.quaternion.identity();
  }
}
