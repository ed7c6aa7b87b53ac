// The handles of the gizmo: arrows, squares and a ball that translate an object, rings that rotate it. A handle is dragged
// along the axes that the object had when the drag began; the picture of the handles follows the object.
//
// The axes 0, 1 and 2 are the object's own; axis 3 points to the viewer.
//
// Events: drag (whether one begins or ends), move, change (of what is drawn).

import {
  ConeGeometry, CylinderGeometry, DoubleSide, Group, Mesh, MeshBasicMaterial, Plane, PlaneGeometry, Quaternion,
  Raycaster, SphereGeometry, TorusGeometry, Vector3,
} from "three";
import { Events } from "../base/events.js";

const COLOURS = [0xd1342f, 0x2f8f3c, 0x2f6fd1, 0x6b7280]; // x red, y green, z blue, the view's axis grey
const LIT = 0xf2b705; // the handle under the pointer
const NAMES = ["X", "Y", "Z", "V"];
const SIZE = 0.26; // length of an arrow, of half of the picture's height
const THIN = 0.014; // radius of shafts and rings, of an arrow's length
const THICK = 0.09; // the same of what catches the pointer
const SQUARE = 0.26;
const RING = 0.85; // radius; that of the view's axis is 1
const ALONG = 0.97; // cosine: an arrow that points to the viewer, or a ring seen from the side, can't be dragged as such
const EDGE = 0.2;

/** @typedef {{ axis: number, moves: "line" | "plane" | "turn", looks: Mesh[], catches: Mesh }} Handle */
/** @typedef {{ handle: Handle, pointer: number, position: Vector3, quaternion: Quaternion, axis: Vector3, eye: Vector3, from: Vector3,
 *   angle: number, last: number, scale: number }} Held in three's own axes, as the drag began */

/** @extends {Events<{ drag: boolean, move: undefined, change: undefined }>} */
export class Handles extends Events {
  /** @type {Record<string, Handle[]>} */
  #handles = { translate: [], rotate: [] };
  /** @type {Handle | null} */
  #over = null;
  /** @type {Held | null} */
  #held = null;
  #ray = new Raycaster();
  /** @type {import("three").Object3D | null} */
  #object = null;
  mode = "translate";

