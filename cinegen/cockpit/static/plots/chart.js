// A chart: lines over the last seconds, drawn on a canvas. Where there are more samples than pixels, a line shows the
// first, least, greatest and last of each pixel, so that its cost is bounded by the width and no peak is lost.

import { make } from "../base/dom.js";
import { fractionOf } from "./scale.js";

const LEFT = 40; // pixels, for the ticks' texts
const BOTTOM = 16;
const TOP = 6;
const RIGHT = 6;
const GAP = 1; // s without a sample: the line is interrupted

/** Colours of Okabe and Ito; lines beyond are dashed. */
const COLOURS = ["--blue", "--vermilion", "--green", "--orange", "--purple", "--sky"];
const DASHES = [[], [5, 3], [2, 2], [7, 2, 2, 2]];

/** Return the colour (a CSS variable) and the dashes of a line. @param {number} number */
export function styleOf(number) {
  const dashes = DASHES[Math.floor(number / COLOURS.length) % DASHES.length];
  return { colour: COLOURS[number % COLOURS.length], dashes };
}

/** @typedef {import("./history.js").History} History */
/** @typedef {{ column: number, style: ReturnType<typeof styleOf> }} Line */

export class Chart {
  #width = 0;
  #height = 0;

  /** @param {(pointer: number | null) => void} pointed called with the fraction of the time axis that the pointer is at */
  constructor(pointed) {
    this.canvas = make("canvas", { class: "chart", role: "img" });
    this.context = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    new ResizeObserver(() => {
      this.#width = this.canvas.clientWidth;
      this.#height = this.canvas.clientHeight;
    }).observe(this.canvas);
    this.canvas.addEventListener("pointermove", ({ offsetX }) => {
      const part = (offsetX - LEFT) / (this.#width - LEFT - RIGHT);
      pointed(part >= 0 && part <= 1 ? part : null);
    });
    this.canvas.addEventListener("pointerleave", () => pointed(null));
  }

  /**
   * Draw lines of a history.
   * @param {History} history
   * @param {Line[]} lines
   * @param {{ to: number, seconds: number, scale: import("./scale.js").Scale, shown: (value: number) => number,
   *   pointer: number | null }} options end and length of the time axis (s), scale of the values as they are shown, the
   *   fraction of the time axis at which a mark is drawn
   */
  draw(history, lines, { to, seconds, scale, shown, pointer }) {
    const [width, height] = [this.#width, this.#height];
    if (width <= LEFT + RIGHT || height <= TOP + BOTTOM) return;
    const { canvas, context } = this;
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const style = getComputedStyle(canvas);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    context.font = `11px ${style.fontFamily}`;
    const [wide, high] = [width - LEFT - RIGHT, height - TOP - BOTTOM];
    /** @param {number} value */
    const y = (value) => TOP + high * (1 - fractionOf(scale, value));
    this.#axes(style, scale, y, seconds, wide, high);
    if (pointer !== null) {
      context.fillStyle = style.getPropertyValue("--edge");
      context.fillRect(LEFT + wide * pointer, TOP, 1, high);
    }
    const first = Math.max(0, history.since(to - seconds) - 1); // the line comes from outside
    context.save();
    context.beginPath();
    context.rect(LEFT, 0, wide, height);
    context.clip();
    context.lineWidth = 1.5;
    context.lineJoin = "round";
    for (const { column, style: { colour, dashes } } of lines) {
      context.strokeStyle = style.getPropertyValue(colour);
      context.setLineDash(dashes);
      context.beginPath();
      trace(context, history, column, first, (time) => LEFT + wide * (1 - (to - time) / seconds), (value) => y(shown(value)));
      context.stroke();
    }
    context.restore();
  }

  /**
   * @param {CSSStyleDeclaration} style
   * @param {import("./scale.js").Scale} scale
   * @param {(value: number) => number} y
   * @param {number} seconds
   * @param {number} wide
   * @param {number} high
   */
  #axes(style, scale, y, seconds, wide, high) {
    const { context } = this;
    const [ink, line] = ["--faint", "--line"].map((name) => style.getPropertyValue(name));
    context.textBaseline = "middle";
    context.textAlign = "right";
    for (const { at, text } of scale.ticks) {
      context.fillStyle = line;
      context.fillRect(LEFT, Math.round(y(at)), wide, 1);
      context.fillStyle = ink;
      context.fillText(text, LEFT - 5, y(at));
    }
    context.textBaseline = "alphabetic";
    for (const part of [0, 0.5, 1]) {
      const x = LEFT + wide * part;
      context.fillStyle = line;
      context.fillRect(Math.round(x), TOP, 1, high);
      context.fillStyle = ink;
      context.textAlign = part === 0 ? "left" : part === 1 ? "right" : "center";
      context.fillText(part === 1 ? "0 s" : `−${(1 - part) * seconds} s`, x, TOP + high + 12);
    }
  }
}

/**
 * Trace a line of a history: at most four points of each pixel.
 * @param {{ moveTo: (x: number, y: number) => void, lineTo: (x: number, y: number) => void }} path
 * @param {History} history
 * @param {number} column
 * @param {number} first sample
 * @param {(time: number) => number} x pixels, of times
 * @param {(value: number) => number} y pixels, of values
 */
export function trace(path, history, column, first, x, y) {
  let drawing = false;
  let last = -Infinity; // time of the last sample
  let pixel = NaN;
  let [least, most, end] = [NaN, NaN, NaN];
  const flush = () => {
    if (Number.isNaN(pixel)) return;
    if (least !== most) {
      path.lineTo(pixel, most);
      path.lineTo(pixel, least);
      path.lineTo(pixel, end);
    }
    pixel = NaN;
  };
  for (let i = first; i < history.count; i += 1) {
    const value = history.value(column, i);
    if (Number.isNaN(value)) {
      flush();
      drawing = false;
      continue;
    }
    const time = history.time(i);
    const at = Math.round(x(time));
    const height = y(value);
    if (!drawing || time - last > GAP) {
      flush();
      path.moveTo(at, height);
      drawing = true;
      [pixel, least, most, end] = [at, height, height, height];
    } else if (at === pixel) {
      least = Math.min(least, height);
      most = Math.max(most, height);
      end = height;
    } else {
      flush();
      path.lineTo(at, height);
      [pixel, least, most, end] = [at, height, height, height];
    }
    last = time;
  }
  flush();
}
