// The controls of a replay: play, time, playback speed, and its stops.
//
// For tests: #transport with #play (aria-pressed), #seek (seconds), #playback-speed (select), #before, #after and #stop (text).

import { atMostEvery, button, byId, choice, isOn, make, press, show, sign, write } from "../base/dom.js";
import { speak } from "../base/speech.js";
import { fixed } from "../base/units.js";
import { fill } from "../panel/slider.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5];

export class Replay {
  #moved = -Infinity;
  seconds = 0; // duration
  /** @type {[number, string][]} */
  stops = []; // times to jump to, each with a name

  /** @param {Session} session */
  constructor(session) {
    this.session = session;
    this.bar = byId("transport");
    const playing = { id: "play", class: "small", "aria-label": "Play", "aria-pressed": "false", title: "Play or pause the recording" };
    this.play = button(playing, () => this.#send({ playing: !isOn(this.play) }), sign("play"));
    const time = { id: "seek", "aria-label": "Time in the recording", title: "Go to a time" };
    this.seek = make("input", { type: "range", min: 0, step: 0.01, ...time });
    const seek = atMostEvery(50, (/** @type {number} */ time) => this.#send({ time }));
    this.seek.addEventListener("input", () => {
      this.#moved = performance.now();
      fill(this.seek);
      seek(Number(this.seek.value));
    });
    this.time = make("span", { class: "number" });
    const on = { change: () => this.#send({ speed: Number(this.speed.value) }) };
    const speed = { id: "playback-speed", "aria-label": "Playback speed", title: "How fast it is played", on };
    this.speed = choice(speed, SPEEDS.map((value) => [value, `${value} ×`]));
    this.before = this.#step("before", "Previous", -1);
    this.after = this.#step("after", "Next", 1);
    this.stop = make("span", { id: "stop" });
    this.bar.append(this.before, this.stop, this.after, this.play, this.seek, this.time, this.speed);
    session.on("hello", ({ playback, stops = [] }) => {
      this.bar.hidden = !playback;
      this.seconds = playback?.seconds ?? 0;
      this.seek.max = String(this.seconds);
      this.bar.title = playback?.file ?? "";
      this.stops = stops;
      for (const part of [this.before, this.stop, this.after]) part.hidden = this.stops.length === 0;
      this.time.hidden = this.stops.length > 0;
    });
    session.on("report", ({ playback }) => {
      if (playback) this.#show(playback);
    });
  }

  /** @param {string} id @param {string} label @param {number} step */
  #step(id, label, step) {
    return button({ id, class: "small", "aria-label": label, title: `${label} stop of the recording` }, () => this.#go(step), sign(id));
  }

  /** Return the index of the last stop up to a time. @param {number} time */
  #at(time) {
    return Math.max(0, this.stops.findLastIndex(([begins]) => begins <= time + 1e-6));
  }

  /** @param {number} step */
  #go(step) {
    const wanted = Math.min(this.stops.length - 1, Math.max(0, this.#at(Number(this.seek.value)) + step));
    this.seek.value = String(this.stops[wanted][0]);
    this.#moved = performance.now();
    this.#send({ playing: false, time: this.stops[wanted][0] });
  }

  /** @param {{ playing?: boolean, time?: number, speed?: number }} change */
  #send(change) {
    this.session.command({ type: "control_playback", ...change });
  }

  /** @param {import("../base/messages").PlaybackStatus} status */
  #show({ time = 0, playing = false, speed = 1 }) {
    press(this.play, playing);
    show(this.play, playing ? "pause" : "play");
    if (performance.now() - this.#moved > 400) this.seek.value = String(time);
    fill(this.seek);
    speak(this.seek, `${fixed(Number(this.seek.value), 1)} s of ${fixed(this.seconds, 1)} s`);
    if (this.stops.length) write(this.stop, this.stops[this.#at(time)][1]);
    write(this.time, `${fixed(time, 1)} / ${fixed(this.seconds, 1)} s`);
    if (document.activeElement !== this.speed && SPEEDS.includes(speed)) this.speed.value = String(speed);
  }
}
