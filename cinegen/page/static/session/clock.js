// Ticks in the frames of the page: each frame advances the session by the time that has passed, in ticks of one period.

const LONGEST = 0.1; // s: of a longer pause, as in a hidden tab, the rest is dropped
const COUNTED = 1000; // ms

export class Clock {
  /** @type {number | null} */
  #last = null; // ms, of the last frame
  #owed = 0; // s, not yet ticked
  /** @type {[number, number][]} */
  #frames = []; // [when (ms), ticks]

  /** @param {number} period of a tick, s */
  constructor(period) {
    this.period = period;
  }

  /** Return the number of ticks that are due in a frame. @param {number} now ms */
  due(now) {
    const passed = this.#last === null ? this.period : Math.max(0, (now - this.#last) / 1000);
    this.#last = now;
    this.#owed = Math.min(this.#owed + passed, LONGEST);
    const ticks = Math.floor(this.#owed / this.period + 1e-6);
    this.#owed = Math.max(0, this.#owed - ticks * this.period);
    return ticks;
  }

  /** Note what a frame did. @param {number} now ms @param {number} ticks */
  note(now, ticks) {
    this.#frames.push([now, ticks]);
    while (this.#frames[0][0] < now - COUNTED) this.#frames.shift();
  }

  /** Ticks in the last second. */
  get ticks() {
    return this.#frames.reduce((sum, [, ticks]) => sum + ticks, 0);
  }
}
