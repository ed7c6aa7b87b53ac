// Measurements between two points of parts: of their surfaces, where they are clicked, or the origins of nodes. The points
// follow their parts. Distances are in the world's axes; the angle is that of two faces, or of the z axes of two nodes (in RAFF
// those of their joints).
//
// For tests: #measure-mode (aria-pressed), #measure with #measure-text, #measure-add, #measure-clear.

import { Quaternion, Vector3 } from "three";
import { atMostEvery, byId, make, sign, write } from "../base/dom.js";
import { announce } from "../base/speech.js";
import { units } from "../base/units.js";
import { ball, paint, rod, span } from "../view/shapes.js";
import { theme } from "../view/theme.js";

const OFTEN = 100; // ms
const SNAP = 10; // pixels: a click this near to the origin of the part takes it
const SIZE = 0.012; // characteristic lengths: radius of a point's ball
const HINT = "Click two points of parts, or add the origin of the selected part.";

/**
 * @typedef {Part & { at: Vector3, direction: Vector3, origin: boolean }} Point in the frame of its part, m; the direction is the
 *   normal of a face, or the z axis of an origin
 */
/** @typedef {{ position: Vector3, direction: Vector3, origin: boolean }} Placed a point in the world */

export class Measure {
  /** @type {Point[]} */
  #points = [];
  on = false;

  /** @param {{ view: View, session: Session, labels: Labels, pick: import("./pick.js").Pick }} parts */
  constructor({ view, session, labels, pick }) {
    this.view = view;
    this.session = session;
    this.labels = labels;
    this.pick = pick;
    this.middle = new Vector3();
    this.paint = paint(theme.ink, { opacity: 0.9 });
    this.balls = [0, 1].map(() => ball(this.paint, 1));
    this.line = rod(this.paint);
    view.stage.add(...this.balls, this.line);
    this.button = byId("measure-mode");
    this.bar = byId("measure");
    this.text = make("output", { id: "measure-text", "aria-live": "off" });
    /** @param {string} id @param {string} title @param {() => void} click @param {string | Node} content */
    const press = (id, title, click, content) => make("button", { type: "button", id, class: "small", title, on: { click } }, content);
    this.add = press("measure-add", "Add the origin of the selected part", () => this.#addOrigin(), "Add origin");
    const clear = press("measure-clear", "Remove both points", () => this.#clear(), "Clear");
    const close = press("measure-close", "End measuring (Esc)", () => this.toggle(false), sign("close"));
    close.setAttribute("aria-label", "End measuring");
    this.bar.append(this.text, this.add, clear, close);
    this.button.addEventListener("click", () => this.toggle());
    view.pane.addEventListener("pointerdown", (event) => this.#click(event), true); // before a drag begins
    const show = atMostEvery(OFTEN, () => this.#show());
    view.before(() => {
      this.#place();
      if (this.on) show();
    });
    for (const event of /** @type {const} */ (["select", "hello"])) session.on(event, () => this.#changed());
    units.on("change", () => this.#changed());
    theme.follow(() => this.paint.color.setHex(theme.ink));
  }

  /** Begin or end measuring; return whether that changed something. @param {boolean} on */
  toggle(on = !this.on) {
    if (on === this.on) return false;
    this.on = on;
    this.button.setAttribute("aria-pressed", String(on));
    this.bar.hidden = !on;
    if (on) announce(HINT);
    else if (this.bar.contains(document.activeElement)) this.button.focus();
    this.#clear();
    return true;
  }

  #clear() {
    this.#points = [];
    this.#changed();
  }

  #changed() {
    this.#points = this.#points.filter(({ robot, node }) => this.session.knows(robot, node));
    this.#show();
    this.view.changed();
  }

  /** @param {PointerEvent} event */
  #click(event) {
    if (!this.on || !event.isPrimary || event.button !== 0) return;
    const hit = this.pick.near(event);
    if (hit === null) return;
    event.stopImmediatePropagation();
    const { robot, node } = hit;
    const { position, quaternion } = this.view.pose(robot, node);
    const box = this.view.canvas.getBoundingClientRect();
    const origin = this.view.pixels(position);
    if (origin !== null && Math.hypot(box.left + origin.x - event.clientX, box.top + origin.y - event.clientY) < SNAP) {
      this.#take(originOf(hit));
      return;
    }
    const back = quaternion.clone().invert();
    const turned = this.view.root.getWorldQuaternion(new Quaternion()).invert();
    const normal = hit.normal ?? new Vector3();
    this.#take({
      robot,
      node,
      at: this.view.root.worldToLocal(hit.point.clone()).sub(position).applyQuaternion(back),
      direction: normal.clone().applyQuaternion(turned).applyQuaternion(back),
      origin: false,
    });
  }

  #addOrigin() {
    const { selected } = this.session;
    if (selected !== null) this.#take(originOf(selected));
  }

