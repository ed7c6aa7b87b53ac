// What hands drag. The trigger drags the point that the ray meets; the part rotates freely about it. The squeeze button
// drags the part with its orientation, as if the hand held it. How hard the button is pressed is the weight of the task.
//
// Events: free (a hand that was pressed and touches no part), drag (a part that is dragged; null if none is any more).

import { Quaternion, Vector3 } from "three";
import { Events } from "../base/events.js";

const RANGE = 4; // weights from 1 / RANGE to RANGE: half pressed is 1, as that of a mouse
const REEL = 1.2; // per second: with the thumbstick away, a part goes away by this share of its distance
const NEAREST = 0.02; // m

/**
 * @typedef {{ hand: Hand, button: "trigger" | "squeeze", robot: string, node: string, at: Vector3, turn: Quaternion | null,
 *   sent: string }} HandDrag `at` and `turn`: the target in the axes of the hand
 */

/** @extends {Events<{ free: Hand, drag: HandDrag | null }>} */
export class HandDrags extends Events {
  /** @type {Map<Hand, HandDrag>} */
  #drags = new Map();
  #turn = 0; // of the hands, of which one looks for parts in each frame

  /**
   * @param {{ session: Session, view: View,
   *   pick: import("../pointer/pick.js").Pick, hands: import("./hands.js").Hands, world: World }} parts
   */
  constructor({ session, view, pick, hands, world }) {
    super();
    this.session = session;
    this.view = view;
    this.pick = pick;
    this.hands = hands;
    this.world = world;
    hands.on("press", ({ hand, button }) => this.#press(hand, button));
    hands.on("release", ({ hand, button }) => {
      if (this.#drags.get(hand)?.button === button) this.end(hand);
    });
    hands.on("lose", (hand) => this.end(hand));
    session.on("control", (control) => {
      if (control !== "other") return;
      this.#drags.clear(); // the server has ended them
      this.emit("drag", null);
    });
  }

  /** Return whether a hand drags. @param {Hand} hand */
  has(hand) {
    return this.#drags.has(hand);
  }

  /** End the drag of a hand; with a pin at the target, if wanted. @param {Hand} hand */
  end(hand, pin = false) {
    if (!this.#drags.delete(hand)) return;
    this.session.send({ type: "end_drag", pin, pointer: hand.pointer });
    if (this.#drags.size === 0) this.emit("drag", null);
  }

  /** Send the targets, and find what free hands point at. @param {number} dt s */
  update(dt) {
    const { all } = this.hands;
    this.#turn = (this.#turn + 1) % Math.max(1, all.length);
    all.forEach((hand, i) => {
      const drag = this.#drags.get(hand);
      if (drag !== undefined) this.#lead(drag, dt);
      else if (i === this.#turn) this.#look(hand); // rays cost most: one in each frame
      hand.draw(drag !== undefined);
    });
  }

  /** @param {Hand} hand */
  #look(hand) {
    hand.miss();
    if (!hand.tracked) return;
    const { ray } = hand;
    hand.over = this.pick.along(ray);
    if (hand.over !== null) hand.far = ray.origin.distanceTo(hand.over.point);
  }

  /** @param {Hand} hand @param {"trigger" | "squeeze"} button */
  #press(hand, button) {
    if (this.#drags.has(hand)) return; // by its other button
    this.#look(hand);
    const part = hand.over;
    if (part === null) {
      this.emit("free", hand);
      return;
    }
    if (!this.session.mayAct()) return;
    const { robot, node, group } = part;
    const back = hand.quaternion.clone().invert();
    const whole = button === "squeeze";
    const held = whole ? group.getWorldPosition(new Vector3()) : part.point.clone();
    const at = held.sub(hand.position).applyQuaternion(back);
    const turn = whole ? back.multiply(group.getWorldQuaternion(new Quaternion())) : null;
    const drag = { hand, button, robot, node, at, turn, sent: "" };
    this.#drags.set(hand, drag);
    const { pointer } = hand;
    if (whole) this.session.send({ type: "start_drag", robot, node, rotation: true, pointer });
    else {
      const point = /** @type {[number, number, number]} */ (group.worldToLocal(part.point.clone()).toArray());
      this.session.send({ type: "start_drag", robot, node, point, pointer });
    }
    hand.pulse();
    this.emit("drag", drag);
  }

  /** @param {HandDrag} drag @param {number} dt */
  #lead(drag, dt) {
    const { hand, at, turn } = drag;
    if (!hand.tracked) return; // the target stays
    const far = at.length();
    const reeled = Math.max(NEAREST, far * Math.exp(REEL * hand.stick.y * dt));
    if (far > 0) at.multiplyScalar(reeled / far);
    hand.far = drag.button === "trigger" ? reeled : hand.far;
    const target = at.clone().applyQuaternion(hand.quaternion).add(hand.position);
    const [position, rotation] = this.world.inside(target, turn === null ? hand.quaternion.clone() : hand.quaternion.clone().multiply(turn));
    const strength = hand.strength(drag.button);
    const message = {
      type: /** @type {const} */ ("move_drag"),
      position: /** @type {[number, number, number]} */ (position.toArray()),
      quaternion: turn === null ? null : /** @type {[number, number, number, number]} */ (rotation.toArray()),
      weight: hand.isAnalog && strength > 0 ? Number((RANGE ** (2 * strength - 1)).toPrecision(2)) : null,
      pointer: hand.pointer,
    };
    const text = JSON.stringify(message);
    if (text === drag.sent || ![...message.position, ...(message.quaternion ?? [])].every(Number.isFinite)) return;
    drag.sent = text;
    this.session.send(message);
  }
}