  /** @param {View} view @param {import("./pick.js").Pick} pick */
  constructor(view, pick) {
    super();
    this.view = view;
    this.pick = pick;
    this.drawn = new Group();
    this.drawn.visible = false;
    view.level.add(this.drawn);
    for (const mode of Object.keys(this.#handles)) {
      const group = new Group();
      this.drawn.add(group);
      this.#handles[mode] = mode === "translate" ? translations() : rotations();
      for (const { looks, catches } of this.#handles[mode]) group.add(...looks, catches);
    }
    const { canvas } = view;
    canvas.addEventListener("pointerdown", (event) => this.#down(event), true);
    canvas.addEventListener("pointermove", (event) => this.#move(event), true);
    for (const end of /** @type {const} */ (["pointerup", "pointercancel", "lostpointercapture"])) {
      canvas.addEventListener(end, (event) => {
        if (event.pointerId === this.#held?.pointer) this.release();
      });
    }
    view.before(() => this.#place());
  }

  /** Whether the pointer is on a handle. */
  get hovered() {
    return this.#over !== null;
  }

  /** @param {import("three").Object3D | null} object that is moved; null hides the handles */
  attach(object) {
    this.release();
    this.#object = object;
    this.#light(null);
    this.emit("change");
  }

  /** End a drag. */
  release() {
    if (this.#held === null) return;
    const { canvas } = this.view;
    const { pointer } = this.#held;
    this.#held = null;
    if (canvas.hasPointerCapture(pointer)) canvas.releasePointerCapture(pointer);
    this.#light(null);
    this.emit("drag", false);
  }

  /** The handle that a pointer meets. @param {{ clientX: number, clientY: number }} event */
  #met(event) {
    if (this.#object === null) return null;
    this.#place(); // the camera may have moved since the last picture
    this.drawn.updateWorldMatrix(true, true);
    this.#ray.ray.copy(this.pick.aim(event));
    const handles = this.#handles[this.mode].filter((handle) => handle.catches.visible);
    const [first] = this.#ray.intersectObjects(handles.map((handle) => handle.catches));
    return handles.find((handle) => handle.catches === first?.object) ?? null;
  }

  /** @param {PointerEvent} event */
  #down(event) {
    if (this.#held !== null) event.stopImmediatePropagation(); // a second finger
    if (!event.isPrimary || event.button !== 0 || this.#held !== null) return;
    const handle = this.#met(event);
    if (handle === null || this.#object === null) return;
    event.stopImmediatePropagation(); // the view stays where it is
    this.view.canvas.setPointerCapture(event.pointerId);
    const { position, quaternion } = this.drawn;
    const eye = this.#eye();
    const axis = handle.axis === 3 ? eye.clone() : new Vector3().setComponent(handle.axis, 1).applyQuaternion(quaternion);
    const held = { position: position.clone(), quaternion: this.#object.quaternion.clone(), axis, eye, scale: this.drawn.scale.x };
    this.#held = { handle, pointer: event.pointerId, ...held, from: new Vector3(), angle: 0, last: 0 };
    const from = this.#point(event);
    if (from === null) {
      this.#held = null;
      return;
    }
    this.#held.from.copy(from);
    this.#held.last = this.#angle(from);
    this.#light(handle);
    this.emit("drag", true);
  }

  /** @param {PointerEvent} event */
  #move(event) {
    if (this.#held === null) {
      if (event.buttons === 0) this.#light(this.#met(event));
      return;
    }
    event.stopImmediatePropagation();
    const object = this.#object;
    const point = this.#point(event);
    if (event.pointerId !== this.#held.pointer || point === null || object === null) return;
    const { handle, position, quaternion, axis, from } = this.#held;
    if (handle.moves === "turn") {
      const angle = this.#angle(point);
      const change = angle - this.#held.last;
      this.#held.angle += change - 2 * Math.PI * Math.round(change / (2 * Math.PI));
      this.#held.last = angle;
      const parent = object.parent?.getWorldQuaternion(new Quaternion()).invert() ?? new Quaternion();
      object.quaternion.setFromAxisAngle(axis.clone().applyQuaternion(parent), this.#held.angle).multiply(quaternion);
    } else {
      const to = position.clone().add(point).sub(from);
      object.position.copy(object.parent?.worldToLocal(to) ?? to);
    }
    this.emit("move");
    this.emit("change");
  }

  /**
   * The point of the dragged line or plane nearest to the pointer's ray, in three's own axes; null if there is none.
   * @param {PointerEvent} event
   */
  #point(event) {
    if (this.#held === null) return null;
    const { handle, position, axis, eye } = this.#held;
    const ray = this.pick.aim(event);
    if (handle.moves === "line") {
      // position + t axis is nearest to the ray where t (1 - b^2) = b (d . w) - axis . w, w from the ray's origin, b = axis . d
      const from = position.clone().sub(ray.origin);
      const slope = axis.dot(ray.direction);
      const away = (slope * ray.direction.dot(from) - axis.dot(from)) / Math.max(1 - slope * slope, 1e-6);
      return position.clone().addScaledVector(axis, away);
    }
    const normal = handle.moves === "turn" && this.#isEdge() ? eye : axis;
    return ray.intersectPlane(new Plane().setFromNormalAndCoplanarPoint(normal, position), new Vector3());
  }

  /** Whether the ring that is dragged is seen from its side: it is then rotated by a motion along it. */
  #isEdge() {
    return this.#held !== null && Math.abs(this.#held.axis.dot(this.#held.eye)) < EDGE;
  }

  /** The angle (rad) of a point about the axis of the ring that is dragged. @param {Vector3} point */
  #angle(point) {
    if (this.#held === null) return 0;
    const { position, axis, eye, from, scale } = this.#held;
    const radius = point.clone().sub(position);
    if (this.#isEdge()) return radius.dot(axis.clone().cross(eye).normalize()) / (RING * scale);
    const first = from.clone().sub(position);
    return Math.atan2(axis.dot(first.clone().cross(radius)), first.dot(radius));
  }

  /** The direction to the viewer, in three's own axes. */
  #eye() {
    return this.view.camera.getWorldPosition(new Vector3()).sub(this.drawn.position).normalize();
  }

  /** Draw the handles at the object, in one size on the screen. */
  #place() {
    const object = this.#object;
    this.drawn.visible = object !== null;
    if (object === null) return;
    object.updateWorldMatrix(true, false);
    object.getWorldPosition(this.drawn.position);
    object.getWorldQuaternion(this.drawn.quaternion);
    const { camera } = this.view;
    const away = camera.getWorldPosition(new Vector3()).distanceTo(this.drawn.position);
    this.drawn.scale.setScalar((SIZE * away * Math.tan((camera.fov * Math.PI) / 360)) / (camera.zoom || 1));
    const eye = this.#eye().applyQuaternion(this.drawn.quaternion.clone().invert());
    for (const [mode, handles] of Object.entries(this.#handles)) {
      for (const { axis, moves, looks, catches } of handles) {
        const along = axis === 3 ? 1 : Math.abs(eye.getComponent(axis));
        const seen = mode === this.mode && (moves === "line" ? along < ALONG : moves === "turn" || along > EDGE);
        for (const mesh of [...looks, catches]) {
          mesh.visible = seen;
          if (axis === 3) mesh.quaternion.setFromUnitVectors(new Vector3(0, 0, 1), eye);
        }
      }
    }
  }

  /** @param {Handle | null} handle */
  #light(handle) {
    if (handle === this.#over) return;
    this.#over = handle;
    for (const candidate of Object.values(this.#handles).flat()) {
      for (const { material } of candidate.looks) /** @type {MeshBasicMaterial} */ (material).color.set(candidate === handle ? LIT : COLOURS[candidate.axis]);
    }
    this.emit("change");
  }
}

/** Arrows along the axes, squares across them, and a ball that moves in the plane of the picture. */
function translations() {
  const handles = [];
  for (const axis of [0, 1, 2]) {
    const shaft = new CylinderGeometry(THIN, THIN, 0.8, 8).translate(0, 0.4, 0);
    const head = new ConeGeometry(4 * THIN, 0.2, 16).translate(0, 0.9, 0);
    const broad = new CylinderGeometry(THICK, THICK, 0.85, 6).translate(0, 0.6, 0);
    for (const geometry of [shaft, head, broad]) toAxis(geometry.rotateX(Math.PI / 2), axis); // from along y to along z
    handles.push(handle(axis, "line", [head, shaft], broad));
    const square = new PlaneGeometry(SQUARE, SQUARE).translate(0.35, 0.35, 0);
    handles.push(handle(axis, "plane", [toAxis(square, axis)], square));
  }
  return [...handles, handle(3, "plane", [new SphereGeometry(0.06, 16, 12)], new SphereGeometry(THICK, 8, 6))];
}

/** Rings about the axes. */
function rotations() {
  return [0, 1, 2, 3].map((axis) => {
    const [thin, broad] = [THIN, THICK].map((width) => new TorusGeometry(axis === 3 ? 1 : RING, width, 6, 64));
    return handle(axis, "turn", [toAxis(thin, axis)], toAxis(broad, axis));
  });
}

/**
 * Rotate a geometry about its z axis to one about another axis; x, y, z become y, z, x or z, x, y.
 * @template {import("three").BufferGeometry} G
 * @param {G} geometry
 * @param {number} axis
 * @returns {G}
 */
function toAxis(geometry, axis) {
  if (axis === 0) geometry.applyQuaternion(new Quaternion(0.5, 0.5, 0.5, 0.5));
  if (axis === 1) geometry.applyQuaternion(new Quaternion(-0.5, -0.5, -0.5, 0.5));
  return geometry;
}

/**
 * @param {number} axis
 * @param {Handle["moves"]} moves
 * @param {import("three").BufferGeometry[]} shapes
 * @param {import("three").BufferGeometry} broad
 * @returns {Handle}
 */
function handle(axis, moves, shapes, broad) {
  const opacity = moves === "plane" && axis !== 3 ? 0.5 : 0.9;
  const looks = shapes.map((shape) => mesh(shape, { color: COLOURS[axis], opacity }));
  for (const look of looks) look.name = NAMES[axis];
  return { axis, moves, looks, catches: mesh(broad, { opacity: 0, colorWrite: false }) };
}

/** A mesh that nothing hides. @param {import("three").BufferGeometry} shape @param {object} look */
function mesh(shape, look) {
  const material = new MeshBasicMaterial({ depthTest: false, depthWrite: false, transparent: true, side: DoubleSide, fog: false, ...look });
  const made = new Mesh(shape, material);
  made.renderOrder = 1000;
  return made;
}
