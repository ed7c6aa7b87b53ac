// Keys on the scene, while it has the focus: they move or rotate the selected part by the same drag as the gizmo, along the
// gizmo's axes. Without a selected part they rotate and zoom the view. What happened is announced when the keys rest.

import { announce } from "../base/speech.js";
import { fixed, units } from "../base/units.js";
import { orbit, zoom } from "../view/orbit.js";

const QUIET = 600; // ms without a key: the drag ends, once the robot rests
const LONGEST = 5000; // ms: it ends, even if the robot moves on
const STEP = 0.01; // characteristic lengths, rounded to 1, 2 or 5 times a power of ten
const ANGLE = Math.PI / 90; // rad
const FINE = 0.1; // of a step, with Alt
const ORBIT = Math.PI / 24; // rad
const ZOOM = 1.15;
const RESTS = 1e-5; // m: the part has moved by less since the last look

/** @type {Record<string, [number, number]>} axis and direction of a key */
const KEYS = {
  ArrowLeft: [0, -1],
  ArrowRight: [0, 1],
  ArrowDown: [1, -1],
  ArrowUp: [1, 1],
  PageDown: [2, -1],
  PageUp: [2, 1],
};
const NAMES = ["x", "y", "z"];

export class ArrowKeys {
  /** @type {Set<string>} */
  #pressed = new Set();
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #timer;
  #turned = [0, 0, 0]; // rad about each axis, in this drag

  /** @param {{ view: View, session: Session, gizmo: Gizmo, drag: { part: object | null } }} parts */
  constructor({ view, session, gizmo, drag }) {
    this.view = view;
    this.session = session;
    this.gizmo = gizmo;
    this.drag = drag;
    const { canvas, pane } = view;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application"); // screen readers leave the arrow keys to it
    canvas.setAttribute("aria-describedby", "scene-keys");
    session.on("hello", ({ title }) => canvas.setAttribute("aria-label", `Scene with ${title}`));
    session.on("select", () => this.#finish());
    canvas.addEventListener("keydown", (event) => this.#down(event));
    canvas.addEventListener("keyup", (event) => this.#up(event.key));
    canvas.addEventListener("blur", () => this.#finish());
    pane.addEventListener("pointerdown", () => this.#finish(), true);
    canvas.addEventListener("pointerdown", () => canvas.focus({ preventScroll: true }), true);
  }

  /** @param {KeyboardEvent} event */
  #down(event) {
    if (event.metaKey || this.drag.part !== null) return;
    if (event.key === "+" || event.key === "-") {
      zoom(this.view, event.key === "+" ? 1 / ZOOM : ZOOM);
      event.preventDefault();
      return;
    }
    const key = KEYS[event.key];
    if (key === undefined) return;
    event.preventDefault();
    const [axis, direction] = event.shiftKey && key[0] === 1 ? [2, key[1]] : key;
    const { selected } = this.session;
    if (selected !== null) this.#move(event, axis, direction);
    else if (axis === 2) zoom(this.view, direction > 0 ? 1 / ZOOM : ZOOM);
    else orbit(this.view, axis === 0 ? ORBIT * direction : 0, axis === 1 ? ORBIT * direction : 0);
  }

  /** @param {KeyboardEvent} event @param {number} axis @param {number} direction */
  #move(event, axis, direction) {
    clearTimeout(this.#timer);
    if (!this.gizmo.busy) this.#turned = [0, 0, 0];
    const rotates = event.ctrlKey || this.gizmo.mode === "rotate";
    const size = (event.altKey ? FINE : 1) * (rotates ? ANGLE : this.step);
    if (!this.gizmo.step(axis, direction * size, rotates)) return;
    if (rotates) this.#turned[axis] += direction * size;
    this.#pressed.add(event.key);
  }

  /** @param {string} key */
  #up(key) {
    if (!this.#pressed.delete(key) || this.#pressed.size > 0) return;
    this.#wait(performance.now());
  }

  /** End the drag when the robot rests. @param {number} since ms */
  #wait(since) {
    const part = this.session.selected;
    if (part === null) return;
    const { position } = this.view.pose(part.robot, part.node);
    this.#timer = setTimeout(() => {
      const moved = this.view.pose(part.robot, part.node).position.distanceTo(position);
      if (moved > RESTS && performance.now() - since < LONGEST) this.#wait(since);
      else this.#finish();
    }, QUIET);
  }

  #finish() {
    clearTimeout(this.#timer);
    this.#pressed.clear();
    if (!this.gizmo.stepping) return;
    const { part } = this.gizmo;
    this.gizmo.end();
    if (part !== null) announce(this.#summary(part));
  }

  /** The length of a step, in m. */
  get step() {
    const { selected } = this.session;
    return rounded(STEP * (this.session.robot(selected?.robot ?? "")?.length ?? 1));
  }

  /** Return where a part is, and by how much it was rotated. @param {Part} part */
  #summary({ robot, node }) {
    const { position } = this.view.pose(robot, node);
    const coordinates = position.toArray().map((value, i) => `${NAMES[i]} ${units.length(value)}`);
    const turned = this.#turned.flatMap((angle, i) => (angle === 0 ? [] : [`rotated by ${units.angle(angle)} about ${NAMES[i]}`]));
    return [`${this.session.called(robot, node)}: ${coordinates.join(", ")}`, ...turned].join("; ");
  }
}

/**
 * Return the number of 1, 2 or 5 times a power of ten that is nearest below a positive number.
 * @param {number} value
 */
export function rounded(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  const digit = value / power >= 5 ? 5 : value / power >= 2 ? 2 : 1;
  return Number(fixed(digit * power, 9));
}

/**
 * Select the next part of all robots, or the one before, and announce it.
 * @param {Session} session
 * @param {number} step 1 or -1
 */
export function selectNext(session, step) {
  const parts = [...session.robots, ...session.obstacles.filter(({ mobility }) => mobility > 0)].flatMap((robot) =>
    robot.nodes.map((node) => ({ robot: robot.name, node: node.name })),
  );
  if (parts.length === 0) return;
  const { selected } = session;
  const at = parts.findIndex(({ robot, node }) => robot === selected?.robot && node === selected.node);
  const next = parts[at < 0 ? (step > 0 ? 0 : parts.length - 1) : (at + step + parts.length) % parts.length];
  session.select(next.robot, next.node);
  announce(`${session.called(next.robot, next.node)} selected`);
}
