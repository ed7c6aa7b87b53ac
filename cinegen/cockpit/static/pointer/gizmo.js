// The gizmo on the selected part: three.js's TransformControls on a proxy that stands where the part is, and while it
// is dragged where the part should be. Never on the part itself: it would snap back while the robot lags behind.
//
// The proxy's axes are those that were chosen (world, the part's own, the view's), so that the controls always work in
// "local" space: meshcat's scene is turned, and its world axes are not the robots'.
//
// Events: drag (part or null), change (mode, axes or hold are others).

import { Object3D, Quaternion, Vector3 } from "three";
import { memory } from "../base/dom.js";
import { Events } from "../base/events.js";
import { TransformControls } from "../vendor/three-0.132.2/TransformControls.js";
import { DragTarget } from "./drag_target.js";

export const AXES = ["world", "local", "view"];

export class Gizmo extends Events {
  #part = null;
  #begin = null; // of a drag: how proxy and part stood
  mode = "translate";
  axes = memory.get("axes", "world");
  upright = true; // moving it, its orientation is held too

  constructor(view, session) {
    super();
    Object.assign(this, { view, session });
    this.target = new DragTarget(session);
    if (!AXES.includes(this.axes)) this.axes = "world";
    this.proxy = new Object3D();
    view.stage.add(this.proxy);
    this.controls = new TransformControls(view.camera, view.canvas);
    this.controls.space = "local";
    this.controls.size = 0.8;
    this.controls.addEventListener("change", () => view.changed());
    this.controls.addEventListener("mouseDown", () => this.#take());
    this.controls.addEventListener("objectChange", () => this.#move());
    this.controls.addEventListener("mouseUp", () => this.end());
    this.controls.addEventListener("dragging-changed", ({ value }) => {
      view.controls.enabled = !value;
    });
    view.level.add(this.controls);
    view.before(() => this.#follow());
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

  get hovered() {
    return this.#part !== null && this.controls.axis !== null;
  }

  get part() {
    return this.#part;
  }

  /** Whether a pointer that is pressed is its own. */
  wants(event) {
    if (this.#part === null || !this.controls.enabled) return false;
    this.controls.pointerHover(this.controls._getPointer(event));
    return this.controls.axis !== null;
  }

  setMode(mode) {
    this.mode = mode;
    this.controls.setMode(mode);
    this.#changed();
  }

  setAxes(axes) {
    this.axes = AXES.includes(axes) ? axes : AXES[(AXES.indexOf(this.axes) + 1) % AXES.length];
    memory.set("axes", this.axes);
    this.#changed();
  }

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
    this.controls.dragging = false;
    this.controls.axis = null;
    if (denied) return;
    this.session.send({ type: "end_drag", pin });
    this.tell("drag", null);
  }

  #changed() {
    this.view.changed();
    this.tell("change");
  }

  #attach(part) {
    this.end();
    this.#part = part !== null && this.session.knows(part.robot, part.node) ? part : null;
    if (this.#part === null) {
      this.controls.detach();
    } else {
      this.upright = this.#canTurn();
      this.controls.attach(this.proxy);
    }
    this.#changed();
  }

  /** Whether a part can be led in all six freedoms: enough of them, and enough joints between it and the base. */
  #canTurn() {
    const robot = this.session.robot(this.#part.robot);
    let joints = 0;
    for (let node = robot.byName.get(this.#part.node); node; node = robot.byName.get(node.parent)) {
      if (node.joint) joints += 1;
    }
    return (robot.mobility ?? 0) >= 6 && joints >= 6;
  }

  get #turns() {
    return this.mode === "rotate" || this.upright;
  }

  #take() {
    const { robot, node } = this.#part;
    const { position, quaternion } = this.view.pose(robot, node);
    this.#begin = { turn: quaternion, axes: this.proxy.quaternion.clone(), turns: this.#turns, position };
    if (!this.session.mayAct()) {
      this.#begin.denied = true;
      return;
    }
    this.session.send({ type: "start_drag", robot, node, rotation: this.#turns });
    this.tell("drag", this.#part);
  }

  #move() {
    const begin = this.#begin;
    if (begin === null || begin.denied) return;
    const position = this.proxy.position.toArray();
    if (!begin.turns) {
      this.target.move(position);
      return;
    }
    const turned = this.proxy.quaternion.clone().multiply(begin.axes.clone().invert()).multiply(begin.turn).normalize();
    this.target.move(position, turned.toArray());
  }

  /** Before every picture: the proxy stands where the part is, unless it leads. */
  #follow() {
    if (this.#part === null) return;
    this.controls.camera = this.view.camera;
    if (this.#begin !== null && !this.#begin.denied) return;
    const { position, quaternion } = this.view.pose(this.#part.robot, this.#part.node, new Vector3(), new Quaternion());
    this.proxy.position.copy(position);
    if (this.axes === "local") this.proxy.quaternion.copy(quaternion);
    else if (this.axes === "view") this.view.eye(this.proxy.quaternion);
    else this.proxy.quaternion.identity();
  }
}