  /** @param {Point} point */
  #take(point) {
    this.#points = this.#points.length > 1 ? [point] : [...this.#points, point];
    this.#changed();
    announce(this.text.textContent ?? "");
  }

  /** @returns {Placed[]} */
  get placed() {
    return this.#points.map(({ robot, node, at, direction, origin }) => {
      const { position, quaternion } = this.view.pose(robot, node);
      return {
        position: at.clone().applyQuaternion(quaternion).add(position),
        direction: direction.clone().applyQuaternion(quaternion),
        origin,
      };
    });
  }

  #place() {
    const placed = this.placed;
    this.balls.forEach((mark, i) => {
      mark.visible = placed[i] !== undefined;
      if (!mark.visible) return;
      mark.position.copy(placed[i].position);
      mark.scale.setScalar(SIZE * (this.session.robot(this.#points[i].robot)?.length ?? 1));
    });
    this.line.visible = placed.length > 1;
    if (placed.length < 2) {
      this.labels.put("measure", "");
      return;
    }
    const [first, second] = placed;
    span(this.line, first.position, second.position, 0.3 * this.balls[0].scale.x);
    this.middle.copy(first.position).add(second.position).multiplyScalar(0.5);
    this.labels.put("measure", units.length(first.position.distanceTo(second.position)), this.middle, "measured");
  }

  #show() {
    if (!this.on) return;
    const { selected } = this.session;
    /** @type {HTMLButtonElement} */ (this.add).disabled = selected === null;
    write(this.add, selected === null ? "Add origin" : `Add origin of ${this.session.called(selected.robot, selected.node)}`);
    const names = this.#points.map(({ robot, node, origin }) => `${origin ? "origin of " : ""}${this.session.called(robot, node)}`);
    const [first, second] = this.placed;
    if (first === undefined) write(this.text, HINT);
    else if (second === undefined) write(this.text, `From ${names[0]} to … ${HINT}`);
    else write(this.text, `From ${names[0]} to ${names[1]}: ${measured(first, second)}`);
  }
}

/** Return the origin of a part. @param {Part} part @returns {Point} */
function originOf({ robot, node }) {
  return { robot, node, at: new Vector3(), direction: new Vector3(0, 0, 1), origin: true };
}

/**
 * Return the text of a measurement: distance, its components, and the angle of two faces or of two axes.
 * @param {Placed} first
 * @param {Placed} second
 */
export function measured(first, second) {
  const { x, y, z } = second.position.clone().sub(first.position);
  const components = [`dx ${units.length(x)}`, `dy ${units.length(y)}`, `dz ${units.length(z)}`];
  const texts = [`distance ${units.length(Math.hypot(x, y, z))}`, ...components];
  const lengths = first.direction.length() * second.direction.length();
  if (first.origin === second.origin && lengths > 0) {
    const cosine = Math.min(1, Math.abs(first.direction.dot(second.direction)) / lengths); // neither has a sense
    texts.push(`${first.origin ? "z axes" : "faces"} at ${units.angle(Math.acos(cosine))}`);
  }
  return texts.join(", ");
}
