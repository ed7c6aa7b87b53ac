// Films of the scene: what the view draws, as a video of the browser's own encoder, or as a GIF that a worker encodes.
// Every frame is drawn while one is made, with all pixels. Labels and the panel are not in it.
//
// For tests: #film-video and #film-gif start one, #film-stop (hidden otherwise) ends it, and shows its length;
// data-frames is the number of frames that were drawn.

import { byId, make, write } from "../base/dom.js";
import { download } from "../base/download.js";
import { frames } from "../base/frames.js";
import { fixed } from "../base/units.js";
import { address } from "./gif.js";

const VIDEOS = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];
const RATE = 30; // frames per second of a video
const BITRATE = 8e6; // bit/s
const LONGEST = { video: 60, gif: 10 }; // s
const DELAY = 8; // hundredths of a second from frame to frame of a GIF, at least
const WIDEST = 480; // pixels of a GIF

/** @typedef {"video" | "gif"} Kind */
/** @typedef {{ suffix: string, frame: (now: number) => void, end: () => Promise<Blob> }} Recorder */

export class Film {
  /** @type {{ kind: Kind, recorder: Recorder, started: number } | null} */
  #running = null;

  /** @param {{ view: import("../view/view.js").View, session: import("../base/session.js").Session }} parts */
  constructor({ view, session }) {
    this.view = view;
    this.session = session;
    this.stopper = byId("film-stop");
    this.length = make("span", { class: "number" });
    this.stopper.append(this.length);
    this.stopper.addEventListener("click", () => this.end());
    const video = byId("film-video");
    video.hidden = videoType() === null;
    video.addEventListener("click", () => this.start("video"));
    byId("film-gif").addEventListener("click", () => this.start("gif"));
    frames.each((now) => this.#frame(now)); // after the view has drawn
  }

  /** @param {Kind} kind */
  start(kind) {
    if (this.#running !== null) return;
    const { view } = this;
    view.resolution.constant = true;
    const recorder = kind === "gif" ? gifOf(view.canvas) : videoOf(view.canvas, videoType() ?? "");
    this.#running = { kind, recorder, started: performance.now() };
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

  /** @param {number} now ms */
  #frame(now) {
    if (this.#running === null) return;
    const { kind, recorder, started } = this.#running;
    const seconds = Math.max(0, (performance.now() - started) / 1000);
    write(this.length, `${fixed(seconds, 0)} / ${LONGEST[kind]} s`);
    recorder.frame(now);
    this.stopper.dataset.frames = String(Number(this.stopper.dataset.frames) + 1);
    if (seconds >= LONGEST[kind]) this.end();
    else this.view.changed(); // also where nothing moves
  }
}

/** Return the best kind of video that the browser encodes; null if it encodes none. */
function videoType() {
  return typeof MediaRecorder === "undefined" ? null : (VIDEOS.find((type) => MediaRecorder.isTypeSupported(type)) ?? null);
}

/**
 * @param {HTMLCanvasElement} canvas
 * @param {string} type
 * @returns {Recorder}
 */
function videoOf(canvas, type) {
  const stream = canvas.captureStream(RATE);
  const recorder = new MediaRecorder(stream, { mimeType: type, videoBitsPerSecond: BITRATE });
  /** @type {Blob[]} */
  const parts = [];
  recorder.addEventListener("dataavailable", ({ data }) => parts.push(data));
  recorder.start(1000);
  return {
    suffix: type.startsWith("video/mp4") ? "mp4" : "webm",
    frame: () => {},
    end: () =>
      new Promise((resolve, reject) => {
        recorder.addEventListener("error", () => reject(new Error("the browser's encoder failed")));
        recorder.addEventListener("stop", () => resolve(new Blob(parts, { type })));
        recorder.stop();
        for (const track of stream.getTracks()) track.stop();
      }),
  };
}

/**
 * @param {HTMLCanvasElement} canvas
 * @returns {Recorder}
 */
function gifOf(canvas) {
  const worker = new Worker(address, { type: "module" });
  /** @type {Promise<Blob>} */
  const made = new Promise((resolve, reject) => {
    worker.addEventListener("message", ({ data }) => resolve(new Blob([data.bytes], { type: "image/gif" })));
    worker.addEventListener("error", () => reject(new Error("the encoder failed")));
  });
  made.finally(() => worker.terminate()).catch(() => {});
  /** @type {CanvasRenderingContext2D | null} */
  let context = null;
  /** @type {{ data: Uint8ClampedArray<ArrayBuffer>, at: number } | null} */
  let last = null; // frame that is shown until the next comes
  const hand = (/** @type {number} */ milliseconds) => {
    if (last === null) return;
    const delay = Math.min(1000, Math.max(2, Math.round(milliseconds / 10)));
    worker.postMessage({ frame: last.data, delay }, [last.data.buffer]);
    last = null;
  };
  return {
    suffix: "gif",
    frame: (now) => {
      if (last !== null && now - last.at < 10 * DELAY) return;
      if (context === null) {
        const scale = Math.min(1, WIDEST / canvas.width);
        const [width, height] = [canvas.width, canvas.height].map((size) => Math.max(1, Math.round(scale * size)));
        context = make("canvas", { width, height }).getContext("2d", { willReadFrequently: true });
        worker.postMessage({ width, height });
      }
      if (context === null) return;
      const { width, height } = context.canvas;
      context.drawImage(canvas, 0, 0, width, height);
      if (last !== null) hand(now - last.at);
      last = { data: context.getImageData(0, 0, width, height).data, at: now };
    },
    end: () => {
      hand(10 * DELAY);
      worker.postMessage({ end: true });
      return made;
    },
  };
}
