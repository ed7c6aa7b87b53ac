// Sliders whose filled part shows the value, also on a log scale.

import { make } from "../base/dom.js";
import { speak } from "../base/speech.js";

export const STEPS = 1000;

/** How far a slider is filled. @param {HTMLInputElement} input */
export function fill(input) {
  const { min, max, value } = input;
  const share = (Number(value) - Number(min)) / (Number(max) - Number(min) || 1);
  input.style.setProperty("--fill", `${(100 * share).toFixed(2)}%`);
}

/** @typedef {{ id?: string, label: string, hint: string, low: number, high: number, format: (value: number) => string }} Shown */
/** @typedef {Shown & { id: string, name: "gain" | "damping" | "linear_speed" | "angular_speed" }} SettingSlider */

/**
 * Sliders on log scales of the session's settings, in rows: { rows, show(settings) }.
 * @param {Session} session
 * @param {SettingSlider[]} table `id` is the text of the row, too
 */
export function settingSliders(session, table) {
  const sliders = table.map(({ name, ...options }) => logSlider({ ...options, changed: (value) => session.command({ type: "change_settings", [name]: value }) }));
  return {
    rows: sliders.map(({ input, output }, i) => make("label", { class: "pair three" }, table[i].id, input, output)),
    show: (/** @type {import("../base/messages").Settings | undefined} */ settings) => sliders.forEach(({ show }, i) => show(settings?.[table[i].name])),
  };
}

/**
 * A slider on a log scale from `low` to `high`, with its value in format: { input, output, show(value) }.
 * `changed(value)` is called while it is moved; meanwhile `show` has no effect.
 * @param {Shown & { changed: (value: number) => void }} options
 */
export function logSlider({ id, label, hint, low, high, format, changed }) {
  const title = `${hint}. From ${format(low)} to ${format(high)}`; // the slider's own range is that of its steps
  const input = make("input", { type: "range", id, min: 0, max: STEPS, step: 1, title, "aria-label": label });
  const output = make("output", { class: "number", "aria-live": "off" });
  const value = () => low * (high / low) ** (Number(input.value) / STEPS);
  /** @param {number} number */
  const display = (number) => {
    output.textContent = format(number);
    speak(input, format(number));
    fill(input);
  };
  let moved = -Infinity;
  input.addEventListener("input", () => {
    moved = performance.now();
    display(value());
    changed(Number(value().toPrecision(3)));
  });
  /** @param {number | undefined} number */
  const show = (number) => {
    if (number === undefined || !(number > 0) || performance.now() - moved < 400) return;
    const at = Math.round((STEPS * Math.log(number / low)) / Math.log(high / low));
    if (Number(input.value) !== at) input.value = String(at);
    display(number);
  };
  return { input, output, show };
}
