// A hand of a headset: a controller, a tracked hand, or a finger on a screen. It is a ray, with a strength, a thumbstick
// and buttons.

import { BufferGeometry, Float32BufferAttribute, Group, Line, LineBasicMaterial, Points, PointsMaterial, Quaternion, Ray, Vector3 } from "three";
import { ball, paint } from "../view/shapes.js";
import { theme } from "../view/theme.js";

const LONG = 2; // m, of a ray that meets nothing
const DOT = 0.006; // m
const DEAD = 0.15; // of a thumbstick
const STICK = 2; // index of its axes and
const BUTTONS = { trigger: 0, squeeze: 1, stick: 3, lower: 4, upper: 5 }; // https://www.w3.org/TR/webxr-gamepads-module-1/

/** @typedef {import("three").XRFrame} XRFrame */
/** @typedef {keyof typeof BUTTONS} Button */
/**
 * `navigator.xr`, as far as it is used.
 * @typedef {EventTarget & { isSessionSupported: (mode: string) => Promise<boolean>,
 *   requestSession: (mode: string, options: object) => Promise<import("three").XRSession> }} System
 */
/**
 * An `XRInputSource`, as far as it is used.
 * @typedef {{ handedness: "left" | "right" | "none", targetRayMode: string, targetRaySpace: EventTarget,
 *   gripSpace?: EventTarget | null, hand?: Iterable<[string, EventTarget]> | null, gamepad?: {
 *   axes: readonly number[], buttons: readonly { value: number, pressed: boolean }[],
 *   hapticActuators?: readonly { pulse?: (value: number, milliseconds: number) => unknown }[] } | null }} Source
 */

export class Hand {
  /** @type {Set<string>} */
  #down = new Set(); // buttons that are pressed
  /** @type {Set<string>} */
  #clicked = new Set(); // those that were not in the last frame
  tracked = false; // whether the headset knows where it is
  position = new Vector3(); // of the ray, in the room
  quaternion = new Quaternion();
  grip = new Vector3(); // where the hand is
  far = LONG; // m, to what the ray meets
  /** @type {Touched | null} */
  over = null; // what that is

  /** @param {Source} source @param {number} pointer its number in messages */
  constructor(source, pointer) {
    this.source = source;
    this.pointer = pointer;
    this.shape = new Group();
    this.paint = new LineBasicMaterial({ transparent: true, opacity: 0.8 });
    this.line = new Line(new BufferGeometry(), this.paint);
    this.line.geometry.setAttribute("position", new Float32BufferAttribute([0, 0, 0, 0, 0, -1], 3));
    this.dotPaint = paint(theme.accent, { opacity: 0.9 });
    this.dot = ball(this.dotPaint, DOT);
    this.joints = new Points(new BufferGeometry(), new PointsMaterial({ size: 0.012 }));
    for (const part of [this.line, this.joints]) part.frustumCulled = false;
    this.shape.add(this.line, this.dot);
    this.skeleton = new Group();
    this.skeleton.add(this.joints);
  }

  /** The ray in the room. */
  get ray() {
    return new Ray(this.position.clone(), new Vector3(0, 0, -1).applyQuaternion(this.quaternion));
  }

  /** Whether it measures strengths between none and full. */
  get isAnalog() {
    return !this.source.hand && (this.source.gamepad?.buttons.length ?? 0) > 0;
  }

  /** How hard a button is pressed, 0 to 1. @param {Button} button */
  strength(button) {
    return this.source.gamepad?.buttons[BUTTONS[button]]?.value ?? 0;
  }

  /** The deflection of its thumbstick, x to the right and y away, -1 to 1 each. */
  get stick() {
    const [x = 0, y = 0] = this.source.gamepad?.axes.slice(STICK) ?? [];
    return { x: rest(x), y: -rest(y) };
  }

  /** Whether a button was pressed in this frame. @param {Button} button */
  clicked(button) {
    return this.#clicked.has(button);
  }

  /** Vibrate briefly. */
  pulse() {
    this.source.gamepad?.hapticActuators?.[0]?.pulse?.(0.4, 25);
  }

  /** Find where it is. @param {XRFrame} frame @param {EventTarget} space of the room */
  locate(frame, space) {
    const pose = frame.getPose(this.source.targetRaySpace, space);
    this.tracked = Boolean(pose);
    if (pose) put(pose.transform, this.position, this.quaternion);
    const grip = this.source.gripSpace ? frame.getPose(this.source.gripSpace, space) : null;
    if (grip) put(grip.transform, this.grip);
    else this.grip.copy(this.position);
  }

  /**
   * Read where it is and what is pressed, once in each frame.
   * @param {XRFrame} frame
   * @param {EventTarget} space of the room
   */
  read(frame, space) {
    this.locate(frame, space);
    const before = this.#down;
    const buttons = this.source.gamepad?.buttons ?? [];
    const names = /** @type {Button[]} */ (Object.keys(BUTTONS));
    this.#down = new Set(names.filter((name) => buttons[BUTTONS[name]]?.pressed));
    this.#clicked = new Set([...this.#down].filter((name) => !before.has(name)));
    if (this.source.hand) this.#bend(frame, space, this.source.hand);
  }

  /** Draw its ray as far as to what it meets. @param {boolean} busy whether it drags */
  draw(busy) {
    this.shape.visible = this.tracked;
    this.skeleton.visible = this.tracked && Boolean(this.source.hand);
    this.shape.position.copy(this.position);
    this.shape.quaternion.copy(this.quaternion);
    this.line.scale.set(1, 1, this.far);
    this.line.visible = this.source.targetRayMode !== "screen";
    this.dot.position.set(0, 0, -this.far);
    this.dot.visible = busy || this.over !== null;
    this.paint.color.setHex(busy || this.over !== null ? theme.accent : theme.ink);
    this.dotPaint.color.setHex(theme.accent);
  }

  /** The ray meets nothing. */
  miss() {
    this.over = null;
    this.far = LONG;
  }

  /**
   * Draw the joints of a tracked hand.
   * @param {XRFrame} frame
   * @param {EventTarget} space
   * @param {Iterable<[string, EventTarget]>} hand
   */
  #bend(frame, space, hand) {
    const points = [];
    for (const [, joint] of hand) {
      const pose = frame.getJointPose(/** @type {any} */ (joint), /** @type {any} */ (space));
      if (pose) points.push(pose.transform.position.x, pose.transform.position.y, pose.transform.position.z);
    }
    this.joints.geometry.setAttribute("position", new Float32BufferAttribute(points, 3));
    /** @type {PointsMaterial} */ (this.joints.material).color.setHex(theme.accent);
  }
}

/**
 * Copy a pose of a headset.
 * @param {{ position: DOMPointReadOnly, orientation: DOMPointReadOnly }} transform
 * @param {Vector3} position
 * @param {Quaternion | null} quaternion
 */
export function put({ position: p, orientation: q }, position, quaternion = null) {
  position.set(p.x, p.y, p.z);
  quaternion?.set(q.x, q.y, q.z, q.w);
}

/** Nothing within the dead zone, and from there on from 0 to 1. @param {number} value */
function rest(value) {
  const size = Math.min(1, Math.abs(value));
  return size <= DEAD ? 0 : (Math.sign(value) * (size - DEAD)) / (1 - DEAD);
}
