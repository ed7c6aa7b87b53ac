// Where the hand leads what it has taken: said at once, then once for each picture at most, newest last.

import { atMostEvery } from "../base/dom.js";

const PICTURE = 1000 / 60; // ms

export class Lead {
  /** @type {((lead: number[]) => void) | null} */
  said = null; // called with every target that is sent

  /** @param {import("../base/session.js").Session} session */
  constructor(session) {
    this.say = atMostEvery(PICTURE, (/** @type {number[]} */ lead) => {
      session.send({ lead });
      this.said?.(lead);
    });
  }

  /** @param {number[]} numbers 3 or 7, in the world */
  to(numbers) {
    if (numbers.every(Number.isFinite)) this.say(numbers);
  }

  stop() {
    this.say.stop();
  }
}
