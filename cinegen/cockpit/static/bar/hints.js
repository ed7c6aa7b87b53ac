// Hints for who is new here, each once in this browser, when it helps: "Drag any part" below the robot until one is dragged, then undo
// after the first drag, pins after the second, rotations when a part is selected. If nothing happens for some seconds, a ghost of
// the robot's end is dragged by a hand; this only draws, nothing is sent.
//
// For tests: #hint; .label.hint; #hand while it is shown, and "hand" on the stage.

import { Box3, Group, Mesh, Vector3 } from "three";
import { byId, make, memory, sign, write } from "../base/dom.js";
import { frames } from "../base/frames.js";
import { copyOf } from "../aids/targets.js";
import { paint } from "../view/shapes.js";
import { theme } from "../view/theme.js";

const WAIT = 3000; // ms without input, until the hand comes
const TAKES = 2600; // ms
const FAR = 0.12; // characteristic lengths: the hand's way
const STAYS = 7000; // ms
const KEYS = window.matchMedia("(hover: hover) and (pointer: fine)").matches; // whether there is a keyboard, most likely
const TEXTS = {
  undo: KEYS ? "Undo takes it back (Ctrl+Z)" : "Undo takes it back",
  pin: KEYS ? "Click a part and pin it: it stays while you drag others" : "Hold a part and pin it: it stays while you drag others",
  rotate: "Drag an arrow to move it, or switch to rings to rotate it",
};
const FIRST = "Drag any part";
const ON_MAP = "Drag any part, or click a cell: the robot goes there";

/** @typedef {{ on: (name: "drag", listener: (part: object | null) => void) => unknown }} Dragging */

export class Hints {
  #known = new Set(memory.get("hints", /** @type {string[]} */ ([])));
  #drags = 0;
  #where = new Vector3();
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #timer; // of the hint that is shown
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #idle;
  /** @type {{ began: number, hand: HTMLElement, group: Group, drawn: string } | null} */
  #show = null;

