// The target of a drag: sent at once, then at most once per picture, with the newest last.

import { atMostEvery } from "../base/dom.js";

const PICTURE = 1000 / 60; // ms

/** @typedef {[number, number, number]} Position */
/** @typedef {[number, number, number, number]} Rotation a quaternion x y z w */

export class DragTarget {
  /** @type {((position: Position) => void) | null} */
  sent = null; // called with the position of every target that is sent

  /** @param {Session} session */
  constructor(session) {
    this.send = atMostEvery(PICTURE, (/** @type {{ position: Position, quaternion: Rotation | null }} */ target) => {
      session.send({ type: "move_drag", ...target });
      this.sent?.(target.position);
    });
  }

  /** Move the target, in the world. @param {number[]} position @param {number[] | null} quaternion */
  move(position, quaternion = null) {
    if (![...position, ...(quaternion ?? [])].every(Number.isFinite)) return;
    this.send({ position: /** @type {Position} */ (position), quaternion: /** @type {Rotation | null} */ (quaternion) });
  }

  stop() {
    this.send.stop();
  }
}
