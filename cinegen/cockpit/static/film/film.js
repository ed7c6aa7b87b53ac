// Films of the scene: what the view draws, as a video of the browser's own encoder.
// Every frame is drawn while one is made, with all pixels. Labels and the panel are not in it.
//
// For tests: #film-video starts one, #film-stop (hidden otherwise) ends it, and shows its length;
// data-frames is the number of frames that were drawn.

import { byId, make, write } from "../base/dom.js";
import { download } from "../base/download.js";
import { frames } from "../base/frames.js";
import { fixed } from "../base/units.js";

const VIDEOS = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];
const RATE = 30; // frames per second of a video
const BITRATE = 8e6; // bit/s
const LONGEST = 60; // s

/** @typedef {{ suffix: string, end: () => Promise<Blob> }} Recorder */

export class Film {
  /** @type {{ recorder: Recorder, started: number } | null} */
  #running = null;

  /** @param {{ view: View, session: Session }} parts */
  constructor({ view, session }) {
    this.view = view;
    this.session = session;
    this.stopper = byId("film-stop");
    this.length = make("span", { class: "number" });
    this.stopper.append(this.length);
    this.stopper.addEventListener("click", () => this.end());
    const type = videoType();
    const button = byId("film-video");
    button.hidden = type === null;
    if (type !== null) button.addEventListener("click", () => this.start(type));
    frames.each(() => this.#frame()); // after the view has drawn
  }

  /** @param {string} type of the video */
  start(type) {
    if (this.#running !== null) return;
    const { view } = this;
    view.resolution.constant = true;
    this.#running = { recorder: videoOf(view.canvas, type), started: performance.now() };
    this.stopper.hidden = false;
    this.stopper.dataset.frames = "0";
    view.changed();
  }

  /** End the film, and download it. */
  async end() {
    if (this.#running === null) return;
    const { recorder } = this.#running;
    this.#running = null;
    this.view.resolution.constant = false;
    this.stopper.hidden = true;
    try {
      download(await recorder.end(), `${this.session.hello?.title ?? "cinegen"}.${recorder.suffix}`);
    } catch (error) {
      this.session.emit("notice", { text: `The film was not made: ${error instanceof Error ? error.message : error}`, level: "warning" });
    }
  }

  #frame() {
    if (this.#running === null) return;
    const seconds = Math.max(0, (performance.now() - this.#running.started) / 1000);
    write(this.length, `${fixed(seconds, 0)} / ${LONGEST} s`);
    this.stopper.dataset.frames = String(Number(this.stopper.dataset.frames) + 1);
    if (seconds >= LONGEST) this.end();
    else this.view.changed(); // also where nothing moves
  }
}

/** Return the best kind of video that the browser encodes; null if it encodes none. */
function videoType() {
  return typeof MediaRecorder === "undefined" ? null : (VIDEOS.find((type) => MediaRecorder.isTypeSupported(type)) ?? null);
}

/** @param {HTMLCanvasElement} canvas @param {string} type @returns {Recorder} */
function videoOf(canvas, type) {
  const stream = canvas.captureStream(RATE);
  const recorder = new MediaRecorder(stream, { mimeType: type, videoBitsPerSecond: BITRATE });
  /** @type {Blob[]} */
  const parts = [];
  recorder.addEventListener("dataavailable", ({ data }) => parts.push(data));
  recorder.start(1000);
  return {
    suffix: type.startsWith("video/mp4") ? "mp4" : "webm",
    end: () => new Promise((resolve, reject) => {
        recorder.addEventListener("error", () => reject(new Error("the browser's encoder failed")));
        recorder.addEventListener("stop", () => resolve(new Blob(parts, { type })));
        recorder.stop();
        for (const track of stream.getTracks()) track.stop();
      }),
  };
}
