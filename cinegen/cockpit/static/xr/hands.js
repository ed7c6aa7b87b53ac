// The hands of a headset as they come and go, each with a number of its own. Events report what they do.
//
// Events: press and release ({ hand, button: "trigger" or "squeeze" }), lose (a hand that is no more).

import { Events } from "../base/events.js";
import { Hand } from "./hand.js";

const FIRST = { right: 0, none: 0, left: 1 };
const MOST = 10;

/** @typedef {{ hand: Hand, button: "trigger" | "squeeze" }} Press */
/** @typedef {import("./hand.js").Source} Source */

/** @extends {Events<{ press: Press, release: Press, lose: Hand }>} */
export class Hands extends Events {
  /** @type {Map<Source, Hand>} */
  #hands = new Map();
  /** @type {EventTarget | null} */
  #space = null;

  /** @param {import("three").Object3D} room where they are drawn */
  constructor(room) {
    super();
    this.room = room;
  }

  /** @returns {Hand[]} */
  get all() {
    return [...this.#hands.values()];
  }

  /** The left hand, or the only one; null if there is none. */
  get other() {
    return this.all.find(({ source }) => source.handedness === "left") ?? this.all[0] ?? null;
  }

  /**
   * Follow the hands of a session.
   * @param {EventTarget} session an `XRSession`
   * @param {EventTarget} space of the room
   */
  begin(session, space) {
    this.#space = space;
    for (const [button, name] of /** @type {const} */ ([["trigger", "select"], ["squeeze", "squeeze"]])) {
      session.addEventListener(`${name}start`, (event) => this.#pressed("press", button, event));
      session.addEventListener(`${name}end`, (event) => this.#pressed("release", button, event));
    }
  }

  /** Forget all hands. */
  end() {
    this.#keep(new Set());
  }

  /** Read them all. @param {import("three").XRFrame} frame */
  read(frame) {
    if (this.#space === null) return;
    const sources = /** @type {Source[]} */ (/** @type {unknown} */ ([...frame.session.inputSources]));
    const pointing = sources.filter(({ targetRayMode }) => targetRayMode !== "gaze");
    this.#keep(new Set(pointing));
    for (const source of pointing) this.#hand(source).read(frame, this.#space);
  }

  /**
   * @param {"press" | "release"} name
   * @param {"trigger" | "squeeze"} button
   * @param {Event} event an `XRInputSourceEvent`
   */
  #pressed(name, button, event) {
    const { inputSource, frame } = /** @type {Event & { inputSource: Source, frame: import("three").XRFrame }} */ (event);
    if (this.#space === null || inputSource.targetRayMode === "gaze") return;
    const hand = this.#hand(inputSource);
    hand.locate(frame, this.#space);
    this.emit(name, { hand, button });
  }

  /** @param {Source} source */
  #hand(source) {
    let hand = this.#hands.get(source);
    if (hand === undefined) {
      const taken = new Set(this.all.map(({ pointer }) => pointer));
      const numbers = [FIRST[source.handedness] ?? 0, ...Array(MOST).keys()];
      hand = new Hand(source, numbers.find((number) => !taken.has(number)) ?? MOST - 1);
      this.#hands.set(source, hand);
      this.room.add(hand.shape, hand.skeleton);
    }
    return hand;
  }

  /** @param {Set<Source>} sources */
  #keep(sources) {
    for (const [source, hand] of this.#hands) {
      if (sources.has(source)) continue;
      this.#hands.delete(source);
      this.room.remove(hand.shape, hand.skeleton);
      this.emit("lose", hand);
    }
  }
}
