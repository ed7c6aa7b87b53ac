// Adapts frames to the time that they take: no shadows and reflections while something moves, then fewer pixels; all of
// them at rest.

import { Events } from "../base/events.js";

const RICH = 40; // ms per frame: shadows and reflections are left out first
const SLOW = 60;
const TOO_SLOW = 150;
const USEFUL = 0.8; // of the time before: fewer pixels that spare less are not worth it
const SAMPLES = 8; // pictures before it is judged
const REST = 350; // ms without a new picture: then one is drawn with all pixels
const PAUSE = 1000; // ms: a longer time between two pictures says nothing of how long one took

/**
 * Events: slow, when pictures take too long even with the fewest pixels.
 * @extends {Events<{ slow: undefined }>}
 */
export class Resolution extends Events {
  /** @type {number | null} */
  #last = null; // when the last picture of a motion was asked for
  #moved = 0;
  #sum = 0;
  #count = 0;
  /** @type {{ ratio: number, mean: number } | null} */
  #before = null; // ratio and mean time before there were fewer pixels
  #stays = false;
  #ratio; // pixels of the screen to pixels drawn, while something moves
  #set;
  #plain = false;
  complete = false; // whether the next frame has shadows and reflections: at rest, and in motion if that is known to be fast
  constant = false; // all pixels, also while something moves: a film is made
  /** @type {number | null} */
  mean = null; // time from picture to picture, ms; null if not known

  /**
   * @param {{ renderer: { setPixelRatio: (ratio: number) => void }, set_3d_pane_size: () => void }} viewer
   * @param {boolean} still pictures are taken from outside: always all pixels
   */
  constructor(viewer, still) {
    super();
    this.viewer = viewer;
    this.still = still;
    this.full = this.#ratio = this.#set = window.devicePixelRatio || 1;
    this.steps = [...new Set([this.full, Math.min(1, this.full), 0.75, 0.5])];
  }

  /** Return whether the scene at rest should be drawn with all pixels and with shadows now. @param {number} now */
  due(now) {
    return (this.#set !== this.full || !this.complete) && now - this.#moved > REST;
  }

  /** Set the resolution of the next frame, and whether it is complete. @param {boolean} moving */
  choose(moving) {
    const all = !moving || this.constant || this.still;
    const ratio = all ? this.full : this.#ratio;
    this.complete = all || (this.mean !== null && this.mean < RICH && !this.#plain);
    if (ratio === this.#set) return;
    this.#set = ratio;
    this.viewer.renderer.setPixelRatio(ratio);
    this.viewer.set_3d_pane_size();
  }

  /** Record that nothing had to be drawn. */
  idle() {
    this.#last = null;
  }

  /**
   * Record that a frame was requested at a time (ms). The next one is requested when it is drawn.
   * @param {number} now
   * @param {boolean} moving
   */
  drew(now, moving) {
    if (!moving) {
      this.#last = null;
      return;
    }
    if (this.#last !== null && now - this.#last < PAUSE) this.#judge(now - this.#last);
    this.#last = this.#moved = now;
  }

  /** @param {number} time */
  #judge(time) {
    this.mean = this.mean === null ? time : 0.8 * this.mean + 0.2 * time;
    this.#sum += time;
    this.#count += 1;
    if (this.still || this.#count < SAMPLES) return;
    const mean = this.#sum / this.#count;
    this.#sum = this.#count = 0;
    this.#plain ||= mean > RICH;
    if (this.#before !== null && mean > USEFUL * this.#before.mean) {
      this.#ratio = this.#before.ratio; // fewer pixels helped little: they are not what takes so long
      this.#stays = true;
    }
    this.#before = null;
    const next = this.steps[this.steps.indexOf(this.#ratio) + 1];
    if (mean > SLOW && !this.#stays && next !== undefined) {
      this.#before = { mean, ratio: this.#ratio };
      this.#ratio = next;
    } else if (mean > TOO_SLOW) {
      this.emit("slow");
    }
  }
}