  /** @param {{ view: View, session: Session, labels: Labels, draggings: Dragging[] }} parts */
  constructor({ view, session, labels, draggings }) {
    this.view = view;
    this.session = session;
    this.labels = labels;
    this.hint = byId("hint");
    for (const dragging of draggings) dragging.on("drag", (part) => this.#dragged(part));
    session.on("select", (part) => part !== null && this.#tell("rotate"));
    for (const event of /** @type {const} */ (["hello", "control"])) session.on(event, () => this.#first());
    view.before(() => {
      if (this.#waits) this.#where.copy(below(view));
    });
    frames.each((now) => this.#move(now));
    for (const event of ["pointerdown", "pointermove", "wheel", "keydown"]) window.addEventListener(event, () => this.#rest(), { capture: true, passive: true });
  }

  /** Whether no part was ever dragged, and a person can drag one. */
  get #waits() {
    const { session, view } = this;
    return !view.resolution.still && !this.#known.has("drag") && !session.hello?.playback && session.control !== "other" && session.robots.length > 0;
  }

  /** @param {string} id */
  #learn(id) {
    this.#known.add(id);
    memory.set("hints", [...this.#known]);
  }

  #first() {
    const { caption, playback } = this.session.hello ?? {};
    this.#put(playback ? (caption ?? "") : (this.hint.textContent ?? ""));
    this.#rest();
  }

  /** @param {string} text */
  #put(text) {
    write(this.hint, text);
    this.hint.hidden = text === "";
    const first = this.session.hello?.map ? ON_MAP : FIRST;
    this.labels.put("hint", this.#waits && text === "" ? first : "", this.#where, "hint"); // one sentence at a time
  }

  /** @param {keyof typeof TEXTS} id */
  #tell(id) {
    if (this.#known.has(id) || this.session.hello?.playback || this.session.control === "other") return;
    this.#learn(id);
    this.#put(TEXTS[id]);
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#put(""), STAYS);
  }

  /** @param {object | null} part */
  #dragged(part) {
    if (part !== null) {
      if (!this.#known.has("drag")) this.#learn("drag");
      this.#first();
      return;
    }
    this.#drags += 1;
    if (!this.#known.has("undo")) this.#tell("undo");
    else if (this.#drags > 1) this.#tell("pin");
  }

  /** Where the end of the first robot is. @param {Vector3} point */
  #end(point) {
    const [{ name, end }] = this.session.robots;
    return this.view.pose(name, end, point).position;
  }

  /** Something was done: the hand goes, or comes after some seconds more. */
  #rest() {
    clearTimeout(this.#idle);
    this.#stop();
    if (this.#known.has("hand") || !this.#waits || window.matchMedia("(prefers-reduced-motion: reduce)").matches) return;
    this.#idle = setTimeout(() => this.#begin(), WAIT);
  }

  #begin() {
    if (!this.#waits) return;
    if (this.view.headset !== null || document.documentElement.dataset.view !== "ready") return void this.#rest();
    this.#learn("hand");
    const [{ name, end, byName, length }] = this.session.robots;
    const hand = make("span", { id: "hand" }, sign("hand"));
    const group = Object.assign(new Group(), { name: "hand" });
    const bare = this.view.group(name, end).children.every((child) => child.name === "triad");
    const drawn = (bare && byName.get(end)?.parent) || end; // a frame on a link
    copyOf(this.view.group(name, drawn), group, paint(theme.accent, { opacity: 0.3, through: false }));
    this.view.pose(name, drawn, group.position, group.quaternion);
    group.updateMatrix();
    const point = this.#end(new Vector3()).clone().applyMatrix4(group.matrix.clone().invert());
    const far = group.children.filter((mesh) => new Box3().setFromObject(mesh).distanceToPoint(point) > FAR * length);
    if (far.length < group.children.length) group.remove(...far); // of a long part, only what is at its end
    this.labels.layer.append(hand);
    this.view.stage.add(group);
    this.#show = { began: performance.now(), hand, group, drawn };
  }

  #stop() {
    this.#show?.hand.remove();
    if (this.#show !== null) this.view.stage.remove(this.#show.group);
    this.#show = null;
  }

  /** @param {number} now */
  #move(now) {
    if (this.#show === null) return;
    const { began, hand, group, drawn } = this.#show;
    const share = Math.max(0, now - began) / TAKES;
    if (share > 1) {
      this.#stop();
      this.view.changed();
      return;
    }
    const [robot] = this.session.robots;
    const way = new Vector3(0.8, 0.6, 0).applyQuaternion(this.view.cameraOrientation()).multiplyScalar(FAR * robot.length * Math.sin(Math.PI * share) ** 2);
    this.view.pose(robot.name, drawn, group.position, group.quaternion); // it may move
    group.position.add(way);
    const at = this.view.pixels(this.#end(new Vector3()).clone().add(way));
    if (at !== null) hand.style.transform = `translate(${at.x}px, ${at.y}px)`;
    hand.style.opacity = String(Math.min(1, 6 * share, 6 * (1 - share)));
    this.view.changed();
  }
}

/**
 * Return a point of the world that is seen in the middle below all parts: a hint there covers none.
 * @param {View} view
 */
function below({ root, camera }) {
  const seen = new Box3();
  const [corner, lowest] = [new Vector3(), new Vector3(0, Infinity, 0)];
  root.updateWorldMatrix(false, true);
  root.traverse((part) => {
    if (!(part instanceof Mesh)) return;
    if (part.geometry.boundingBox === null) part.geometry.computeBoundingBox();
    const ends = [part.geometry.boundingBox.min, part.geometry.boundingBox.max];
    for (let i = 0; i < 8; i += 1) {
      corner.set(ends[i & 1].x, ends[(i >> 1) & 1].y, ends[i >> 2].z).applyMatrix4(part.matrixWorld).project(camera);
      seen.expandByPoint(corner);
      if (corner.y < lowest.y) lowest.copy(corner);
    }
  });
  lowest.x = (seen.min.x + seen.max.x) / 2;
  return root.worldToLocal(lowest.unproject(camera));
}
